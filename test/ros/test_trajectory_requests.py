# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What trajectories ask for, as objects and as bytes, and which break a rule."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from feedforward_bench import EQUAL, feedforward_bench, message_of, random_motion
from geometry_msgs.msg import Transform
from hypothesis import given, settings
from hypothesis import strategies as st
from random_states import smooth_motion
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.conversions import RobotNames
from pprs_dynamics.ros.messages.incoming_bytes import is_whole, message_in
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.messages.trajectory_request import (
    POSES,
    TRAJECTORY,
    RequestReader,
    readers_for,
)

JOINTS = ('shoulder', 'elbow', 'wrist')
TIMES = np.arange(0.25, 0.65, 0.02)  # the first point is due later
RATES = np.array([2.0, 3.0, 5.0])
READER = RequestReader(JointTrajectory, JOINTS)


def message(order: tuple[int, ...] = (0, 1, 2), *lacking: str) -> JointTrajectory:
    """Sines of three frequencies, with their derivatives, of joints in an order."""
    names = [JOINTS[k] for k in order]
    found = JointTrajectory(joint_names=names)
    for time in TIMES:
        angle = (RATES * time)[list(order)]
        rate = RATES[list(order)]
        point = JointTrajectoryPoint(
            positions=np.sin(angle), velocities=rate * np.cos(angle),
            accelerations=-rate ** 2 * np.sin(angle), time_from_start=lasting(time))
        for field in lacking:
            setattr(point, field, [])
        found.points.append(point)
    return found


def lasting(time: float) -> Duration:
    return Duration(sec=int(time), nanosec=round(time % 1 * 1e9))


def test_joints_may_come_in_any_order() -> None:
    angle = TIMES[:, None] * RATES
    for order in ((0, 1, 2), (2, 0, 1), (1, 0, 2)):
        found: Any = READER.of_message(message(order), 7)
        assert found.start == 7
        np.testing.assert_array_equal(found.offsets, np.round(1e9 * TIMES))
        np.testing.assert_allclose(found.motion.position, np.sin(angle), atol=1e-15)
        np.testing.assert_allclose(found.motion.velocity, RATES * np.cos(angle), atol=1e-15)
        np.testing.assert_allclose(found.motion.acceleration, -RATES ** 2 * np.sin(angle),
                                   atol=1e-14)


def test_a_stamp_is_the_start() -> None:
    stamped = message()
    stamped.header.stamp = Time(sec=12, nanosec=34)
    assert READER.of_message(stamped, 7).start == 12_000_000_034


@pytest.mark.parametrize('lacking', [('accelerations',), ('velocities', 'accelerations')])
def test_derivatives_that_are_missing_are_those_of_a_spline_through_the_positions(
    lacking: tuple[str, ...],
) -> None:
    found: Any = READER.of_message(message((0, 1, 2), *lacking), 7, 'spline')
    angle = TIMES[:, None] * RATES
    np.testing.assert_allclose(found.motion.velocity, RATES * np.cos(angle), atol=1e-4)
    np.testing.assert_allclose(found.motion.acceleration, -RATES ** 2 * np.sin(angle), atol=2e-2)
    if len(lacking) == 1:  # what is given is kept
        np.testing.assert_allclose(found.motion.velocity, RATES * np.cos(angle), atol=1e-15)


def test_what_is_missing_is_rejected_where_no_spline_is_asked_for() -> None:
    with pytest.raises(Rejection, match='point 0 has 0 accelerations, must have 3'):
        READER.of_message(message((0, 1, 2), 'accelerations'), 7)


@pytest.mark.parametrize('names', [JOINTS[:2], (*JOINTS, 'gripper'), ('a', 'b', 'c'),
                                   ('shoulder', 'shoulder', 'wrist')])
def test_other_joints_are_rejected(names: tuple[str, ...]) -> None:
    wrong = message()
    wrong.joint_names = list(names)
    with pytest.raises(Rejection, match='must contain each of shoulder, elbow, wrist once'):
        READER.of_message(wrong, 7)


