# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A trajectory of an arm's joints as the model needs it, or the rule that the message breaks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from trajectory_msgs.msg import JointTrajectory

from pprs_dynamics.physics.mechanism.joint_motion import JointMotion, position_spline_derivatives
from pprs_dynamics.ros.messages.conversions import NANOSECONDS, nanoseconds
from pprs_dynamics.ros.messages.rejection import Rejection
from pprs_dynamics.ros.messages.trajectory_request import (
    REJECT,
    TrajectoryRequest,
    check_counts,
    fill_in,
    offsets_of,
    request_of,
    start_of,
)

PLACES = 'positions'


def read_joint_trajectory(
    message: JointTrajectory, joints: Sequence[str], now: int, max_age: float = 0.0,
    missing: str = REJECT,
) -> TrajectoryRequest:
    """Return the motion that a message asks of an arm.

    Parameters
    ----------
    message : trajectory_msgs/JointTrajectory
        Of all joints, in any order; its efforts are not read, and its frame means nothing.
    joints : sequence of n str
        In the model's order.
    now, max_age, missing
        See `read_trajectory`; a spline goes through the positions.

    Raises
    ------
    Rejection, MotionError
        For a message that breaks a rule.
    """
    points, names = message.points, list(message.joint_names)
    if not points:
        raise Rejection('EMPTY', 'points: the trajectory has none, must have at least 1')
    if sorted(names) != sorted(joints):
        raise Rejection('NAMES', f'joint_names is {names!r:.200}, must hold each of '
                        f'{", ".join(joints)} once, and nothing else')
    count = len(joints)
    lacking = check_counts(points, missing, PLACES, count)
    start = start_of(nanoseconds(message.header.stamp), now, max_age)
    offsets = offsets_of(points)
    none = np.zeros(count)
    order = [names.index(joint) for joint in joints]
    numbers = np.array([[point.positions, point.velocities or none, point.accelerations or none]
                        for point in points], dtype=float)[:, :, order].reshape(len(points), -1)
    position, velocity, acceleration = (
        slice(k * count, (k + 1) * count) for k in range(3))
    if lacking.any():
        fill_in(numbers, (velocity, acceleration), position_spline_derivatives(
            (offsets - offsets[0]) / NANOSECONDS, numbers[:, position]), lacking)
    return request_of(start, offsets, lambda time: JointMotion.checked(
        numbers[:, position], numbers[:, velocity], numbers[:, acceleration], time, count))
