# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""ROS 2 messages to motions and back: names and shapes, no mathematics."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Twist, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.messages.status_codes import Rejection

BASE = 'base'
PLATFORM = 'platform'
NANOSECONDS = 1_000_000_000
LARGEST = 1e9  # [m, N, ...]: no drive's, and squares of what is far larger overflow
LATEST_SECOND = 2 ** 31 - 1


class RobotNames(NamedTuple):
    """Joints in the order of the model's drives, and the frame.

    Parameters
    ----------
    joints : tuple of D str
        By `joint_map` and `joint_prefix` of the model.
    frame : str
        Of `header.frame_id`, in what comes and in what goes out; an empty one always means it.
    """

    joints: tuple[str, ...]
    frame: str

    @classmethod
    def of(cls, model: DriveModel, frame: str = '') -> RobotNames:
        """Return the names of a model's drives; `frame` '' for that of its kind."""
        # A platform's is `base`; that of joints means nothing.
        return cls(model.recorded.joints, frame or (BASE if model.drives == DRIVES else ''))


PAPER = RobotNames(DRIVES, BASE)


def write_trajectory(
    motion: PlatformMotion, stamp: Time, offsets: Sequence[int],
) -> MultiDOFJointTrajectory:
    """Return the message that asks for a platform motion.

    Parameters
    ----------
    motion : PlatformMotion
    stamp : builtin_interfaces/Time
    offsets : sequence of int
        time_from_start of every point [ns].
    """
    message = MultiDOFJointTrajectory(joint_names=[PLATFORM])
    message.header.stamp, message.header.frame_id = stamp, BASE
    for sample, offset in enumerate(offsets):
        x, y, z, w = motion.orientation[sample].tolist()
        message.points.append(MultiDOFJointTrajectoryPoint(
            transforms=[Transform(translation=_vector(motion.position[sample]),
                                  rotation=Quaternion(x=x, y=y, z=z, w=w))],
            velocities=[Twist(linear=_vector(motion.linear_velocity[sample]),
                              angular=_vector(motion.angular_velocity[sample]))],
            accelerations=[Twist(linear=_vector(motion.linear_acceleration[sample]),
                                 angular=_vector(motion.angular_acceleration[sample]))],
            time_from_start=duration(offset)))
    return message


def write_joint_trajectory(
    motion: JointMotion, stamp: Time, offsets: Iterable[int], names: RobotNames,
    effort: Array | None = None,
) -> JointTrajectory:
    """Return the message with a motion of joints, and efforts (N, D); see `write_trajectory`."""
    message = JointTrajectory(joint_names=list(names.joints))
    message.header.stamp, message.header.frame_id = stamp, names.frame
    for sample, offset in enumerate(offsets):
        message.points.append(JointTrajectoryPoint(
            positions=doubles(motion.position[sample]), velocities=doubles(motion.velocity[sample]),
            accelerations=doubles(motion.acceleration[sample]),
            effort=[] if effort is None else doubles(effort[sample]),
            time_from_start=duration(int(offset))))
    return message


def joint_state(
    stamp: int, effort: Array | None = None, position: Array | None = None,
    velocity: Array | None = None, names: RobotNames = PAPER,
) -> JointState:
    """Return a JointState message for a time [ns]."""
    message = JointState(name=list(names.joints))
    for field, values in (('position', position), ('velocity', velocity), ('effort', effort)):
        if values is not None:
            setattr(message, field, doubles(values))
    message.header.stamp, message.header.frame_id = time(stamp), names.frame
    return message


def efforts(effort: Array) -> Float64MultiArray:
    """Return the drives' efforts, (D,)."""
    return Float64MultiArray(data=doubles(effort))


def transforms(stamp: int, base: str, links: Sequence[str], poses: Array, prefix: str = '',
               ) -> list[TransformStamped]:
    """Return where links are on a base at a time [ns], for tf.

    Parameters
    ----------
    poses : (F, 7) array
        Place [m] and quaternion, x y z w.
    prefix : str
        Of all frames.
    """
    found = []
    for link, (x, y, z, *turn) in zip(links, poses.tolist(), strict=True):
        transform = TransformStamped(child_frame_id=prefix + link)
        transform.header.stamp, transform.header.frame_id = time(stamp), prefix + base
        transform.transform.translation = Vector3(x=x, y=y, z=z)
        transform.transform.rotation = Quaternion(**dict(zip('xyzw', turn, strict=True)))
        found.append(transform)
    return found


def read_drives(message: JointState, field: str, may_be_nan: bool = False,
                drives: Sequence[str] = DRIVES) -> Array:
    """Return one field of a JointState in the order of drives, matched by name, (D,).

    Raises
    ------
    Rejection
        Where a drive is missing or named twice, the field's length is not that of `name`, or a
        value is not finite, or is beyond `LARGEST`.
    """
    names, values = list(message.name), getattr(message, field)
    missing = [drive for drive in drives if drive not in names]
    if missing:
        raise Rejection('NAMES', f'name is {names!r:.100}, must contain {missing[0]}')
    if twice := [drive for drive in drives if names.count(drive) > 1]:
        raise Rejection('NAMES', f'name is {names!r:.100}, must contain {twice[0]} once')
    if len(values) != len(names):
        raise Rejection('SIZE', f'{field} has {len(values)} values, must have '
                        f'{len(names)}, as name')
    found = np.array([values[names.index(drive)] for drive in drives], dtype=float)
    if may_be_nan:
        # Not a number, or none that a drive has, and no measurement either.
        return np.where(np.abs(found) <= LARGEST, found, np.nan)
    if not np.all(np.isfinite(found)):
        raise Rejection('NON_FINITE', f'{field} is {found.tolist()}, must be finite')
    if np.any(np.abs(found) > LARGEST):
        raise Rejection('WORKSPACE', f'{field} is {found.tolist()}, must be between {-LARGEST:g} '
                        f'and {LARGEST:g}')
    return found


def nanoseconds(moment: Time | Duration) -> int:
    """Return a stamp or a duration in nanoseconds."""
    return int(moment.sec) * NANOSECONDS + int(moment.nanosec)


def time(moment: int) -> Time:
    """Return a stamp from nanoseconds."""
    return Time(**_divided(moment))


def duration(moment: int) -> Duration:
    """Return a duration from nanoseconds."""
    return Duration(**_divided(moment))


def _divided(moment: int) -> dict[str, int]:
    """Return seconds, at most those that a message can contain, and nanoseconds of a time [ns]."""
    seconds, nanoseconds = divmod(moment, NANOSECONDS)
    return {'sec': min(seconds, LATEST_SECOND), 'nanosec': nanoseconds}


def doubles(values: Array) -> array[float]:
    """Return values in the form that messages take over without looking at each one."""
    return array('d', np.ascontiguousarray(values, dtype=float).tobytes())


def _vector(values: Array) -> Vector3:
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)
