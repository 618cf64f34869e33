"""ROS 2 messages to motions and back: shapes and names, no mathematics."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Quaternion, Transform, Twist, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.robot import DRIVES, Array
from pprs_dynamics.model.drive_model import DriveForces
from pprs_dynamics.nodes.rejection import Rejection

PLATFORM = 'platform'
BASE_FRAMES = ('', 'base')
NANOSECONDS = 1_000_000_000
LATEST_SECOND = 2 ** 31 - 1
_NAMES = list(DRIVES)


@dataclass(frozen=True)
class TrajectoryRequest:
    """A trajectory message as the model needs it.

    Parameters
    ----------
    motion : PlatformMotion
        All points; its time is in seconds after `start`.
    start : int
        Header stamp, or the time of arrival where it is 0 [ns].
    offsets : tuple of int
        time_from_start of every point [ns], exact.
    """

    motion: PlatformMotion
    start: int
    offsets: tuple[int, ...]

    @property
    def first_stamp(self) -> int:
        """When the first point is due [ns]."""
        return self.start + self.offsets[0]


def read_trajectory(
    message: MultiDOFJointTrajectory, now: int, max_age: float,
) -> TrajectoryRequest:
    """Return the platform motion that a message asks for.

    Parameters
    ----------
    message : trajectory_msgs/MultiDOFJointTrajectory
    now : int
        Time of arrival [ns].
    max_age : float
        Oldest header stamp that is accepted [s]; 0 for any.

    Raises
    ------
    Rejection, MotionError
        For a message that breaks a rule.
    """
    if not message.points:
        raise Rejection('EMPTY', 'points: the trajectory has none, but it must have at least 1')
    if list(message.joint_names) != [PLATFORM]:
        raise Rejection('NAMES', f'joint_names is {list(message.joint_names)!r:.100}, '
                        f'but it must be [{PLATFORM!r}]')
    if message.header.frame_id not in BASE_FRAMES:
        raise Rejection('FRAME', f'header.frame_id is {message.header.frame_id!r:.100}, '
                        "but it must be 'base' or empty")
    _require_one_of_each(message.points)
    stamp = nanoseconds(message.header.stamp)
    start = stamp if stamp else now
    age = (now - start) / NANOSECONDS
    if max_age and age > max_age:
        raise Rejection('TIME', f'header.stamp is {age:.3f} s old, max_age allows {max_age:g} s')
    offsets = tuple(nanoseconds(point.time_from_start) for point in message.points)
    if offsets[0] < 0:
        raise Rejection('TIME', f'time_from_start of point 0 is {offsets[0] / NANOSECONDS:g} s, '
                        'but it must not be negative')
    rows = np.array([_row(point) for point in message.points])
    motion = PlatformMotion(
        rows[:, :3], rows[:, 3:7], rows[:, 7:10], rows[:, 10:13], rows[:, 13:16], rows[:, 16:],
        np.array(offsets, dtype=float) / NANOSECONDS)
    return TrajectoryRequest(motion, start, offsets)


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
    message.header.stamp, message.header.frame_id = stamp, BASE_FRAMES[1]
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


def commands(forces: DriveForces) -> Float64MultiArray:
    """Return the forces of the first sample, in drive order."""
    return Float64MultiArray(data=_doubles(forces.total[0]))


def joint_command(request: TrajectoryRequest, forces: DriveForces) -> JointState:
    """Return the first sample, stamped and named, with drive positions and velocities."""
    mechanism = forces.mechanism
    return joint_state(request.first_stamp, forces.total[0], mechanism.position[0],
                       mechanism.velocity[0])


def effort_part(request: TrajectoryRequest, part: Array) -> JointState:
    """Return one part of the forces of the first sample."""
    return joint_state(request.first_stamp, part[0])


def joint_trajectory(request: TrajectoryRequest, forces: DriveForces) -> JointTrajectory:
    """Return every sample with positions, velocities, accelerations and effort."""
    message = JointTrajectory(joint_names=list(DRIVES))
    message.header.stamp, message.header.frame_id = time(request.start), BASE_FRAMES[1]
    mechanism = forces.mechanism
    message.points = [
        JointTrajectoryPoint(positions=q, velocities=v, accelerations=a, effort=force,
                             time_from_start=duration(offset))
        for q, v, a, force, offset in zip(
            mechanism.position.tolist(), mechanism.velocity.tolist(),
            mechanism.acceleration.tolist(), forces.total.tolist(), request.offsets,
            strict=True)]
    return message


def joint_state(
    stamp: int, effort: Array, position: Array | None = None, velocity: Array | None = None,
) -> JointState:
    """Return efforts, and what else is known, at a time [ns]."""
    message = JointState(name=_NAMES, effort=_doubles(effort))
    if position is not None and velocity is not None:
        message.position, message.velocity = _doubles(position), _doubles(velocity)
    message.header.stamp, message.header.frame_id = time(stamp), BASE_FRAMES[1]
    return message


def read_drives(message: JointState, field: str, may_be_nan: bool = False) -> Array:
    """Return one field of a JointState in drive order, matched by name, (6,).

    Raises
    ------
    Rejection
        Where a drive is missing, the field's length is not that of `name`, or a value is not
        finite.
    """
    names, values = list(message.name), getattr(message, field)
    missing = [drive for drive in DRIVES if drive not in names]
    if missing:
        raise Rejection('NAMES', f'name is {names!r:.100}, but it must hold {missing[0]}')
    if len(values) != len(names):
        raise Rejection('SIZE', f'{field} has {len(values)} values, but it must have '
                        f'{len(names)}, as name')
    drives = np.array([values[names.index(drive)] for drive in DRIVES], dtype=float)
    if may_be_nan:
        # Not a number, and no measurement either.
        return np.where(np.isfinite(drives), drives, np.nan)
    if not np.all(np.isfinite(drives)):
        raise Rejection('NON_FINITE', f'{field} is {drives.tolist()}, but it must be finite')
    return drives


def nanoseconds(moment: Time | Duration) -> int:
    """Return a stamp or a duration in nanoseconds."""
    return int(moment.sec) * NANOSECONDS + int(moment.nanosec)


def time(moment: int) -> Time:
    """Return a stamp from nanoseconds, held within what the message can say."""
    seconds, rest = divmod(moment, NANOSECONDS)
    return Time(sec=min(seconds, LATEST_SECOND), nanosec=rest)


def duration(moment: int) -> Duration:
    """Return a duration from nanoseconds, held within what the message can say."""
    seconds, rest = divmod(moment, NANOSECONDS)
    return Duration(sec=min(seconds, LATEST_SECOND), nanosec=rest)


def _doubles(values: Array) -> array[float]:
    """Return values in the form that messages take over without looking at each one."""
    return array('d', np.ascontiguousarray(values, dtype=float).tobytes())


def _require_one_of_each(points: Sequence[Any]) -> None:
    for index, point in enumerate(points):
        for field in ('transforms', 'velocities', 'accelerations'):
            count = len(getattr(point, field))
            if count != 1:
                raise Rejection('SIZE', f'point {index} has {count} {field}, but it must have 1')


def _row(point: MultiDOFJointTrajectoryPoint) -> tuple[float, ...]:
    pose, twist, gain = point.transforms[0], point.velocities[0], point.accelerations[0]
    p, q = pose.translation, pose.rotation
    v, w, a, e = twist.linear, twist.angular, gain.linear, gain.angular
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z,
            a.x, a.y, a.z, e.x, e.y, e.z)


def _vector(values: Array) -> Vector3:
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)

