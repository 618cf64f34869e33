# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What changed on a running robot: claimed on the second window that shows it, withdrawn after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import MotionError
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.live_diagnosis import (
    LiveDiagnosis,
    change_point,
)
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.rests import share_in_motion
from pprs_dynamics.physics.mechanism.paths import Excitation

RATE, LENGTH = 100.0, 20.0  # [Hz, s]
ADDED = 0.3  # [kg] more payload than the model says
NOISE = 0.05  # [N]
SOONER = 8.0  # [s] within the second window


def window(model: DriveModel, heavier: DriveModel, number: int, begins: float = 0.0) -> Recording:
    """Return efforts of one robot before a moment [s] and of a heavier one after it."""
    motion = Excitation(LENGTH, seed=number).motion(np.arange(0, LENGTH, 1 / RATE))
    time = np.arange(len(motion)) / RATE
    forces = model.drive_forces(motion)
    effort = np.where((time < begins)[:, None], forces.total, heavier.drive_forces(motion).total)
    noise = NOISE * np.random.default_rng(number).standard_normal(effort.shape)
    return Recording.from_arrays(f'window {number}', time, forces.mechanism.position,
                                 effort=effort + noise)


@pytest.fixture(scope='module')
def model() -> DriveModel:
    return DriveModel.load()


@pytest.fixture(scope='module')
def heavier(model: DriveModel) -> DriveModel:
    return DriveModel.from_parameters(
        {**model.values, 'masses.payload': model.values['masses.payload'] + ADDED})


def test_a_change_is_claimed_on_the_second_window_that_shows_it_and_withdrawn_after(
    model: DriveModel, heavier: DriveModel,
) -> None:
    live = LiveDiagnosis(model)
    live = live.with_window(window(model, model, 0), 0.0)
    assert live.effects == ()
    live = live.with_window(window(model, heavier, 1, SOONER), LENGTH)
    assert live.claimed == ()  # named by one window only
    assert live.adopted() == {}
    live = live.with_window(window(model, heavier, 2), 2 * LENGTH)
    live = live.with_window(window(model, heavier, 3), 3 * LENGTH)
    assert [effect.found.name for effect in live.claimed] == ['payload_mass']
    assert live.claimed[0].since == pytest.approx(LENGTH + SOONER, abs=1.0)
    found = live.claimed[0].found.parameters['mass']
    assert abs(found.value - ADDED) < 4 * found.std + 0.01 * ADDED
    assert live.to_dict()['confirmed'] is True
    assert live.to_dict()['text'].startswith('payload mass: mass')
    motion = Excitation(1.0, seed=9).motion(np.arange(0, 1.0, 0.1))
    off = [DriveModel.from_parameters(values).drive_forces(motion).total
           - heavier.drive_forces(motion).total for values in (model.values, live.adopted())]
    assert np.abs(off[1]).max() < 0.05 * np.abs(off[0]).max()
    beside = replace(live, effects=(*live.effects, replace(live.claimed[0], confirmed=False)))
    assert beside.adopted() == {}  # the numbers were fitted together
    live = live.with_window(window(model, model, 4), 4 * LENGTH)
    assert live.claimed == ()
    assert [effect.found.name for effect in live.withdrawn] == ['payload_mass']


def test_what_numbers_within_their_tolerance_explain_keeps_no_effect_alive() -> None:
    """The fit moves masses that are known to 5 % only, which helps in every window."""
    values = DriveModel.load().values
    model = DriveModel.from_parameters({**values, 'tolerances.masses.payload': 0.05})
    real = {**values, 'masses.payload': 1.04 * values['masses.payload']}
    pushed = {'effects.active': ('effort_offset',), 'effects.effort_offset.slide_1.force': 0.06}
    robot = DriveModel.from_parameters(real)
    live = LiveDiagnosis(model)
    live = live.with_window(window(robot, DriveModel.from_parameters({**real, **pushed}), 2), 0.0)
    assert [effect.found.name for effect in live.effects] == ['effort_offset']
    assert live.last is not None
    assert 'effort_offset' not in [effect.name for effect in live.last.plain.effects]
    live = replace(live, effects=tuple(replace(one, confirmed=True) for one in live.effects))
    live = live.with_window(window(robot, robot, 3), LENGTH)
    assert live.claimed == ()
    assert [effect.found.name for effect in live.withdrawn] == ['effort_offset']


def test_a_robot_that_stands_is_not_diagnosed(model: DriveModel, heavier: DriveModel) -> None:
    moving = window(model, heavier, 1)
    encoder = 1e-6 * np.random.default_rng(0).integers(-1, 2, moving.position.shape)
    standing = Recording.from_arrays(
        'standing', moving.time, moving.position[:1] + encoder, effort=moving.effort)
    assert share_in_motion(moving.time, moving.position) > 0.9
    assert share_in_motion(standing.time, standing.position) == 0.0
    # Samples that are missing, and where the drives were taken elsewhere, are no noise.
    half = len(moving.time) // 2
    kept = np.r_[0:half, half + 500:len(moving.time)]
    jump = moving.position + 0.2 * (np.arange(len(moving.time)) > half)[:, None]
    assert share_in_motion(moving.time[kept], jump[kept]) > 0.9
    with pytest.raises(MotionError, match='no drive moves'):
        diagnose(model, [standing])
    live = LiveDiagnosis(model).with_window(standing, 0.0)
    assert live.last is None
    assert 'stands' in live.note


def test_the_change_point_is_where_the_cumulated_gain_is_lowest() -> None:
    time = np.arange(100) / 10.0
    gains = np.where(time < 4.0, -1.0, 1.0)
    assert change_point(time, gains) == pytest.approx(4.0)
    assert change_point(time, np.ones(100)) is None
