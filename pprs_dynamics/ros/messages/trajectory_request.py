# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Which messages ask a model for forces, and their motion, or the rule that they break."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from trajectory_msgs.msg import (
    JointTrajectory,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.measurement.files.samples import Indices, Mask
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion, position_spline_derivatives
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.pose_spline import FEWEST_POSES, spline_derivatives
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.messages.conversions import (
    BASE,
    NANOSECONDS,
    PLATFORM,
    RobotNames,
    nanoseconds,
)
from pprs_dynamics.ros.messages.incoming_bytes import message_in
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.messages.trajectory_bytes import PointLayout, Points

TRAJECTORY, POSES = '~/trajectory', '~/pose_trajectory'
REJECT, SPLINE = 'reject', 'spline'
VELOCITY, ACCELERATION = slice(7, 13), slice(13, 19)
Motion = PlatformMotion | JointMotion


class TrajectoryRequest(NamedTuple):
    """A request for the forces of a trajectory.

    Parameters
    ----------
    motion : PlatformMotion or JointMotion
        All points; its time is in seconds after `start`.
    start : int
        Header stamp, or the time of arrival where it is 0 [ns].
    offsets : (N,) array of int
        time_from_start of every point [ns], exact.
    """

    motion: Any
    start: int
    offsets: Indices

    @property
    def first_stamp(self) -> int:
        """When the first point is due [ns]."""
        return self.start + int(self.offsets[0])

    @property
    def end(self) -> int:
        """When the last point is due [ns]."""
        return self.start + int(self.offsets[-1])


class Timing(NamedTuple):
    """When a trajectory may begin, and how long it may last; 0 in each: any.

    Parameters
    ----------
    max_age : float
        Oldest header stamp; of a message without one, longest time since it was sent [s].
    max_ahead : float
        How far ahead of its moment the first point may arrive, which is executed at once [s].
    max_duration : float
        Latest time_from_start [s].
    """

    max_age: float = 0.0
    max_ahead: float = 0.0
    max_duration: float = 0.0

    @classmethod
    def of(cls, node_values: Mapping[str, Any]) -> Timing:
        """Return that of a node's parameters, which have its names."""
        return cls(*(node_values[name] for name in cls._fields))

    def check(self, request: TrajectoryRequest, now: int, waited: float = 0.0) -> None:
        """Refuse a request that is too old, too early or too long.

        Parameters
        ----------
        request : TrajectoryRequest
        now : int
            Time of arrival [ns]; 0 where there is no clock: then nothing can be said of a stamp.
        waited : float
            Since the message was sent, by the clocks of sender and receiver [s].

        Raises
        ------
        Rejection
            TIME.
        """
        lasts = int(request.offsets[-1]) / NANOSECONDS
        if self.max_duration and lasts > self.max_duration:
            raise Rejection('TIME', f'time_from_start of the last point is {lasts:g} s, '
                            f'max_duration allows {self.max_duration:g} s')
        if request.start == now:
            if self.max_age and waited > self.max_age:
                raise Rejection('TIME', f'the message was sent {waited:.3f} s ago, max_age allows '
                                f'{self.max_age:g} s; where that is too much, the clocks of two '
                                'machines differ, or this one is busy')
        elif now:
            age = (now - request.start) / NANOSECONDS
            if self.max_age and age > self.max_age:
                raise Rejection('TIME', f'header.stamp is {age:.3f} s old, max_age allows '
                                f'{self.max_age:g} s')
        ahead = (request.first_stamp - now) / NANOSECONDS
        if now and self.max_ahead and ahead > self.max_ahead:
            raise Rejection('TIME', f'the first point is due {ahead:.3f} s from now, and would be '
                            f'executed at once; max_ahead allows {self.max_ahead:g} s')


