# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What begins, passes or drifts within a recording is told as that, not as a constant effect."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import made_up_arm
import numpy as np
import pytest
from made_once import diagnose
from model_recordings import with_effects
from scipy.signal import butter, lfilter

from pprs_dynamics import DriveModel, Recording
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.physics.mechanism.paths import Excitation

MODEL = DriveModel.load()
TIME = np.arange(1600) * 0.005
MOTION = Excitation(8.0, 1).motion(TIME)
FORCES = MODEL.drive_forces(MOTION)
START = 5.0  # [s], of the recording's clock: what is told counts from the recording's start


def recorded(effort: np.ndarray) -> Recording:
    noise = 0.05 * np.random.default_rng(0).normal(size=effort.shape)
    return Recording.from_arrays('changing', TIME + START, FORCES.mechanism.position, None,
                                 effort + noise)


def loaded(mass: float) -> np.ndarray:
    return with_effects(MODEL, {'payload_mass': {'mass': mass}}).drive_forces(MOTION).total


def test_a_payload_that_is_picked_up_is_told_with_its_mass_and_its_moment() -> None:
    since = 4.313  # [s]
    picked = np.where((since < TIME)[:, None], loaded(0.2), FORCES.total)
    found = diagnose(MODEL, [recorded(picked)])
    assert found.verdict == 'effect'
    effect, = found.effects
    assert effect.name == 'payload_mass'
    assert abs(effect.parameters['mass'].value - 0.2) < 0.004
    told = found.to_dict()['effects'][0]
    assert told['since'] == pytest.approx(since, abs=0.03)
    # The model that is returned has what is there at the end.
    assert found.adopted.values['effects.payload_mass.mass'] == pytest.approx(0.2, abs=0.004)
    assert np.nanstd(found.remaining) < 1.1 * 0.05 / np.sqrt(2)


@pytest.mark.slow
def test_what_begins_in_the_middle_is_not_adopted_throughout() -> None:
    recording = recorded(np.where((TIME > 4.0)[:, None], loaded(0.2), FORCES.total))
    answer = adopt(MODEL, EffectRequest.of('payload_mass', MODEL), [recording])
    assert not answer.adopted
    assert 'it is there since 4' in answer.reason


def test_a_contact_of_some_seconds_is_no_property_of_the_machine() -> None:
    touched = FORCES.total.copy()
    touched[(TIME > 4) & (TIME < 6), 4] += 3.0
    found = diagnose(MODEL, [recorded(touched)])
    assert found.verdict == 'unknown'
    assert not found.effects
    statement = found.depends_on[0]
    assert (statement.drive, statement.variable) == ('lift_2', 'time')
    assert statement.range == pytest.approx((4.0, 6.0), abs=0.05)


ARM_TIME = np.arange(0, 30.0, 0.01)
WARMTH = 20.0 + np.tile(ARM_TIME[:, None], 3)  # [degC] a kelvin a second


def lagging(forces: np.ndarray) -> np.ndarray:
    """Return forces behind a Butterworth filter, which is of no form of the catalogue."""
    return np.asarray(lfilter(*butter(2, 12.0, fs=100.0), forces, axis=0))


def late(forces: np.ndarray) -> np.ndarray:
    return np.roll(forces, 2, axis=0)


def weaker(forces: np.ndarray) -> np.ndarray:
    """Return forces of which the second drive's constant falls with its temperature."""
    return np.asarray(forces * (1 - np.array([0, 0.005, 0]) * (WARMTH - 25.0)))


@pytest.mark.parametrize(('change', 'name', 'key', 'value', 'tolerance'), [
    pytest.param(lagging, 'effort_filter', 'swing.time_constant',
                 np.sqrt(2) / (2 * np.pi * 12.0), 0.001, marks=pytest.mark.slow),
    pytest.param(late, 'time_delay', 'swing.delay', 0.02, 0.0005, marks=pytest.mark.slow),
    (weaker, 'current_gain', 'swing.temperature', -0.005, 0.0002)])
def test_what_sensors_begin_to_do_has_a_date_its_own_name_and_its_own_shape(
        tmp_path: Path, change: Callable[[np.ndarray], np.ndarray], name: str, key: str,
        value: float, tolerance: float) -> None:
    """Filter, play, delay and hysteresis that are there all the time imitate one that begins.

    A Butterworth filter is as late as two equal lags of together sqrt(2) over its cut-off [rad/s].
    """
    arm = made_up_arm.real_arm(tmp_path, **{'robot.gear_ratio': (50.0, 50.0, 1.0)})
    moved = made_up_arm.motion(30.0)
    forces = arm.drive_forces(moved).total
    effort = np.where(ARM_TIME[:, None] < 15.0, forces, change(forces))
    effort += 0.2 * np.random.default_rng(3).normal(size=effort.shape)
    found = diagnose(arm, [Recording.from_arrays(
        'half', ARM_TIME, moved.position, None, effort, arm.drives, {'temperature': WARMTH})])
    assert found.verdict == 'effect'
    assert [effect.name for effect in found.effects] == [name]
    assert found.to_dict()['effects'][0]['since'] == pytest.approx(15.0, abs=0.2)
    assert found.effects[0].parameters[key].value == pytest.approx(value, abs=tolerance)
