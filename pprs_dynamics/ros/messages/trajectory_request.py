# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Requests for forces: the motion in a message, or the rule that it breaks."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.measurement.files.samples import Indices, Mask
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import FEWEST_POSES, PlatformMotion, spline_derivatives
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.messages.conversions import NANOSECONDS, PLATFORM, RobotNames, nanoseconds
from pprs_dynamics.ros.messages.incoming_bytes import message_in
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.system.cdr import HEADER, LITTLE_ENDIAN, STAMP, WORD, Walk, aligned

TRAJECTORY, POSES = '~/trajectory', '~/pose_trajectory'
REJECT, SPLINE = 'reject', 'spline'
TWO_WORDS = struct.Struct('<2I')
Motion = PlatformMotion | JointMotion


class Points(NamedTuple):
    """Content of a message.

    Parameters
    ----------
    stamp : int
        Of its header [ns].
    frame : str
    names : list of str
    numbers : (N, K) array
        Of all three sequences, one after the other.
    offsets : (N,) array of int
        time_from_start [ns].
    """

    stamp: int
    frame: str
    names: list[str]
    numbers: Array
    offsets: Indices


class PointLayout:
    """Layout of messages whose points have three sequences of numbers and time_from_start.

    Points with as many numbers each have a constant length, so NumPy reads a thousand of them in
    the time that message objects need for two. A point is a row of words of four bytes. Numbers
    are two words, and start at multiples of eight bytes. Every word of the layout is compared; a
    message that differs in any is read as an object.

    Parameters
    ----------
    counts, numbers : 3 ints
        Elements of each sequence, and numbers in all of them.
    empty : int
        Sequences behind these, without elements.
    """

    def __init__(self, counts: Sequence[int], numbers: Sequence[int], empty: int = 0) -> None:
        # The first length word of a point follows the time of the point before.
        at = self._before = 1 + (empty + 1) % 2
        words: list[tuple[int, int]] = []
        columns: list[int] = []
        for k, (count, width) in enumerate(zip(counts, numbers, strict=True)):
            if k:
                words.append((at, count))
                at += 2
            columns += range(at, at + 2 * width)
            at += 2 * width
        words += [(at + k, 0) for k in range(empty)]
        self._first, self._columns, self._time = counts[0], np.array(columns), at + empty
        places, lengths = np.array(words, '<u4').T
        self._words, self._lengths = places.astype(int), lengths.tobytes()

    def read(self, data: bytes) -> Points | None:
        """Return the content of a message, or None where it has another layout."""
        if data[:HEADER] != LITTLE_ENDIAN:
            return None
        walk = Walk(data)
        try:
            walk.over(STAMP.size)
            frame, *names = (_text(data[place]) for place in (walk.text(), *walk.texts()))
            place = aligned(walk.at, WORD.size)
            count, first = TWO_WORDS.unpack_from(data, place)
        except (struct.error, ValueError):
            return None
        width = self._time + 2
        start = aligned(place + TWO_WORDS.size, 8) - self._before * WORD.size
        # Bytes without meaning may follow.
        if not count or first != self._first or (
                len(data) < start + count * width * WORD.size):
            return None
        rows = np.frombuffer(data, '<u4', count * width, start).reshape(count, width)
        if rows.take(self._words, 1).tobytes() != self._lengths * count or (
                rows[1:, 0].tobytes() != WORD.pack(first) * (count - 1)):
            return None
        seconds, nanoseconds = STAMP.unpack_from(data, HEADER)
        offsets = (rows.view('<i4')[:, self._time].astype(np.int64) * NANOSECONDS
                   + rows[:, self._time + 1])
        return Points(seconds * NANOSECONDS + nanoseconds, frame, names,
                      rows.take(self._columns, 1).view('<f8'), offsets)


def _text(data: bytes) -> str:
    """Return a text, which ends with a zero; raise ValueError where it does not."""
    if data[-1:] != b'\0':
        raise ValueError(data)
    return data[:-1].decode()


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
        """Return the timing of a node's parameters, which have the same names."""
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

    def check_pause(self, pause: float) -> None:
        """Refuse (TIME) what became too old while the node stood still for a pause [s]."""
        if self.max_age and pause > self.max_age:
            raise Rejection('TIME', f'the node stood still for {pause:.3f} s before it had the '
                            f'forces, max_age allows {self.max_age:g} s; the machine is busy, or '
                            'the process was suspended')


