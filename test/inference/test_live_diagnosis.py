# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What changed on a running robot: claimed on the second window that shows it, withdrawn after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from single_axis import AXIS, axis, axis_recording

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import MotionError
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.live_diagnosis import LiveDiagnosis, change_point
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.rests import share_in_motion

LENGTH = 20.0  # [s]
SPRING = 300.0  # [N/m] that the model lacks
SOONER = 8.0  # [s] within the second window
WORN = axis({'drive_spring': {'stiffness': SPRING, 'position': 0.01}})


def window(worn: DriveModel, number: int, begins: float = 0.0) -> Recording:
    """Return efforts of one axis before a moment [s] and of a worn one after it."""
    return axis_recording(worn, number, 1.0, axis(), begins, np.arange(0, LENGTH, 0.01))


def test_a_change_is_claimed_on_the_second_window_that_shows_it_and_withdrawn_after() -> None:
    model = axis()
    live = LiveDiagnosis(model)
    live = live.with_window(window(axis(), 0), 0.0)
    assert live.effects == ()
    live = live.with_window(window(WORN, 1, SOONER), LENGTH)
    assert live.claimed == ()  # named by one window only
    assert live.adopted() == {}
    live = live.with_window(window(WORN, 2), 2 * LENGTH)
    live = live.with_window(window(WORN, 3), 3 * LENGTH)
    assert [effect.found.name for effect in live.claimed] == ['drive_spring']
    assert live.claimed[0].since == pytest.approx(LENGTH + SOONER, abs=1.0)
    found = live.claimed[0].found.parameters['axis.stiffness']
    assert abs(found.value - SPRING) < 4 * found.std + 0.01 * SPRING
    assert live.to_dict()['confirmed'] is True
    adopted = DriveModel.from_parameters(live.adopted(), model.source)
    assert adopted.values['effects.drive_spring.axis.stiffness'] == found.value
    beside = replace(live, effects=(*live.effects, replace(live.claimed[0], confirmed=False)))
    assert beside.adopted() == {}  # the numbers were fitted together
    live = live.with_window(window(axis(), 4), 4 * LENGTH)
    assert live.claimed == ()
    assert [effect.found.name for effect in live.withdrawn] == ['drive_spring']


def test_a_robot_that_stands_is_not_diagnosed() -> None:
    model = axis()
    moving = window(WORN, 1)
    encoder = 1e-6 * np.random.default_rng(0).integers(-1, 2, moving.position.shape)
    standing = Recording.from_arrays(
        'standing', moving.time, moving.position[:1] + encoder, effort=moving.effort,
        drives=(AXIS,))
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
    assert 'hardly moves' in live.note


def test_the_change_point_is_where_the_cumulated_gain_is_lowest() -> None:
    time = np.arange(100) / 10.0
    gains = np.where(time < 4.0, -1.0, 1.0)
    assert change_point(time, gains) == pytest.approx(4.0)
    assert change_point(time, np.ones(100)) is None
