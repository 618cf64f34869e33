# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The rules by which joint_trajectory_controller accepts a trajectory, as a stand-in for it.

From `validate_trajectory_msg` of ros2_controllers (August 2026): stated anew, for tests on machines
without ros2_control.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from trajectory_msgs.msg import JointTrajectory

# [ns] Age of messages, at the median, where a real controller dropped them: sent by
# play_trajectory, answered by feedforward, taken in the controller's next update.
WAY = 11_500_000
STILL = 1.1920929e-07  # the smallest float above 1, less 1: slower counts as standing


@dataclass(frozen=True)
class ControllerSettings:
    """Parameters of the controller that decide."""

    joints: Sequence[str]
    command_interfaces: Sequence[str] = ('effort',)
    allow_partial_joints_goal: bool = False
    allow_nonzero_velocity_at_trajectory_end: bool = False


def objection(message: JointTrajectory, settings: ControllerSettings, now: int) -> str:
    """Return why a message that arrives at `now` [ns] is rejected; '' where it is taken."""
    names, points = list(message.joint_names), message.points
    if not settings.allow_partial_joints_goal and len(names) != len(settings.joints):
        return "joints don't match the controller's"
    if not names or not points:
        return 'empty'
    if len(set(names)) < len(names):
        return 'a joint is named twice'
    if unknown := set(names) - set(settings.joints):
        return f'unknown joint {min(unknown)}'
    if not settings.allow_nonzero_velocity_at_trajectory_end and any(
            abs(velocity) > STILL for velocity in points[-1].velocities):
        return 'velocity of the last point is not zero'
    start = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    offsets = [point.time_from_start.sec * 10**9 + point.time_from_start.nanosec
               for point in points]
    if start and start + offsets[-1] < now:
        return 'ends in the past'
    if any(b <= a for a, b in pairwise(offsets)):
        return 'times are not strictly increasing'
    for point in points:
        if len(point.positions) != len(names):
            return 'positions do not match the joints'
        if any(values and len(values) != len(names)
               for values in (point.velocities, point.accelerations)):
            return 'velocities or accelerations do not match the joints'
        if point.effort and 'effort' not in settings.command_interfaces:
            return 'effort is only supported with the effort command interface'
        if point.effort and len(point.effort) != len(names):
            return 'effort does not match the joints'
    return ''