def test_a_robot_with_loops_takes_its_drives_and_poses_of_its_tool_in_its_frame() -> None:
    model = DriveModel.load('config/hexapod.yaml')
    own = RobotNames.of(model)
    base = str(model.values['robot.base'])
    for names, frame in ((None, base), (own._replace(frame='cell'), 'cell')):
        readers = readers_for(model, names)
        assert set(readers) == {TRAJECTORY, POSES}
        still = JointTrajectory(joint_names=list(own.joints), points=[JointTrajectoryPoint(
            positions=[0.0] * 6, velocities=[0.0] * 6, accelerations=[0.0] * 6)])
        found = readers[TRAJECTORY].read(serialize_message(still), 7, 'reject')
        assert type(found.motion) is model.robot.motions[0]
        pose = MultiDOFJointTrajectory(
            joint_names=[model.robot.structure.tool],
            points=[MultiDOFJointTrajectoryPoint(transforms=[Transform()]) for _ in range(4)])
        for k, point in enumerate(pose.points):
            point.time_from_start = lasting(0.1 * k)
        for asked in ('', frame):
            pose.header.frame_id = asked
            found = readers[POSES].read(serialize_message(pose), 7, 'spline')
            assert type(found.motion) is model.robot.motions[1]
        pose.header.frame_id = 'elsewhere'
        with pytest.raises(Rejection, match=f"must be '{frame}' or empty"):
            readers[POSES].read(serialize_message(pose), 7, 'spline')


# Reading and writing serialised messages gives what message objects give.

POINTS = st.integers(1, 30)
SEEDS = st.integers(0, 2**32 - 1)


def random_message(points: int, seed: int) -> MultiDOFJointTrajectory:
    rng = np.random.default_rng(seed)
    message = message_of(random_motion(rng, points))
    message.header.frame_id = str(rng.choice(['', 'base']))
    message.header.stamp.sec = int(rng.integers(-2**31, 2**31))
    message.header.stamp.nanosec = int(rng.integers(0, 10**9))
    message.points[0].time_from_start.sec = -int(rng.integers(0, 2)) * points
    return message


def poses() -> RequestReader:
    return readers_for(DriveModel.load())[TRAJECTORY]


def outcome(read: Callable[..., Any], *what: Any) -> object:
    """Return what a reader gives: its numbers, or its refusal."""
    try:
        request = read(*what, 1_000, 'reject')
    except Exception as error:
        return type(error), str(error)
    motion = request.motion
    fields = ('position', 'velocity', 'acceleration') if isinstance(motion, JointMotion) else (
        'position', 'orientation', 'linear_velocity', 'angular_velocity', 'linear_acceleration',
        'angular_acceleration')
    return (request.start, request.offsets.tolist(), motion.time.tobytes(),
            *(getattr(motion, field).tobytes() for field in fields))


def from_bytes(reader: RequestReader, message: Any) -> object:
    """Return the outcome of a message that is read without objects."""
    data = bytes(serialize_message(message))
    assert reader.layout.read(data) is not None
    return outcome(reader.read, data)


LEGS = tuple(f'leg_{k}' for k in range(1, 7))


def joint_message(points: int, seed: int) -> JointTrajectory:
    rng = np.random.default_rng(seed)
    message = JointTrajectory(joint_names=rng.permutation(LEGS).tolist())
    message.header.frame_id = str(rng.choice(['', 'map']))
    message.header.stamp.sec = int(rng.integers(-2**31, 2**31))
    message.header.stamp.nanosec = int(rng.integers(0, 10**9))
    for k in range(points):
        p, v, a = rng.normal(size=(3, len(LEGS))).tolist()
        message.points.append(JointTrajectoryPoint(
            positions=p, velocities=v, accelerations=a,
            time_from_start=conversions.duration(k * 1_234_567_891)))
    return message


def alter(message: Any, rng: np.random.Generator) -> None:
    """Change what makes the layout: how many values a field has, or of how many letters."""
    point = message.points[int(rng.integers(len(message.points)))]
    is_pose = isinstance(message, MultiDOFJointTrajectory)
    field = str(rng.choice(['points', 'frame_id', 'names', *(
        ('transforms', 'velocities', 'accelerations') if is_pose else
        ('positions', 'velocities', 'accelerations', 'effort'))]))
    if field == 'points':
        message.points = []
    elif field == 'frame_id':
        message.header.frame_id = 'b' * int(rng.integers(1, 12))
    elif field == 'names' and is_pose:
        message.joint_names = [str(rng.choice(['plätform', 'plat', '平台']))] * int(rng.choice(3))
    elif field == 'names':
        message.joint_names = rng.permutation(LEGS).tolist()[:int(rng.integers(5, 7))]
    elif is_pose:
        setattr(point, field, list(getattr(point, field)) * int(rng.choice([0, 2])))
    else:
        setattr(point, field, [0.5] * int(rng.choice([0, 5, 7] if field != 'effort' else [1, 6])))


