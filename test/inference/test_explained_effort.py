# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A model that explains little is told before all else, and never called adequate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import model_recordings
import numpy as np
import pytest
from made_up_arm import motion, real_arm, record, write_arm
from scipy.signal import lfilter

from pprs_dynamics import DriveModel, compare, diagnose, fit
from pprs_dynamics.inference.diagnosis.sentences import Sentences
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.search.explained_effort import little_explained
from pprs_dynamics.measurement.files.recording import Recording

UNRELATED = 12.0  # [N m] of an effort that is no force of this machine


def unrelated(model: DriveModel, seed: int = 5) -> Recording:
    """Return a recording whose first effort follows nothing that the drives do."""
    made = record(model, motion(6.0))
    rng = np.random.default_rng(seed)
    knots = rng.normal(size=len(made.time) // 40 + 2) * UNRELATED
    effort = made.effort.copy()
    effort[:, 0] = np.interp(np.arange(len(made.time)) / 40, np.arange(len(knots)), knots)
    effort[:, 0] += 0.2 * rng.normal(size=len(made.time))  # as measured, not computed
    return replace(made, effort=effort)


def test_compare_says_first_that_a_model_explains_little(tmp_path: Path) -> None:
    model = real_arm(tmp_path)
    found = compare(model, unrelated(model))
    share = found.comparison.drives['turn'].explained_variance
    assert share < 0.5
    assert found.verdict.startswith('The model explains')
    assert 'of the effort of turn' in found.verdict
    assert found.comparison.drives['turn'].grade == 'poor'
    assert 'accounts for' not in found.verdict
    assert found.to_dict()['explained']['turn'] == pytest.approx(share)
    said = str(found)
    assert 'pprs diagnose' not in said
    assert 'pprs fit' in said


def test_diagnose_calls_no_model_adequate_that_explains_little(tmp_path: Path) -> None:
    model = real_arm(tmp_path)
    found = diagnose(model, unrelated(model)).diagnosis
    assert found.verdict == 'unknown'
    assert 'turn' in found.little
    words = Sentences(found)
    assert words.headline.startswith('The model')
    assert 'of the effort of turn' in words.headline
    assert 'Nothing to add' not in words.following
    assert found.to_dict()['explained']['turn'] < 0.5


def test_a_description_alone_is_fitted_first_and_explains_then(tmp_path: Path) -> None:
    real = real_arm(tmp_path)
    bare = DriveModel.load(write_arm(tmp_path))
    made = record(real, motion(10.0))
    before = compare(bare, made)
    assert before.comparison.little
    assert 'no friction yet' in str(before)
    fitted = fit(bare, made)
    assert not fitted.fit.little
    assert min(fitted.to_dict()['explained'].values()) > 0.9
    assert compare(fitted.model, made).comparison.little == {}


def test_an_error_with_the_sign_of_the_motion_sends_nobody_to_check_units() -> None:
    real = DriveModel.load()
    bare = DriveModel.from_parameters({
        **real.values, 'friction.drives.coulomb': (0.0,) * 6,
        'friction.revolute.coulomb': 0.0, 'friction.spherical.coulomb': 0.0})
    compared = compare(bare, model_recordings.record(real, noise=0.01))
    assert compared.comparison.little
    said = ' '.join(str(compared).split())
    assert 'too little friction' in said
    assert 'Check units' not in said
    assert 'pprs diagnose' in said


@pytest.mark.parametrize('size', [0.0, 0.05])
def test_a_drive_that_stands_or_whose_effort_is_noise_has_nothing_to_explain(
    tmp_path: Path, size: float,
) -> None:
    model = real_arm(tmp_path)
    residuals, _ = measure_residuals(model, [record(model, motion(10.0))])
    rng = np.random.default_rng(2)
    noise = size * rng.normal(size=len(residuals))
    quiet = replace(residuals, measured=residuals.measured.copy(), model=residuals.model.copy())
    quiet.measured[:, 0], quiet.model[:, 0] = 3.0 + noise, 3.0
    assert little_explained(model, quiet) == {}
    # A force that varies more than all that was measured is not hidden in noise.
    quiet.model[:, 0] += 3 * noise.std() * np.sin(np.arange(len(residuals)) / 50)
    assert set(little_explained(model, quiet)) == ({'turn'} if size else set())
    still = replace(residuals, measured=residuals.measured.copy(), variables={
        **residuals.variables, 'velocity': residuals.variables['velocity'] * [0.0, 1.0, 1.0]})
    still.measured[:, 0] = 5 * np.sin(np.arange(len(residuals)) / 50)
    assert little_explained(model, still) == {}
    moving = replace(residuals, measured=still.measured)
    assert set(little_explained(model, moving)) == {'turn'}


def test_noise_that_is_slow_is_for_no_model_to_explain(tmp_path: Path) -> None:
    model = real_arm(tmp_path)
    residuals, _ = measure_residuals(model, [record(model, motion())])
    size = 1.5 * float(np.nanstd(residuals.model[:, 0]))
    white = np.random.default_rng(4).normal(size=len(residuals) + 500)
    slow = size * lfilter([0.1 ** 0.5], [1.0, -0.95], white)[500:]
    noisy = replace(residuals, measured=residuals.measured.copy())
    noisy.measured[:, 0] = residuals.model[:, 0] + slow
    assert set(little_explained(model, noisy)) == {'turn'}
    assert little_explained(model, noisy, noise={'turn': float(slow.std())}) == {}
    # Where nearly all is noise, the rest is less than the error of its variance.
    noisy.measured[:, 0] = residuals.model[:, 0] + 5 * slow
    assert little_explained(model, noisy, noise={'turn': 0.99 * 5 * float(slow.std())}) == {}
