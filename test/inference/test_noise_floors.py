# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The noise beside all columns against the noise that was put in, whatever the model lacks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from made_up_arm import motion, real_arm, record

from benchmarks.scores.localisation import make_noise
from pprs_dynamics import compare
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.noise_floors import noise_floors

NOISE = 0.2  # [N m] of a sample
LOAD = {'effects.active': ('payload_mass',), 'effects.payload_mass.mass': 2.0}


@cache
def design() -> Design:
    arm = real_arm(Path(mkdtemp()))
    return Design.of(arm, [record(arm, motion(), NOISE)])


@pytest.mark.parametrize(('phi', 'off'), [(0.0, 0.06), (0.9, 0.12), (0.99, 0.35)])
def test_the_noise_is_that_which_was_put_in_beside_all_columns(phi: float, off: float) -> None:
    made = design()
    samples, width = made.residuals.measured.shape
    noise = NOISE * make_noise(phi, samples, np.random.default_rng(3), width)
    fits = FittedSets(replace(made, residuals=replace(
        made.residuals, measured=made.residuals.model + noise)), DECISIONS)
    found = noise_floors(fits)
    put_in = dict(zip(made.drives, noise.std(axis=0), strict=True))
    assert len(found) >= 2  # of noise as slow as the motion little is seen beside it
    assert found == pytest.approx({name: put_in[name] for name in found}, rel=off)


def test_what_a_model_lacks_is_no_noise(tmp_path: Path) -> None:
    model, moved = real_arm(tmp_path), motion()
    loaded = compare(model, record(real_arm(tmp_path, **LOAD), moved, NOISE)).comparison.drives
    plain = compare(model, record(model, moved, NOISE)).comparison.drives
    for name in ('swing', 'reach'):  # those that carry the load
        assert loaded[name].rms > 5 * plain[name].rms
        assert loaded[name].noise_floor == pytest.approx(plain[name].noise_floor, rel=0.15)
        assert plain[name].grade == 'noise'
        assert loaded[name].grade != 'noise'


def test_a_noise_that_cannot_be_told_is_not_printed(tmp_path: Path) -> None:
    model = real_arm(tmp_path)
    found = compare(model, record(model, motion(0.9), NOISE)).comparison
    assert found.drives
    assert all(drive.noise_floor is None for drive in found.drives.values())
    assert 'the noise is not known' in found.verdict