# How a random message is made, and what reads it.
KINDS = {'poses': (random_message, poses()),
         'joints': (joint_message, RequestReader(JointTrajectory, LEGS))}
every_kind = pytest.mark.parametrize('kind', KINDS)


@every_kind
@settings(max_examples=200)
@given(POINTS, SEEDS)
def test_bytes_and_objects_give_the_same_numbers(kind: str, points: int, seed: int) -> None:
    make, reader = KINDS[kind]
    message = make(points, seed)
    assert from_bytes(reader, message) == outcome(reader.of_message, message)


@every_kind
@settings(max_examples=300)
@given(POINTS, SEEDS)
def test_whatever_differs_from_the_layout_is_left_to_the_ordinary_path(
    kind: str, points: int, seed: int,
) -> None:
    make, reader = KINDS[kind]
    message = make(points, seed)
    alter(message, np.random.default_rng(seed))
    assert outcome(reader.read, serialize_message(message)) == outcome(reader.of_message, message)


@every_kind
@settings(max_examples=200)
@given(POINTS, SEEDS)
def test_changed_bytes_give_the_ordinary_numbers_or_a_rejection(
    kind: str, points: int, seed: int,
) -> None:
    make, reader = KINDS[kind]
    rng = np.random.default_rng(seed)
    data = bytearray(serialize_message(make(points, seed)))
    for _ in range(int(rng.integers(1, 5))):
        data[int(rng.integers(len(data)))] = int(rng.integers(256))

    def by_object(data: bytes, now: int, missing: str) -> Any:
        return reader.of_message(message_in(data, reader.message), now, missing)

    assert outcome(reader.read, bytes(data)) == outcome(by_object, bytes(data))


@pytest.mark.parametrize('reader', [poses(), RequestReader(JointTrajectory, LEGS)])
def test_big_endian_bytes_are_read_by_the_ordinary_path_or_rejected(reader: RequestReader) -> None:
    data = bytearray(serialize_message(
        random_message(1, 2) if reader.message is MultiDOFJointTrajectory else joint_message(1, 2)))
    data[1] = 0
    with pytest.raises(Rejection):
        reader.read(bytes(data), 1)


def test_a_message_cut_off_within_padding_is_noticed() -> None:
    # Without this look at the lengths, what lies behind the bytes in memory becomes numbers.
    data = serialize_message(random_message(3, 4))
    assert is_whole(data)
    for length in range(len(data)):
        assert not is_whole(data[:length])
        with pytest.raises(Rejection, match=r'^SIZE'):
            poses().read(data[:length], 1)


def joint_state(frame: str, names: list[str], values: list[float]) -> JointState:
    message = JointState(name=names, position=values, effort=values)
    message.header.frame_id = frame
    return message


@pytest.mark.parametrize('message', [
    joint_state('', list(DRIVES), [1.0] * 6), joint_state('base', ['a'], [2.0]),
    joint_state('b', [], []), Float64MultiArray(data=[1.0] * 6), Float64MultiArray()])
def test_other_messages_are_taken_whole_or_not_at_all(message: object) -> None:
    data = bytes(serialize_message(message))
    assert message_in(data, type(message)) == message
    # What is serialised may be followed by up to 8 bytes that mean nothing.
    whole = next(length for length in range(len(data) + 1)
                 if is_whole(data[:length], type(message)))
    assert whole >= len(data) - 8
    assert message_in(data[:whole], type(message)) == message
    for length in range(whole):
        with pytest.raises(Rejection, match=r'^SIZE: .* no whole (sensor|std)_msgs/'):
            message_in(data[:length], type(message))


# Trajectories without twists or accelerations: rejected, or taken from a spline.

POSE_READER = readers_for(DriveModel.load())[TRAJECTORY]

MOMENTS = np.arange(0.0, 1.0, 0.01)
SMOOTH = smooth_motion(MOMENTS)


def without(motion: PlatformMotion, *fields: str, points: slice | None = None,
            ) -> MultiDOFJointTrajectory:
    message = message_of(motion)
    for point in message.points[points or slice(None)]:
        for field in fields:
            setattr(point, field, [])
    return message


