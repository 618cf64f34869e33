# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Commands as they go out: messages with the names of a robot."""

from __future__ import annotations

from typing import Protocol

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.ros.messages.conversions import (
    RobotNames,
    doubles,
    joint_state,
    time,
    write_joint_trajectory,
)


class HasDriveMotion(Protocol):
    """What knows the motion of the drives."""

    @property
    def drive_motion(self) -> tuple[Array, ...]:
        """Position, velocity and acceleration, (N, D) each."""


class CommandWriter:
    """Writes commands of a robot as messages.

    Parameters
    ----------
    names : RobotNames
    """

    def __init__(self, names: RobotNames) -> None:
        self._names = names

    def commands(self, effort: Array) -> Float64MultiArray:
        """Return the drives' efforts, (D,)."""
        return Float64MultiArray(data=doubles(effort))

    def joint_state(self, stamp: int, effort: Array, position: Array | None = None,
                    velocity: Array | None = None) -> JointState:
        """Return the drives at a time [ns]."""
        return joint_state(stamp, effort, position, velocity, self._names)

    def joint_trajectory(
        self, start: int, offsets: Indices, forces: HasDriveMotion, effort: Array,
    ) -> JointTrajectory:
        """Return the trajectory of N samples.

        Parameters
        ----------
        start : int
            Header stamp [ns].
        offsets : (N,) array of int
            time_from_start [ns].
        forces : HasDriveMotion
        effort : (N, D) array
        """
        return write_joint_trajectory(
            JointMotion(*forces.drive_motion), time(start), offsets, self._names, effort)
