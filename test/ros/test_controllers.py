# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What ros2_control's controllers accept of what the nodes publish."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from controller_rules import WAY, ControllerSettings, objection
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import JointTrajectory

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros import play_trajectory
from pprs_dynamics.ros.force_command import Feedforward
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.trajectory_request import TRAJECTORY, readers_for
from pprs_dynamics.ros.play_trajectory import LONGEST_CATCH_UP, Beats

CONFIG = Path(__file__).parents[2] / 'config' / 'ros2_control'
NOW = 1_700_000_000_000_000_000  # [ns]
RATE = 100.0
STOP = 0.1  # [s] by default of feedforward.launch.py
OWN = {'feedforward_scale': 1.0, 'effort_limits': (), 'limit_policy': 'reject',
       'missing_derivatives': 'reject'}


def settings() -> ControllerSettings:
    """Return the controller's, from the file that users copy."""
    content = yaml.safe_load((CONFIG / 'joint_trajectory_controller.yaml').read_text())
    given = content['joint_trajectory_controller']['ros__parameters']
    return ControllerSettings(
        given['joints'], given['command_interfaces'], given['allow_partial_joints_goal'],
        given['allow_nonzero_velocity_at_trajectory_end'])


def forwarded(
    points: int, ahead: float, sample: int = 100, rate: float = RATE, stop_time: float = STOP,
) -> JointTrajectory:
    """Return what feedforward makes of a message of play_trajectory, in the middle of a path."""
    model = DriveModel.load()
    motion = HelicalPath().motion(np.arange(sample, sample + points) / rate)
    message = conversions.write_trajectory(
        motion, conversions.time(NOW + round(ahead * 1e9)),
        [round(k * 1e9 / rate) for k in range(points)])
    request = readers_for(model)[TRAJECTORY].read(serialize_message(message), NOW, 'reject')
    feedforward = Feedforward(model, OWN)
    drives = feedforward.ending_at_rest(feedforward.answer(request), stop_time)
    return drives.message(request.start, conversions.PAPER)


@pytest.mark.parametrize('rate', [50.0, 1000.0])
def test_a_stream_is_taken_with_reserve_by_the_defaults(rate: float) -> None:
    given = {parameter.name: parameter.default for parameter in play_trajectory.PARAMETERS}
    for allows, stop_time in ((False, STOP), (True, 0.0)):
        message = forwarded(given['points'], given['ahead'], rate=rate, stop_time=stop_time)
        controller = replace(settings(), allow_nonzero_velocity_at_trajectory_end=allows)
        assert objection(message, controller, NOW + 2 * WAY) == ''


def test_a_piece_in_motion_needs_an_end_at_rest() -> None:
    """The file that users copy keeps the safe default of the controller."""
    plain = ControllerSettings(DRIVES)
    assert not settings().allow_nonzero_velocity_at_trajectory_end
    assert 'last point' in objection(forwarded(10, 0.02, stop_time=0.0), plain, NOW + WAY)
    assert objection(forwarded(10, 0.02), plain, NOW + WAY) == ''


# When `play_trajectory` sends its messages: by the clock, whatever the timer misses.

PERIOD = 10_000_000  # [ns]
BEGUN = 1_700_000_000_000_000_000  # [ns]
CATCH_UP = round(LONGEST_CATCH_UP * 1e9)


def played(ticks: list[int]) -> list[list[int]]:
    """Return the moments, from the start on, that are due at each tick [ns]."""
    beats = Beats(PERIOD)
    return [[moment - BEGUN for moment in beats.due(BEGUN + tick)] for tick in ticks]


def test_what_a_timer_leaves_out_is_caught_up_with() -> None:
    assert played([0, PERIOD, 4 * PERIOD, 5 * PERIOD]) == [
        [0], [PERIOD], [2 * PERIOD, 3 * PERIOD, 4 * PERIOD], [5 * PERIOD]]


def test_after_a_standstill_it_goes_on_from_now() -> None:
    after = CATCH_UP + 3 * PERIOD + 7
    assert played([0, after, after + PERIOD]) == [[0], [after], [after + PERIOD]]


def test_where_the_clock_is_set_back_it_goes_on_from_now() -> None:
    assert played([0, PERIOD, -50 * PERIOD, -49 * PERIOD]) == [
        [0], [PERIOD], [-50 * PERIOD], [-49 * PERIOD]]
