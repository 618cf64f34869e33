# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Commands as they go out: bytes, or message objects where the installed rclpy has other bytes.

Another middleware, or another version of a message, may lay out its bytes in another way. The node
then reads and writes message objects, which costs a long trajectory some 20 ms.
"""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any, Protocol

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.ros.messages.conversions import (
    LATEST_SECOND,
    NANOSECONDS,
    RobotNames,
    doubles,
    joint_state,
    seconds_and_rest,
    time,
    write_joint_trajectory,
)
from pprs_dynamics.ros.messages.incoming_bytes import walked
from pprs_dynamics.system.cdr import HEADER, STAMP, WORD

SAMPLES = 2  # points after the first have another place than it
MOMENT = 12 * NANOSECONDS + 345


class HasDriveMotion(Protocol):
    """What knows the motion of the drives."""

    @property
    def drive_motion(self) -> tuple[Array, ...]:
        """Position, velocity and acceleration, (N, D) each."""


class CommandBytes:
    """What CommandObjects makes, serialised: messages of rclpy's with other numbers put in.

    Parameters
    ----------
    names : RobotNames
    """

    def __init__(self, names: RobotNames) -> None:
        objects, zeros = CommandObjects(names), np.zeros(len(names.joints))
        self._count = count = len(names.joints)
        self._values = struct.Struct(f'<{count}d')
        self._point = np.dtype([
            *((name, [('count', '<u4', 2), ('values', '<f8', count)])
              for name in ('positions', 'velocities', 'accelerations', 'effort')),
            ('sec', '<i4'), ('nanosec', '<u4')])
        template = _Template(objects.commands(zeros))
        self._commands = bytes(template.data[:template.places[0]])  # all but its numbers
        self._effort = _Template(objects.joint_state(0, zeros))
        self._state = _Template(objects.joint_state(0, zeros, zeros, zeros))
        still: Any = SimpleNamespace(drive_motion=(zeros[None],) * 3)
        self._trajectory = _Template(
            objects.joint_trajectory(0, np.zeros(1, np.int64), still, zeros[None]))

    def commands(self, effort: Array) -> bytes:
        """Return a std_msgs/Float64MultiArray that holds the drives' efforts."""
        return self._commands + self._values.pack(*effort.tolist())

    def joint_state(self, stamp: int, effort: Array, position: Array | None = None,
                    velocity: Array | None = None) -> bytes:
        """Return a sensor_msgs/JointState of the drives at a time [ns]."""
        if position is None or velocity is None:
            self._effort.set_stamp(stamp)
            return self._filled(self._effort, effort)
        self._state.set_stamp(stamp)
        return self._filled(self._state, position, velocity, effort)

    def _filled(self, template: _Template, *arrays: Array) -> bytes:
        for place, values in zip(template.places, arrays, strict=True):
            self._values.pack_into(template.data, place, *values.tolist())
        return bytes(template.data)

    def joint_trajectory(
        self, start: int, offsets: Indices, forces: HasDriveMotion, effort: Array,
    ) -> bytes:
        """Return a trajectory_msgs/JointTrajectory of all samples.

        Parameters
        ----------
        start : int
            Header stamp [ns].
        offsets : (N,) array of int
            time_from_start [ns].
        forces : Forces or DriveTrajectory
            For the drives' motion.
        effort : (N, D) array
        """
        points = np.zeros(len(offsets), self._point)
        position, velocity, acceleration = forces.drive_motion
        for name, values in (('positions', position), ('velocities', velocity),
                             ('accelerations', acceleration), ('effort', effort)):
            points[name]['count'][:, 0] = self._count
            points[name]['values'] = values
        seconds, nanoseconds = np.divmod(offsets, NANOSECONDS)
        points['sec'] = np.minimum(seconds, LATEST_SECOND)
        points['nanosec'] = nanoseconds
        template = self._trajectory
        template.set_stamp(start)
        # The word before those of the four sequences of its one point.
        WORD.pack_into(template.data, template.words[-5], len(points))
        # The first point's first length word may stand where its padding would be.
        return bytes(template.data[:template.places[0]]) + points.tobytes()[8:]


class _Template:
    """The bytes of a message, and where its length words and its sequences of numbers stand."""

    def __init__(self, message: Any) -> None:
        data = bytes(serialize_message(message))
        walk = walked(data, type(message))
        self.data, self.words = bytearray(data), walk.words
        self.places = [place for place, count in walk.arrays if count]

    def set_stamp(self, moment: int) -> None:
        """Put a time [ns] into the header."""
        STAMP.pack_into(self.data, HEADER, *seconds_and_rest(moment))


class CommandObjects:
    """What CommandBytes writes, as message objects.

    Parameters
    ----------
    names : RobotNames
    """

    def __init__(self, names: RobotNames) -> None:
        self._names = names

    def commands(self, effort: Array) -> Float64MultiArray:
        """Return the drives' efforts."""
        return Float64MultiArray(data=doubles(effort))

    def joint_state(self, stamp: int, effort: Array, position: Array | None = None,
                    velocity: Array | None = None) -> JointState:
        """Return the drives at a time [ns]."""
        return joint_state(stamp, effort, position, velocity, self._names)

    def joint_trajectory(
        self, start: int, offsets: Indices, forces: HasDriveMotion, effort: Array,
    ) -> JointTrajectory:
        """Return all samples; see `CommandBytes.joint_trajectory`."""
        return write_joint_trajectory(
            JointMotion(*forces.drive_motion), time(start), offsets, self._names, effort)


def command_writer(names: RobotNames) -> CommandBytes | CommandObjects:
    """Return what writes the answers: bytes where rclpy reads from them what objects say."""
    objects = CommandObjects(names)
    numbers = np.arange(4 * SAMPLES * len(names.joints), dtype=float).reshape(4, SAMPLES, -1) / 7
    forces: Any = SimpleNamespace(drive_motion=tuple(numbers[:3]))
    offsets = np.array([0, 1_500_000_000])
    samples = [
        (Float64MultiArray, 'commands', (numbers[3, 0],)),
        (JointState, 'joint_state', (MOMENT, *numbers[:3, 0])),
        (JointState, 'joint_state', (MOMENT, numbers[0, 0])),
        (JointTrajectory, 'joint_trajectory', (MOMENT, offsets, forces, numbers[3])),
    ]
    try:
        written = CommandBytes(names)
        agree = all(deserialize_message(getattr(written, name)(*arguments), kind)
                    == getattr(objects, name)(*arguments) for kind, name, arguments in samples)
    except (struct.error, IndexError, ValueError, RuntimeError):  # the last: base of rclpy's own
        return objects
    return written if agree else objects
