# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The answers as CDR bytes: the same messages as rclpy would serialise, without the objects."""

from __future__ import annotations

import struct

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.samples import Indices
from pprs_dynamics.mechanism.robot import DRIVES
from pprs_dynamics.model.drive_model import DriveForces
from pprs_dynamics.nodes.conversions import BASE_FRAMES, LATEST_SECOND, NANOSECONDS
from pprs_dynamics.nodes.trajectory_cdr import LITTLE_ENDIAN, STAMP, WORD

COUNT = len(DRIVES)
_SIX = struct.Struct(f'<{COUNT}d')
_POINT = np.dtype([
    *((name, [('count', '<u4', 2), ('values', '<f8', COUNT)])
      for name in ('positions', 'velocities', 'accelerations', 'effort')),
    ('sec', '<i4'), ('nanosec', '<u4')])


def commands(force: Array) -> bytes:
    """Return a std_msgs/Float64MultiArray that holds six forces."""
    return _COMMANDS + _SIX.pack(*force.tolist())


def joint_state(
    stamp: int, effort: Array, position: Array | None = None, velocity: Array | None = None,
) -> bytes:
    """Return a sensor_msgs/JointState of the drives at a time [ns], in `base`."""
    message = LITTLE_ENDIAN + _stamp(stamp) + _NAMES
    for values in (position, velocity, effort):
        if values is None:
            message = _padded(message, 4) + WORD.pack(0)
        else:
            message = (_padded(_padded(message, 4) + WORD.pack(COUNT), 8)
                       + _SIX.pack(*values.tolist()))
    return message


def joint_trajectory(start: int, offsets: Indices, forces: DriveForces, effort: Array) -> bytes:
    """Return a trajectory_msgs/JointTrajectory of all samples.

    Parameters
    ----------
    start : int
        Header stamp [ns].
    offsets : (N,) array of int
        time_from_start [ns].
    forces : DriveForces
        For the drives' motion.
    effort : (N, 6) array
        [N].
    """
    points = np.zeros(len(offsets), _POINT)
    position, velocity, acceleration = forces.drive_motion
    for name, values in (('positions', position), ('velocities', velocity),
                         ('accelerations', acceleration), ('effort', effort)):
        points[name]['count'][:, 0] = COUNT
        points[name]['values'] = values
    seconds, nanoseconds = np.divmod(offsets, NANOSECONDS)
    points['sec'] = np.minimum(seconds, LATEST_SECOND)
    points['nanosec'] = nanoseconds
    head = _padded(LITTLE_ENDIAN + _stamp(start) + _NAMES, 4) + WORD.pack(len(points))
    # The first point's first length word may stand where its padding would be.
    first = _padded(head + WORD.pack(COUNT), 8)
    return first + points.tobytes()[8:]


def _stamp(moment: int) -> bytes:
    seconds, rest = divmod(moment, NANOSECONDS)
    return STAMP.pack(min(seconds, LATEST_SECOND), rest)


def _text(word: str) -> bytes:
    data = word.encode() + b'\x00'
    return WORD.pack(len(data)) + data


def _padded(data: bytes, size: int) -> bytes:
    """Return data filled up to a multiple of the size, counted after the encapsulation."""
    return data + bytes(-(len(data) - len(LITTLE_ENDIAN)) % size)


def _names() -> bytes:
    """Return frame and names of the drives, as they follow a stamp."""
    start = LITTLE_ENDIAN + bytes(STAMP.size)
    message = _padded(start + _text(BASE_FRAMES[1]), 4) + WORD.pack(COUNT)
    for drive in DRIVES:
        message = _padded(message, 4) + _text(drive)
    return message[len(start):]


# No dimensions, no offset, six numbers, and what aligns them.
_COMMANDS = _padded(LITTLE_ENDIAN + WORD.pack(0) + WORD.pack(0) + WORD.pack(COUNT), 8)
_NAMES = _names()
