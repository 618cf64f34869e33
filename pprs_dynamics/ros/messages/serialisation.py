# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Check at start that our CDR serialisation equals that of the installed rclpy.

Another middleware, or another version of a message, may lay out its bytes in another way. The node
then reads and writes message objects, which costs a long trajectory some 20 ms.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.force_model import Forces
from pprs_dynamics.ros.messages.command_cdr import CommandBytes
from pprs_dynamics.ros.messages.conversions import (
    NANOSECONDS,
    doubles,
    duration,
    joint_state,
    time,
    write_trajectory,
)
from pprs_dynamics.ros.messages.robot_names import RobotNames
from pprs_dynamics.ros.messages.trajectory_cdr import read_points

SAMPLES = 2  # points after the first have another place than it
STAMP = 12 * NANOSECONDS + 345


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
        self, start: int, offsets: Indices, forces: Forces, effort: Array,
    ) -> JointTrajectory:
        """Return all samples; see `CommandBytes.joint_trajectory`."""
        message = JointTrajectory(joint_names=list(self._names.joints), points=[
            JointTrajectoryPoint(positions=doubles(position), velocities=doubles(velocity),
                                 accelerations=doubles(acceleration), effort=doubles(efforts),
                                 time_from_start=duration(int(offset)))
            for position, velocity, acceleration, efforts, offset in zip(
                *forces.drive_motion, effort, offsets, strict=True)])
        message.header.stamp, message.header.frame_id = time(start), self._names.frame
        return message


def command_writer(names: RobotNames) -> CommandBytes | CommandObjects:
    """Return what writes the answers: bytes where rclpy reads from them what objects say."""
    written, objects = CommandBytes(names), CommandObjects(names)
    numbers = np.arange(4 * SAMPLES * len(names.joints), dtype=float).reshape(4, SAMPLES, -1) / 7
    forces: Any = SimpleNamespace(drive_motion=tuple(numbers[:3]))
    offsets = np.array([0, 1_500_000_000])
    samples = [
        (Float64MultiArray, 'commands', (numbers[3, 0],)),
        (JointState, 'joint_state', (STAMP, *numbers[:3, 0])),
        (JointState, 'joint_state', (STAMP, numbers[0, 0])),
        (JointTrajectory, 'joint_trajectory', (STAMP, offsets, forces, numbers[3])),
    ]
    agree = all(_read(getattr(written, name)(*arguments), kind)
                == getattr(objects, name)(*arguments) for kind, name, arguments in samples)
    return written if agree else objects


def trajectories_have_known_bytes() -> bool:
    """Return whether `read_points` finds in rclpy's bytes what was written."""
    rows = np.arange(SAMPLES * 18, dtype=float).reshape(6, SAMPLES, 3) / 7
    motion = PlatformMotion(rows[0], np.tile([0.0, 0.0, 0.6, 0.8], (SAMPLES, 1)), *rows[2:])
    expected = np.concatenate((motion.position, motion.orientation, *rows[2:]), axis=1)
    for count in (1, SAMPLES):
        offsets = [k * 1_500_000_000 for k in range(count)]
        found = read_points(bytes(serialize_message(
            write_trajectory(motion[:count], time(STAMP), offsets))))
        if found is None or found[0] != STAMP or found[2].tolist() != offsets or (
                found[1].tolist() != expected[:count].tolist()):
            return False
    return True


def _read(data: bytes, kind: type) -> Any:
    try:
        return deserialize_message(data, kind)
    except RuntimeError:  # the public base of rclpy's own
        return None