def read_trajectory(
    message: MultiDOFJointTrajectory, now: int, missing: str = REJECT, frame: str = BASE,
    body: str = PLATFORM,
) -> TrajectoryRequest:
    """Return the platform motion that a message asks for.

    Parameters
    ----------
    message : trajectory_msgs/MultiDOFJointTrajectory
    now : int
        Time of arrival [ns], which a stamp of 0 means.
    missing : {'reject', 'spline'}
        What to do where points have no velocities or no accelerations: 'spline' takes those
        that are missing from a spline through the poses.
    frame : str
        In which poses must be given.
    body : str
        Whose they must be.

    Raises
    ------
    Rejection, MotionError
        For a message that breaks a rule.
    """
    points = message.points
    if not points:
        raise Rejection('EMPTY', 'points: the trajectory has none, must have at least 1')
    if list(message.joint_names) != [body]:
        raise Rejection('NAMES', f'joint_names is {list(message.joint_names)!r:.100}, '
                        f'must be [{body!r}]')
    if message.header.frame_id not in ('', frame):
        raise Rejection('FRAME', f'header.frame_id is {message.header.frame_id!r:.100}, '
                        f'must be {frame!r} or empty')
    lacking = _check_counts(points, missing)
    start, offsets = _times_of(message, now)
    numbers = np.array([_row(point) for point in points])
    if lacking.any():
        _fill_in(numbers, (VELOCITY, ACCELERATION), spline_derivatives(
            (offsets - offsets[0]) / NANOSECONDS, numbers[:, :3], numbers[:, 3:7]), lacking)
    return _request_of(start, offsets, _motion_of(numbers))


def _motion_of(numbers: Array) -> Callable[[Array], Motion]:
    return lambda time: PlatformMotion.from_rows(numbers, time)


def _request_of(
    start: int, offsets: Indices, motion_at: Callable[[Array], Motion],
) -> TrajectoryRequest:
    """Return the request for a motion that is made with its times [s], from the start on."""
    if offsets[0] < 0:
        raise Rejection('TIME', f'time_from_start of point 0 is {offsets[0] / NANOSECONDS:g} s, '
                        'must not be negative')
    return TrajectoryRequest(motion_at(offsets / NANOSECONDS), start, offsets)


def _times_of(message: Any, now: int) -> tuple[int, Indices]:
    """Return the start of a trajectory, and time_from_start of its points (N,) [ns]."""
    return nanoseconds(message.header.stamp) or now, np.array(
        [nanoseconds(point.time_from_start) for point in message.points], dtype=np.int64)


def _check_counts(
    points: Sequence[Any], missing: str, places: str = 'transforms', wanted: int = 1,
) -> Mask:
    """Return which points lack velocities and accelerations, (N, 2), where that is allowed.

    Parameters
    ----------
    points : sequence of messages
    missing : {'reject', 'spline'}
    places : str
        Field that says where.
    wanted : int
        Elements that each field must have.

    Raises
    ------
    Rejection
        SIZE, for another number of elements.
    """
    lacking = np.zeros((len(points), 2), dtype=bool)
    for index, point in enumerate(points):
        for column, field in enumerate(('velocities', 'accelerations', places)):
            count = len(getattr(point, field))
            if count == wanted:
                continue
            may_lack = count == 0 and field != places and missing == SPLINE
            if may_lack and len(points) >= FEWEST_POSES:
                lacking[index, column] = True
                continue
            hint = (f': a spline needs at least {FEWEST_POSES} points, and the trajectory has '
                    f'{len(points)}' if may_lack else '')
            raise Rejection(
                'SIZE', f'point {index} has {count} {field}, must have {wanted}{hint}')
    return lacking


def _fill_in(numbers: Array, places: tuple[slice, slice], derivatives: tuple[Array, Array],
             lacking: Mask) -> None:
    """Put the derivatives of a spline into the columns of those points that lack their own."""
    for place, values, rows in zip(places, derivatives, lacking.T, strict=True):
        if not np.isfinite(values).all():
            raise Rejection('OUTPUT', 'the spline through the points has derivatives that are '
                            'not finite')
        numbers[rows, place] = values[rows]


def _row(point: MultiDOFJointTrajectoryPoint) -> tuple[float, ...]:
    """Return the numbers of a point, zero where it has none."""
    pose = point.transforms[0]
    p, q = pose.translation, pose.rotation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w,
            *_twist(point.velocities), *_twist(point.accelerations))


def _twist(twists: Sequence[Any]) -> tuple[float, ...]:
    if not twists:
        return (0.0,) * 6
    linear, angular = twists[0].linear, twists[0].angular
    return linear.x, linear.y, linear.z, angular.x, angular.y, angular.z


