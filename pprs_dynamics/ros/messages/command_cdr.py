# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Commands as CDR bytes: the same messages as rclpy would serialise, without the objects."""

from __future__ import annotations

import struct

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices
from pprs_dynamics.physics.model.force_model import Forces
from pprs_dynamics.ros.messages.conversions import (
    LATEST_SECOND,
    NANOSECONDS,
    seconds_and_rest,
)
from pprs_dynamics.ros.messages.robot_names import RobotNames
from pprs_dynamics.system.cdr import (
    HEADER,
    LITTLE_ENDIAN,
    STAMP,
    WORD,
    padded,
    with_count,
    with_names,
)


class CommandBytes:
    """Messages about some drives, serialised.

    Parameters
    ----------
    names : RobotNames
    """

    def __init__(self, names: RobotNames) -> None:
        self._count = count = len(names.joints)
        self._values = struct.Struct(f'<{count}d')
        self._point = np.dtype([
            *((name, [('count', '<u4', 2), ('values', '<f8', count)])
              for name in ('positions', 'velocities', 'accelerations', 'effort')),
            ('sec', '<i4'), ('nanosec', '<u4')])
        # No dimensions, no offset, the numbers, and what aligns them.
        self._commands = with_count(LITTLE_ENDIAN + WORD.pack(0) + WORD.pack(0), count)
        # Frame and names of the drives, as they follow a stamp.
        self._names = with_names(names.frame, names.joints)[HEADER + STAMP.size:]

    def commands(self, effort: Array) -> bytes:
        """Return a std_msgs/Float64MultiArray that holds the drives' efforts."""
        return self._commands + self._values.pack(*effort.tolist())

    def joint_state(self, stamp: int, effort: Array, position: Array | None = None,
                    velocity: Array | None = None) -> bytes:
        """Return a sensor_msgs/JointState of the drives at a time [ns]."""
        message = LITTLE_ENDIAN + STAMP.pack(*seconds_and_rest(stamp)) + self._names
        for values in (position, velocity, effort):
            message = with_count(message, 0 if values is None else self._count)
            if values is not None:
                message += self._values.pack(*values.tolist())
        return message

    def joint_trajectory(
        self, start: int, offsets: Indices, forces: Forces, effort: Array,
    ) -> bytes:
        """Return a trajectory_msgs/JointTrajectory of all samples.

        Parameters
        ----------
        start : int
            Header stamp [ns].
        offsets : (N,) array of int
            time_from_start [ns].
        forces : Forces
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
        stamp = STAMP.pack(*seconds_and_rest(start))
        head = padded(LITTLE_ENDIAN + stamp + self._names, 4) + WORD.pack(len(points))
        # The first point's first length word may stand where its padding would be.
        return with_count(head, self._count) + points.tobytes()[8:]
