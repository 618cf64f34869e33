# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The bytes of messages that come in: whether they are whole.

The deserialiser of rmw_fastrtps does not notice where a message is cut off within padding before
a number, and reads on in foreign memory. What arrives from other machines is looked at before.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.system.cdr import HEADER, STAMP, Walk

TWO_WORDS = 8


def message_in(data: bytes, kind: type) -> Any:
    """Return the message of a kind that the bytes hold.

    Parameters
    ----------
    data : bytes
        As a raw subscription gives them.
    kind : type
        Bytes of other kinds than MultiDOFJointTrajectory, JointTrajectory, JointState,
        Float64MultiArray and String are only deserialised.

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


def only_whole(kind: type, callback: Callable[[Any], None]) -> Callable[[bytes], None]:
    """Return a callback for bytes that passes whole messages of a kind on, and drops all else.

    Where rclpy deserialises, bytes that are no message raise in the executor and end the node.
    They come from another release of a message, or from a program at fault.
    """
    def take(data: bytes) -> None:
        try:
            message = message_in(data, kind)
        except Rejection:
            return
        callback(message)

    return take


def is_whole(data: bytes, kind: type = MultiDOFJointTrajectory) -> bool:
    """Return whether the bytes hold every element that their length words promise."""
    if len(data) < HEADER or data[0] or data[1] > 1 or kind not in _WALKS:
        # Another encoding, or another kind: the deserialiser has to know.
        return len(data) >= HEADER
    walk = Walk(data)
    try:
        _WALKS[kind](walk)
    except struct.error:  # the bytes end before a length word
        return False
    return walk.at <= len(data)


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
