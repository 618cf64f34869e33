# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What is said would have been seen is seen, and what is much smaller is not."""

from __future__ import annotations

import numpy as np
import pytest
from single_axis import AXIS, axis_values

from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel

MASS, VISCOUS, COULOMB, WIDTH = 20.0, 40.0, 6.0, 0.001
NOISE = 0.3  # [N]
TIME = np.arange(0.0, 20.0, 0.004)
MOTION = ((0.06, 0.5), (0.03, 1.1), (0.01, 2.3))  # amplitude [m], frequency [Hz]
Q, Q_DOT, Q_DDOT = (sum(a * (2 * np.pi * f) ** n * np.sin(2 * np.pi * f * TIME + n * np.pi / 2)
                        for a, f in MOTION) for n in range(3))
# What each adds per unit of its one number.
LAWS = {'coulomb_friction': np.tanh(Q_DOT / WIDTH), 'viscous_friction': Q_DOT,
        'drive_inertia': Q_DDOT, 'effort_offset': np.ones_like(TIME),
        'quadratic_friction': Q_DOT * np.abs(Q_DOT)}


def told(seed: int, more: np.ndarray | float = 0.0) -> Diagnosis:
    model = DriveModel.from_parameters(
        axis_values(MASS, VISCOUS, COULOMB, width=WIDTH))
    force = (MASS * Q_DDOT + VISCOUS * Q_DOT + COULOMB * np.tanh(Q_DOT / WIDTH) + more
             + NOISE * np.random.default_rng(seed).standard_normal(len(TIME)))
    return diagnose(model, [Recording.from_arrays('run', TIME, Q[:, None], None, force[:, None],
                                                  (AXIS,))])


@pytest.fixture(scope='module')
def adequate() -> Diagnosis:
    found = told(1)
    assert found.verdict == 'adequate'
    return found


@pytest.mark.parametrize('name', [
    'coulomb_friction', 'drive_inertia', *(pytest.param(name, marks=pytest.mark.slow) for name in (
        'viscous_friction', 'effort_offset', 'quadratic_friction'))])
def test_an_effect_of_twice_the_size_is_seen_and_one_of_a_quarter_is_not(
        name: str, adequate: Diagnosis) -> None:
    size = next(one.size for one in adequate.detectable if one.effect.name == name)
    for seed in (2, 3):
        assert told(seed, 2 * size * LAWS[name]).verdict != 'adequate'
        assert told(seed, size / 4 * LAWS[name]).verdict == 'adequate'


def test_more_noise_hides_more(adequate: Diagnosis) -> None:
    loud = {one.effect.name: one.size for one in told(
        5, 2 * NOISE * np.random.default_rng(6).standard_normal(len(TIME))).detectable}
    quiet = {one.effect.name: one.size for one in adequate.detectable}
    for name in ('drive_inertia', 'coulomb_friction'):
        assert loud[name] > 1.5 * quiet[name]


def test_what_was_found_or_is_in_the_model_is_not_listed(adequate: Diagnosis) -> None:
    size = next(one.size for one in adequate.detectable if one.effect.name == 'viscous_friction')
    found = told(2, 20 * size * Q_DOT)
    assert [one.name for one in found.effects] == ['viscous_friction']
    names = {one.effect.name for one in found.detectable}
    assert 'viscous_friction' not in names
    assert 'drive_inertia' in names
