# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A real closed chain with a weight that the model does not have. Its data is not in the package.

A part of each run, and the base model fitted to that part: short enough to be run every time.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.real import davinci as closed_chain
from benchmarks.real.recorded_data import find_data, missing
from pprs_dynamics import DriveModel
from pprs_dynamics.app.api.first_model import first_model
from pprs_dynamics.inference.fit.mechanism_fit import fit_mechanism
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.candidates import EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.measurement.files.recording import Recording, read_recording

DATA = find_data('dvrk', closed_chain.FREE)
pytestmark = pytest.mark.skipif(DATA is None, reason=missing('dvrk'))
PART = 12.0  # [s], a period of the path
LEVER = 0.105 * 0.535  # [kg m], the weight on the front link and its place above the pitch axis


def part_of(model: DriveModel, name: str) -> Recording:
    """Return the first seconds of a recording."""
    assert DATA is not None
    whole = read_recording(DATA / name, model.recorded)
    end = int(np.searchsorted(whole.time, whole.time[0] + PART))
    return replace(whole, segments=(slice(0, end),))


@pytest.fixture(scope='module')
def base(tmp_path_factory: pytest.TempPathFactory) -> DriveModel:
    """Return the base model of a part of the free run."""
    assert DATA is not None
    folder = tmp_path_factory.mktemp('dvrk')
    shutil.copyfile(DATA / 'psm.urdf', folder / 'psm.urdf')
    (folder / 'psm.yaml').write_text(closed_chain.model_text())
    model = DriveModel.load(folder / 'psm.yaml')
    return fit_mechanism(model, [part_of(model, closed_chain.FREE)])[0]


@pytest.mark.parametrize('name', [closed_chain.FREE, 'load_parallel_105_fast.csv.gz'])
def test_masses_that_are_guesses_are_no_other_unit(name: str, tmp_path: Path) -> None:
    assert not first_model(DATA / 'psm.urdf', [DATA / name], tmp_path / 'a.yaml').questions


def test_the_weight_on_top_is_a_body_on_the_pitch_links(base: DriveModel) -> None:
    fits = FittedSets(Design.of(base, [part_of(base, 'load_insertion_105_fast.csv.gz')]), DECISIONS)
    found = [fits.refined(fits.evaluate((EffectCandidate.of([component]),)))
             for component in fits.components.structure]
    best = min(found, key=lambda fitted: fitted.cost)
    (candidate,) = best.effects
    assert candidate.placed_name == 'link_mass:back_link'
    assert candidate.effect.places_of(candidate.components[0].names) == (
        ('back_link', 'front_link', 'rocker'),)
    values = candidate.components[0].values(best.coefficients(candidate.components[0]))
    lever = values['back_link.mass'] * values['back_link.z']
    assert lever == pytest.approx(LEVER, rel=0.15)  # of 12 s, with the base of 12 s
