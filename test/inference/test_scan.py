# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A scan says what fits say, for many terms at once."""

from __future__ import annotations

import numpy as np
import pytest

from pprs_dynamics.inference.regression.joint_fit import CERTAIN, Regression
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.score_test import Entry, ScoreTest
from pprs_dynamics.physics.effects.catalogue import CATALOGUE

SAMPLES, DRIVES, PERIOD = 600, 3, 0.01


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@pytest.fixture
def regression(rng: np.random.Generator) -> Regression:
    error = np.cumsum(rng.normal(size=(SAMPLES, DRIVES)), axis=0) * 0.05 + rng.normal(
        size=(SAMPLES, DRIVES))
    return Regression(Residuals(
        ('a', 'b', 'c'), PERIOD * np.arange(SAMPLES), np.zeros(SAMPLES, dtype=int), error,
        np.zeros_like(error), {}, {}, PERIOD))


def test_gains_of_a_scan_are_those_of_single_blocks(
        regression: Regression, rng: np.random.Generator) -> None:
    blocks = [regression.block({d: rng.normal(size=(k, SAMPLES)) for d in drives})
              for k, drives in ((1, (0, 1, 2)), (2, (0, 2)), (3, (1,)))]
    fixed = regression.block({0: 0.1 * rng.normal(size=(1, SAMPLES))}, CERTAIN * np.eye(1),
                             np.ones(1))
    beside = regression.block({d: rng.normal(size=(1, SAMPLES)) for d in (0, 1)})
    entries, rows, first = [], {d: [] for d in range(DRIVES)}, 0
    for block in (*blocks, fixed):
        size = len(next(iter(block.rows.values())))
        entries.append(Entry(block, tuple(range(first, first + size)), block.precision,
                             block.mean))
        for d in rows:
            rows[d].append(block.rows.get(d, np.zeros((size, SAMPLES))))
        first += size
    scan = ScoreTest(regression, {d: np.concatenate(parts).astype(np.float32)
                             for d, parts in rows.items()}, entries)
    for chosen in ((), (beside,), (beside, fixed)):
        fit = regression.fit(chosen)
        for labels, gains in scan.gains(fit):
            for block, gain in zip(labels, gains, strict=True):
                assert gain == pytest.approx(regression.gain(fit, block), abs=2e-3)


def test_without_a_precision_entries_have_the_g_prior(
        regression: Regression, rng: np.random.Generator) -> None:
    block = regression.block({1: rng.normal(size=(2, SAMPLES))})
    scan = ScoreTest(regression, {1: block.rows[1].astype(np.float32)}, [Entry('both', (0, 1))])
    fit = regression.fit(())
    [(labels, gains)] = scan.gains(fit)
    assert labels == ['both']
    assert gains[0] == pytest.approx(regression.gain(fit, block), abs=2e-3)


def test_asymmetric_friction_claims_dry_and_viscous_friction_apart() -> None:
    effect = CATALOGUE['asymmetric_friction']
    dry, viscous = (effect.hypotheses((name,)) for name in ('force_forward', 'viscous_backward'))
    assert len(dry) == len(viscous) == 1
    assert effect.hypotheses(('force_forward', 'force_backward')) == dry
    assert effect.hypotheses(('force_backward', 'viscous_forward')) == dry | viscous
    # What claims one thing only claims as many as it has sets of coefficients.
    spring = CATALOGUE['hysteresis']
    assert len(spring.hypotheses(('force',)) | spring.hypotheses(('coefficient',))) == 2
