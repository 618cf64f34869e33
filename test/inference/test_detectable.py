# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What is said would have been seen is seen, and what is much smaller is not."""

from __future__ import annotations

import pytest
from single_axis import axis, axis_recording

from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis

# What each adds per unit of its one number.
NUMBERS = {'coulomb_friction': 'force', 'viscous_friction': 'coefficient', 'drive_inertia': 'mass',
           'effort_offset': 'force'}


def told(seed: int, name: str = '', size: float = 0.0, noise: float = 0.3) -> Diagnosis:
    robot = axis({name: {NUMBERS[name]: size}} if name else {})
    return diagnose(axis(), [axis_recording(robot, seed, noise)])


@pytest.fixture(scope='module')
def adequate() -> Diagnosis:
    found = told(1)
    assert found.verdict == 'adequate'
    return found


@pytest.mark.parametrize('name', [
    'coulomb_friction', 'drive_inertia', *(pytest.param(name, marks=pytest.mark.slow) for name in (
        'viscous_friction', 'effort_offset'))])
def test_an_effect_of_twice_the_size_is_seen_and_one_of_a_quarter_is_not(
        name: str, adequate: Diagnosis) -> None:
    size = next(one.size for one in adequate.detectable if one.effect.name == name)
    for seed in (2, 3):
        assert told(seed, name, 2 * size).verdict != 'adequate'
        assert told(seed, name, size / 4).verdict == 'adequate'


def test_more_noise_hides_more(adequate: Diagnosis) -> None:
    loud = {one.effect.name: one.size for one in told(5, noise=0.7).detectable}
    quiet = {one.effect.name: one.size for one in adequate.detectable}
    for name in ('drive_inertia', 'coulomb_friction'):
        assert loud[name] > 1.5 * quiet[name]


def test_what_was_found_or_is_in_the_model_is_not_listed(adequate: Diagnosis) -> None:
    size = next(one.size for one in adequate.detectable if one.effect.name == 'viscous_friction')
    found = told(2, 'viscous_friction', 20 * size)
    assert [one.name for one in found.effects] == ['viscous_friction']
    names = {one.effect.name for one in found.detectable}
    assert 'viscous_friction' not in names
    assert 'drive_inertia' in names