def motion_of(message: MultiDOFJointTrajectory) -> PlatformMotion:
    return POSE_READER.of_message(message, 1, missing='spline').motion


def test_the_spline_gives_the_derivatives_of_a_motion_known_in_closed_form() -> None:
    motion = motion_of(without(SMOOTH, 'velocities', 'accelerations'))
    # Poses at 100 Hz of motions of 3 rad/s: truncation of quintic splines. The ends matter: the
    # first point is the one that is executed.
    for name, inner, ends in (('linear_velocity', 1e-9, 1e-8), ('angular_velocity', 1e-9, 1e-8),
                              ('linear_acceleration', 1e-8, 1e-6),
                              ('angular_acceleration', 1e-7, 1e-5)):
        error = np.abs(getattr(motion, name) - getattr(SMOOTH, name)).max(axis=1)
        assert error[10:-10].max() < inner, name
        assert error.max() < ends, name


def test_what_is_given_is_kept_and_only_what_is_missing_is_filled() -> None:
    altered = PlatformMotion(
        SMOOTH.position, SMOOTH.orientation, SMOOTH.linear_velocity + 0.01,
        SMOOTH.angular_velocity, SMOOTH.linear_acceleration, SMOOTH.angular_acceleration, MOMENTS)
    motion = motion_of(without(altered, 'accelerations'))
    np.testing.assert_array_equal(motion.linear_velocity, altered.linear_velocity)
    np.testing.assert_allclose(motion.linear_acceleration[10:-10],
                               SMOOTH.linear_acceleration[10:-10], rtol=0, atol=1e-8)
    some = motion_of(without(altered, 'velocities', points=slice(20, 30)))
    np.testing.assert_array_equal(some.linear_velocity[:20], altered.linear_velocity[:20])
    np.testing.assert_array_equal(some.linear_acceleration, altered.linear_acceleration)
    np.testing.assert_allclose(some.linear_velocity[20:30], SMOOTH.linear_velocity[20:30],
                               rtol=0, atol=1e-8)


@pytest.mark.parametrize('fields', [('velocities',), ('accelerations',),
                                    ('velocities', 'accelerations')])
def test_too_few_points_and_the_policy_reject_refuse_with_the_code_size(
    fields: tuple[str, ...],
) -> None:
    for motion, policy in ((SMOOTH[:3], 'spline'), (SMOOTH[:1], 'spline'), (SMOOTH, 'reject')):
        with pytest.raises(Rejection, match=r'^SIZE: point 0 has 0'):
            POSE_READER.of_message(without(motion, *fields), 1, missing=policy)
    motion_of(without(SMOOTH[:4], *fields))


def test_poses_that_no_spline_can_follow_are_rejected_and_nothing_else_happens() -> None:
    rng = np.random.default_rng(4)
    for seconds in ([0, 1, 2, 3], [0, 0, 2**31 - 5, 2**31 - 2]):
        message = without(random_motion(rng, 4), 'velocities', 'accelerations')
        for k, (point, second) in enumerate(zip(message.points, seconds, strict=True)):
            point.time_from_start.sec, point.time_from_start.nanosec = second, k
        message.points[2].transforms[0].translation.x = 1e308
        message.points[3].transforms[0].translation.x = -1e308
        with pytest.raises(Rejection, match=r'^OUTPUT'):
            motion_of(message)


@pytest.mark.nodes
def test_the_node_answers_a_pose_trajectory_as_a_whole_and_its_first_point() -> None:
    expected = DriveModel.load().drive_forces(SMOOTH)
    with feedforward_bench(missing_derivatives='spline') as node:
        first = node.answer(without(SMOOTH, 'velocities', 'accelerations'))
        assert node.bench.spin_until(lambda: node.joint_trajectory)
        effort = np.array([point.effort for point in node.joint_trajectory[-1].points])
        np.testing.assert_allclose(first, effort[0], rtol=0, atol=EQUAL)
        # Errors of 1e-5 in accelerations, and velocities of 1e-8 under a reversal of 1e-3 m/s.
        np.testing.assert_allclose(effort, expected.total, rtol=0, atol=1e-4)
        node.send(without(SMOOTH[:1], 'velocities'))
        assert node.counters['SIZE'] == 1
