# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Trajectory messages that break one rule each, and the code that a node must give for them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from scipy.spatial.transform import Rotation
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics import PlatformMotion
from pprs_dynamics.ros.messages.conversions import write_trajectory

VALID = ''
SCRIPTS = ('платформа', '平台', 'منصة', 'แพลตฟอร์ม', '🤖', 'Plattform', 'platform ', 'plat\tform',
           '')
NON_FINITE = (float('nan'), float('inf'), float('-inf'))
DENORMAL = 5e-324
LONG = 10_000  # points
# A message of that many points costs as much as thousands of others.
LONG_SHARE = 1 / 5000


def valid_motion(rng: np.random.Generator, points: int) -> PlatformMotion:
    """Return points well within workspace and limits that do not follow from one another."""
    return PlatformMotion(
        np.array([0.0, 0.0, 0.5]) + rng.uniform(-0.05, 0.05, (points, 3)),
        Rotation.from_rotvec(rng.uniform(-0.1, 0.1, (points, 3))).as_quat(),
        *(rng.uniform(-0.5, 0.5, (points, 3)) for _ in range(4)), np.arange(points) * 0.01)


def valid_message(rng: np.random.Generator, points: int) -> MultiDOFJointTrajectory:
    """Return the message of such a motion."""
    return write_trajectory(valid_motion(rng, points), Time(),
                            [k * 10_000_000 for k in range(points)])


def damaged(rng: np.random.Generator) -> tuple[str, bytes]:
    """Return a code, or VALID, and the bytes of a message that must get it."""
    points = int(rng.integers(1, 6))
    if rng.random() < LONG_SHARE:
        points = LONG
    message = valid_message(rng, points)
    kind = KINDS[int(rng.integers(len(KINDS)))]
    code = kind(message, rng)
    data = bytes(serialize_message(message))
    if code == TRUNCATED:
        # DDS fills a message up to a multiple of four bytes: the last three, which are zero
        # here, would be put back.
        return 'SIZE', data[:int(rng.integers(4, len(data) - 3))]
    return code, data


TRUNCATED = 'TRUNCATED'


def _valid(message: Any, rng: np.random.Generator) -> str:
    return VALID


def _denormal(message: Any, rng: np.random.Generator) -> str:
    point = _any_point(message, rng)
    point.velocities[0].linear.x = DENORMAL
    point.accelerations[0].angular.z = -DENORMAL
    return VALID


def _negative_zero(message: Any, rng: np.random.Generator) -> str:
    point = _any_point(message, rng)
    point.velocities[0].angular.y = -0.0
    return VALID


def _empty(message: Any, rng: np.random.Generator) -> str:
    message.points = []
    return 'EMPTY'


def _names(message: Any, rng: np.random.Generator) -> str:
    word = SCRIPTS[int(rng.integers(len(SCRIPTS)))]
    message.joint_names = [[word], [], ['platform', word], [word] * 100][int(rng.integers(4))]
    return 'NAMES'


def _frame(message: Any, rng: np.random.Generator) -> str:
    message.header.frame_id = SCRIPTS[int(rng.integers(len(SCRIPTS) - 1))] * int(
        rng.integers(1, 4))
    return 'FRAME'


def _counts(message: Any, rng: np.random.Generator) -> str:
    field = ('transforms', 'velocities', 'accelerations')[int(rng.integers(3))]
    point = _any_point(message, rng)
    setattr(point, field, getattr(point, field) * int(rng.choice([0, 2, 7])))
    return 'SIZE'


def _non_finite(message: Any, rng: np.random.Generator) -> str:
    point = _any_point(message, rng)
    place = (point.transforms[0].translation, point.transforms[0].rotation,
             point.velocities[0].linear, point.velocities[0].angular,
             point.accelerations[0].linear, point.accelerations[0].angular)[int(rng.integers(6))]
    setattr(place, 'xyz'[int(rng.integers(3))], NON_FINITE[int(rng.integers(3))])
    return 'NON_FINITE'


def _quaternion(message: Any, rng: np.random.Generator) -> str:
    rotation = _any_point(message, rng).transforms[0].rotation
    factor = (0.0, 1.01, 1e308, DENORMAL)[int(rng.integers(4))]
    for axis in 'xyzw':
        setattr(rotation, axis, getattr(rotation, axis) * factor)
    return 'QUATERNION'


def _times(message: Any, rng: np.random.Generator) -> str:
    if len(message.points) == 1 or rng.random() < 0.3:
        message.points[0].time_from_start.sec = -int(rng.integers(1, 2**31))
        return 'TIME'
    index = int(rng.integers(1, len(message.points)))
    message.points[index].time_from_start = message.points[index - 1].time_from_start
    return 'TIME'


def _far(message: Any, rng: np.random.Generator) -> str:
    position = _any_point(message, rng).transforms[0].translation
    setattr(position, 'xyz'[int(rng.integers(3))], float(rng.choice([1e308, -1e308, 1e9, -40.0])))
    return 'WORKSPACE'


def _flat_rod(message: Any, rng: np.random.Generator) -> str:
    pose = _any_point(message, rng).transforms[0]
    # Of 0.3 m the rod of chain 1 spans 0.2999 m: the sine of its angle is 0.026.
    pose.translation.x, pose.translation.y, pose.translation.z = 0.3499, 0.0, 0.5
    pose.rotation.x = pose.rotation.y = pose.rotation.z = 0.0
    pose.rotation.w = 1.0
    return 'SINGULAR'


def _strong(message: Any, rng: np.random.Generator) -> str:
    point = _any_point(message, rng)
    point.accelerations[0].linear.z = float(rng.choice([1e3, -1e4, 1e12, 1e100]))
    return 'LIMIT'


def _overflow(message: Any, rng: np.random.Generator) -> str:
    point = _any_point(message, rng)
    if rng.random() < 0.5:
        point.velocities[0].angular.x = 1e300
    else:
        point.accelerations[0].linear.x = 1.7e308
    return 'OUTPUT'


def _truncated(message: Any, rng: np.random.Generator) -> str:
    return TRUNCATED


def _any_point(message: Any, rng: np.random.Generator) -> Any:
    return message.points[int(rng.integers(len(message.points)))]


KINDS: tuple[Callable[[Any, np.random.Generator], str], ...] = (
    _valid, _valid, _valid, _denormal, _negative_zero, _empty, _names, _frame, _counts,
    _non_finite, _non_finite, _quaternion, _times, _far, _flat_rod, _strong, _overflow, _truncated)
