# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The bytes of messages that come in: whether they are whole, and trajectories without objects.

The deserialiser of rmw_fastrtps does not notice where a message is cut off within padding before
a number, and reads on in foreign memory. What arrives from other machines is looked at before.

Points of a trajectory_msgs/MultiDOFJointTrajectory with one transform, one velocity and one
acceleration have a constant length, so that NumPy reads a thousand of them in the time that message
objects need for two. Every word that makes this layout is compared; whatever differs is left to
the ordinary path.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices
from pprs_dynamics.ros.messages.conversions import NANOSECONDS
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.system.cdr import HEADER, LITTLE_ENDIAN, STAMP, WORD, Walk

TWO_WORDS = 8


def message_in(data: bytes, kind: type) -> Any:
    """Return the message of a kind that the bytes hold.

    Parameters
    ----------
    data : bytes
        As a raw subscription gives them.
    kind : type
        MultiDOFJointTrajectory, JointTrajectory, JointState, Float64MultiArray or String.

    Raises
    ------
    Rejection
        SIZE, where they are no whole message.
    """
    try:
        message = deserialize_message(data, kind) if is_whole(data, kind) else None
    except (RuntimeError, UnicodeDecodeError):  # the former is the public base of rclpy's own
        message = None
    if message is None:
        package = kind.__module__.partition('.')[0]
        raise Rejection('SIZE', f'{len(data)} bytes arrived that are no '
                        f'whole {package}/{kind.__name__}')
    return message


def is_whole(data: bytes, kind: type = MultiDOFJointTrajectory) -> bool:
    """Return whether the bytes hold every element that their length words promise."""
    if len(data) < HEADER or data[0] or data[1] > 1:
        # Another encoding: its deserialiser has to know.
        return len(data) >= HEADER
    try:
        return walked(data, kind).at <= len(data)
    except struct.error:
        return False


def walked(data: bytes, kind: type) -> Walk:
    """Go over a message of a kind, and return where its words and numbers stand.

    Raises
    ------
    struct.error
        Where the bytes end before a length word.
    """
    walk = Walk(data)
    _WALKS[kind](walk)
    return walk


def _trajectory(walk: Walk) -> None:
    walk.header()
    for _ in range(walk.count()):
        for numbers in (7, 6, 6):
            walk.numbers(numbers)
        walk.over(STAMP.size)


def _joint_trajectory(walk: Walk) -> None:
    walk.header()
    for _ in range(walk.count()):
        for _ in range(4):
            walk.numbers()
        walk.over(STAMP.size)


def _joint_state(walk: Walk) -> None:
    walk.header()
    for _ in range(3):
        walk.numbers()


def _array(walk: Walk) -> None:
    for _ in range(walk.count()):
        walk.text()
        walk.over(TWO_WORDS)  # size and stride of a dimension
    walk.over(4)  # data_offset
    walk.numbers()


_WALKS: dict[type, Callable[[Walk], object]] = {
    MultiDOFJointTrajectory: _trajectory, JointTrajectory: _joint_trajectory,
    JointState: _joint_state, Float64MultiArray: _array, String: Walk.text}

NUMBERS = 19  # position, quaternion, two twists

# What stands between stamp and points for each frame that means `base` (none, and its name), by
# the length of its text: length words and names, padding left out as it may hold anything.
# (place, bytes), and the place of the count.
_NAMES = WORD.pack(1), WORD.pack(9) + b'platform\x00'
_HEADS = {
    1: (((12, WORD.pack(1) + b'\x00'), (20, _NAMES[0] + _NAMES[1])), 40),
    5: (((12, WORD.pack(5) + b'base\x00'), (24, _NAMES[0] + _NAMES[1])), 44),
}
# The first number of the first point stands here for both heads, as numbers are aligned to 8.
_FIRST = 52
# One point: 7 numbers, 6 velocities and 6 accelerations with their length words, and the time.
_ONE = struct.Struct('<7dI4x6dI4x6diI')
_POINT = np.dtype([
    # Of the first point, the length word may stand after the padding instead of before it.
    ('transforms', '<u4', 2), ('pose', '<f8', 7),
    ('velocities', '<u4', 2), ('velocity', '<f8', 6),
    ('accelerations', '<u4', 2), ('acceleration', '<f8', 6),
    ('time', [('sec', '<i4'), ('nanosec', '<u4')])])


def read_points(data: bytes) -> tuple[int, Array, Indices] | None:
    """Return header stamp [ns], numbers (N, 19) and time_from_start (N,) [ns] of a message.

    Parameters
    ----------
    data : bytes
        A serialised trajectory_msgs/MultiDOFJointTrajectory.

    Returns
    -------
    tuple or None
        None where the message is not one for `platform` in `base`, with at least one point and
        one transform, one velocity and one acceleration each, in little-endian CDR.
    """
    if len(data) < _FIRST + _POINT.itemsize - 8 or data[:HEADER] != LITTLE_ENDIAN:
        return None
    head = _HEADS.get(WORD.unpack_from(data, 12)[0])
    if head is None or any(data[at:at + len(text)] != text for at, text in head[0]):
        return None
    count = WORD.unpack_from(data, head[1])[0]
    # Equality, and not merely enough: a longer message is not what it seems.
    if len(data) != _FIRST - 8 + count * _POINT.itemsize or not count:
        return None
    # The first point's own word of the transforms follows the count at once.
    if WORD.unpack_from(data, head[1] + 4)[0] != 1:
        return None
    seconds, nanoseconds = STAMP.unpack_from(data, 4)
    stamp = seconds * NANOSECONDS + nanoseconds
    if count == 1:
        return _read_one(data, stamp)
    points = np.frombuffer(data, _POINT, count, _FIRST - 8)
    if not (points['transforms'][1:, 0] == 1).all():
        return None
    if not ((points['velocities'][:, 0] == 1).all() and (points['accelerations'][:, 0] == 1).all()):
        return None
    numbers = np.empty((count, NUMBERS))
    numbers[:, :7], numbers[:, 7:13] = points['pose'], points['velocity']
    numbers[:, 13:] = points['acceleration']
    times = points['time']
    offsets = times['sec'].astype(np.int64) * NANOSECONDS + times['nanosec']
    return stamp, numbers, offsets


def _read_one(data: bytes, stamp: int) -> tuple[int, Array, Indices] | None:
    """Return the same of a message with one point: a stream's, where every microsecond counts."""
    point = _ONE.unpack_from(data, _FIRST)
    if point[7] != 1 or point[14] != 1:
        return None
    return stamp, np.array([point[:7] + point[8:14] + point[15:21]]), np.array(
        [point[21] * NANOSECONDS + point[22]], np.int64)