class RequestReader:
    """Reads requests for the motion of one body, or of joints.

    Parameters
    ----------
    message : type
        MultiDOFJointTrajectory for a body, JointTrajectory for joints.
    names : tuple of str
        The body, or the joints in the model's order; messages may have another order.
    frame : str, optional
        In which poses must be given; None: any.
    """

    def __init__(self, message: type, names: Sequence[str], frame: str | None = None) -> None:
        self.message, self._names, self._frame = message, list(names), frame
        self._is_body, count = message is MultiDOFJointTrajectory, len(names)
        # Numbers of place, velocity and acceleration of a point.
        self._widths = (7, 6, 6) if self._is_body else (count,) * 3
        # Joints come without efforts: an empty sequence follows.
        self.layout = PointLayout((count,) * 3, self._widths, empty=0 if self._is_body else 1)

    def read(self, data: bytes, now: int, missing: str = REJECT) -> TrajectoryRequest:
        """Return the request in the bytes of a message; see `of_message`.

        Raises
        ------
        Rejection, MotionError
            For a message that breaks a rule.
        """
        points = self.layout.read(data)
        if points is None:  # another layout
            return self.of_message(message_in(data, self.message), now, missing)
        self._check_names(points.names, points.frame)
        return self._request(points, now)

    def of_message(self, message: Any, now: int, missing: str = REJECT) -> TrajectoryRequest:
        """Return the request in a message.

        Parameters
        ----------
        message : MultiDOFJointTrajectory or JointTrajectory
            Efforts are not read.
        now : int
            Time of arrival [ns], which a stamp of 0 means.
        missing : {'reject', 'spline'}
            What to do where points have no velocities or no accelerations: 'spline' takes those
            that are missing from a spline through the places.

        Raises
        ------
        Rejection, MotionError
            For a message that breaks a rule.
        """
        points, names, frame = message.points, list(message.joint_names), message.header.frame_id
        if not points:
            raise Rejection('EMPTY', 'points: the trajectory has none, must have at least 1')
        self._check_names(names, frame)
        lacking = self._lacking(points, missing)
        offsets = np.array([nanoseconds(point.time_from_start) for point in points], np.int64)
        numbers = np.array([self._row(point) for point in points], dtype=float)
        if lacking.any():
            self._fill_in(numbers, (offsets - offsets[0]) / NANOSECONDS, lacking)
        return self._request(
            Points(nanoseconds(message.header.stamp), frame, names, numbers, offsets), now)

    def _check_names(self, names: list[str], frame: str) -> None:
        if sorted(names) != sorted(self._names):
            raise Rejection('NAMES', f'joint_names is {names!r:.200}, must contain each of '
                            f'{", ".join(self._names)} once, and nothing else')
        if self._frame is not None and frame not in ('', self._frame):
            raise Rejection('FRAME', f'header.frame_id is {frame!r:.100}, '
                            f'must be {self._frame!r} or empty')

    def _lacking(self, points: Sequence[Any], missing: str) -> Mask:
        """Return the points that may lack velocities and accelerations, and do, (N, 2).

        Raises
        ------
        Rejection
            SIZE, for another number of elements.
        """
        place, wanted = 'transforms' if self._is_body else 'positions', len(self._names)
        lacking = np.zeros((len(points), 2), dtype=bool)
        for index, point in enumerate(points):
            for column, field in enumerate(('velocities', 'accelerations', place)):
                count = len(getattr(point, field))
                if count == wanted:
                    continue
                may_lack = count == 0 and field != place and missing == SPLINE
                if may_lack and len(points) >= FEWEST_POSES:
                    lacking[index, column] = True
                    continue
                hint = (f': a spline needs at least {FEWEST_POSES} points, and the trajectory has '
                        f'{len(points)}' if may_lack else '')
                raise Rejection(
                    'SIZE', f'point {index} has {count} {field}, must have {wanted}{hint}')
        return lacking

    def _row(self, point: Any) -> list[float]:
        """Return the numbers of a point, zero where it has none."""
        if not self._is_body:
            none = [0.0] * len(self._names)
            return [*point.positions, *(point.velocities or none), *(point.accelerations or none)]
        pose = point.transforms[0]
        p, q = pose.translation, pose.rotation
        return [p.x, p.y, p.z, q.x, q.y, q.z, q.w,
                *_twist(point.velocities), *_twist(point.accelerations)]

    def _fill_in(self, numbers: Array, time: Array, lacking: Mask) -> None:
        """Put the derivatives of a spline into the points without derivatives."""
        place, velocity, acceleration = self._parts(numbers)
        derivatives = spline_derivatives(time, place, self._is_body)
        for given, values, rows in zip((velocity, acceleration), derivatives, lacking.T,
                                       strict=True):
            if not np.isfinite(values).all():
                raise Rejection('OUTPUT', 'the spline through the points has derivatives that are '
                                'not finite')
            given[rows] = values[rows]

    def _parts(self, numbers: Array) -> tuple[Array, Array, Array]:
        """Return places, velocities and accelerations, as views."""
        first, second = self._widths[0], self._widths[0] + self._widths[1]
        return numbers[:, :first], numbers[:, first:second], numbers[:, second:]

    def _request(self, points: Points, now: int) -> TrajectoryRequest:
        numbers, offsets = points.numbers, points.offsets
        if offsets[0] < 0:
            raise Rejection('TIME', f'time_from_start of point 0 is {offsets[0] / NANOSECONDS:g} s,'
                            ' must not be negative')
        motion: Motion
        if self._is_body:
            motion = PlatformMotion.from_rows(numbers, offsets / NANOSECONDS)
        else:
            position, velocity, acceleration = self._parts(numbers)
            if points.names != self._names:
                order = [points.names.index(joint) for joint in self._names]
                position, velocity, acceleration = (
                    rows[:, order] for rows in (position, velocity, acceleration))
            motion = JointMotion.checked(position, velocity, acceleration, offsets / NANOSECONDS,
                                         len(self._names))
        return TrajectoryRequest(motion, points.stamp or now, offsets)


def readers_for(model: DriveModel, names: RobotNames | None = None) -> dict[str, RequestReader]:
    """Return how trajectories for a model arrive, by topic.

    A robot with loops takes the motion of its drives, and of its tool if the pose of the tool
    determines the drives.
    """
    own = names or RobotNames.of(model)
    if model.robot.plans_poses:
        return {TRAJECTORY: RequestReader(MultiDOFJointTrajectory, [PLATFORM], own.frame)}
    readers = {TRAJECTORY: RequestReader(JointTrajectory, own.joints)}
    with suppress(ModelError):
        tool = model.robot.tool_pose.structure.tool
        readers[POSES] = RequestReader(MultiDOFJointTrajectory, [tool],
                                       own.frame or str(model.values['robot.base']))
    return readers


def _twist(twists: Sequence[Any]) -> tuple[float, ...]:
    if not twists:
        return (0.0,) * 6
    linear, angular = twists[0].linear, twists[0].angular
    return linear.x, linear.y, linear.z, angular.x, angular.y, angular.z