def read_joint_trajectory(
    message: JointTrajectory, joints: Sequence[str], now: int, missing: str = REJECT,
) -> TrajectoryRequest:
    """Return the motion that a message asks of an arm.

    Parameters
    ----------
    message : trajectory_msgs/JointTrajectory
        Of all joints, in any order; its efforts are not read, and its frame means nothing.
    joints : sequence of n str
        In the model's order.
    now, missing
        See `read_trajectory`; a spline goes through the positions.

    Raises
    ------
    Rejection, MotionError
        For a message that breaks a rule.
    """
    points, names = message.points, list(message.joint_names)
    if not points:
        raise Rejection('EMPTY', 'points: the trajectory has none, must have at least 1')
    if sorted(names) != sorted(joints):
        raise Rejection('NAMES', f'joint_names is {names!r:.200}, must hold each of '
                        f'{", ".join(joints)} once, and nothing else')
    count = len(joints)
    lacking = _check_counts(points, missing, 'positions', count)
    start, offsets = _times_of(message, now)
    none = np.zeros(count)
    order = [names.index(joint) for joint in joints]
    numbers = np.array([[point.positions, point.velocities or none, point.accelerations or none]
                        for point in points], dtype=float)[:, :, order].reshape(len(points), -1)
    if lacking.any():
        _fill_in(numbers, (slice(count, 2 * count), slice(2 * count, 3 * count)),
                 position_spline_derivatives((offsets - offsets[0]) / NANOSECONDS,
                                             numbers[:, :count]), lacking)
    return _request_of(start, offsets, _joint_motion_of(count, numbers))


class RequestReader(NamedTuple):
    """How requests arrive, as bytes.

    Parameters
    ----------
    message : type
    layout : PointLayout
        Of messages that are read without objects.
    of_points : callable
        Points, time of arrival [ns] -> TrajectoryRequest, or None for other names or frames.
    of_message : callable
        Message, time of arrival [ns] and what to do about missing derivatives -> TrajectoryRequest;
        see `read_trajectory`.
    """

    message: type
    layout: PointLayout
    of_points: Callable[[Points, int], TrajectoryRequest | None]
    of_message: Callable[..., TrajectoryRequest]

    def read(self, data: bytes, now: int, missing: str = REJECT) -> TrajectoryRequest:
        """Return the request in the bytes of a message.

        Parameters
        ----------
        data : bytes
        now, missing
            See `read_trajectory`.

        Raises
        ------
        Rejection, MotionError
            For a message that breaks a rule.
        """
        points = self.layout.read(data)
        request = None if points is None else self.of_points(points, now)
        return request or self.of_message(message_in(data, self.message), now, missing)


def readers_for(model: DriveModel, names: RobotNames | None = None) -> dict[str, RequestReader]:
    """Return how trajectories for a model arrive, by topic.

    A robot with loops takes the motion of its drives, and of its tool if the pose of the tool
    determines the drives.
    """
    readers = {TRAJECTORY: reader_for(model, names)}
    if model.moves_joints:
        try:
            tool = model.robot.tool_pose.structure.tool
        except ModelError:
            return readers
        readers[POSES] = _poses((names and names.frame) or str(model.values['robot.base']),
                                tool)
    return readers


def reader_for(model: DriveModel, names: RobotNames | None = None) -> RequestReader:
    """Return how trajectories for a model arrive, by the names of its robot."""
    names = names or RobotNames.of(model)
    return joint_reader(names.joints) if model.moves_joints else _poses(names.frame, PLATFORM)


def _poses(frame: str, body: str) -> RequestReader:
    def of_points(points: Points, now: int) -> TrajectoryRequest | None:
        if points.frame not in ('', frame) or points.names != [body]:
            return None
        return _request_of(points.stamp or now, points.offsets, _motion_of(points.numbers))

    return RequestReader(
        MultiDOFJointTrajectory, PointLayout((1, 1, 1), (7, 6, 6)), of_points,
        lambda message, now, missing: read_trajectory(message, now, missing, frame, body))


def joint_reader(joints: Sequence[str]) -> RequestReader:
    """Return how joint trajectories arrive, for joints in the model's order."""
    joints, count = list(joints), len(joints)

    def of_points(points: Points, now: int) -> TrajectoryRequest | None:
        if sorted(points.names) != sorted(joints):
            return None
        numbers = points.numbers
        if points.names != joints:
            order = np.array([points.names.index(joint) for joint in joints])
            numbers = numbers[:, np.concatenate([order + k * count for k in range(3)])]
        return _request_of(points.stamp or now, points.offsets, _joint_motion_of(count, numbers))

    return RequestReader(
        JointTrajectory, PointLayout((count,) * 3, (count,) * 3, empty=1),  # without efforts
        of_points, lambda message, now, missing: read_joint_trajectory(
            message, joints, now, missing))


def _joint_motion_of(count: int, numbers: Array) -> Callable[[Array], Motion]:
    position, velocity, acceleration = (numbers[:, k * count:(k + 1) * count] for k in range(3))
    return lambda time: JointMotion.checked(position, velocity, acceleration, time, count)
