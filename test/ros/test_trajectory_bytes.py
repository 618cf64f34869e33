# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Reading and writing serialised messages gives what message objects give."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from feedforward_bench import feedforward_bench, message_of, random_motion
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint, MultiDOFJointTrajectory

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.incoming_bytes import is_whole, message_in
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.messages.trajectory_request import TRAJECTORY, RequestReader, readers_for

pytestmark = pytest.mark.nodes

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


def joint_message(points: int, seed: int, joints: Sequence[str] = LEGS) -> JointTrajectory:
    rng = np.random.default_rng(seed)
    message = JointTrajectory(joint_names=list(joints))
    message.header.stamp.sec = int(rng.integers(-2**31, 2**31))
    message.header.stamp.nanosec = int(rng.integers(0, 10**9))
    for k in range(points):
        p, v, a = rng.normal(size=(3, len(joints))).tolist()
        message.points.append(JointTrajectoryPoint(
            positions=p, velocities=v, accelerations=a,
            time_from_start=conversions.duration(k * 1_234_567_891)))
    return message


@pytest.mark.parametrize('order', [LEGS, LEGS[::-1], (*LEGS[2:], *LEGS[:2])])
def test_joints_come_in_any_order_and_frame(order: tuple[str, ...]) -> None:
    message = joint_message(2, 3, order)
    message.header.frame_id = 'map'
    reader = RequestReader(JointTrajectory, LEGS)
    assert from_bytes(reader, message) == outcome(reader.of_message, message)


def alter(message: MultiDOFJointTrajectory, rng: np.random.Generator) -> None:
    """Change what makes the layout."""
    point = message.points[int(rng.integers(len(message.points)))]
    kind = int(rng.integers(8))
    if kind == 0:
        message.header.frame_id = 'b' * int(rng.integers(1, 12))
    elif kind == 1:
        message.joint_names = ['platform'] * int(rng.choice([0, 2, 3]))
    elif kind == 2:
        message.joint_names = [str(rng.choice(['plätform', 'plat', '平台']))]
    elif kind == 3:
        point.velocities = point.velocities * int(rng.choice([0, 2]))
    elif kind == 4:
        point.accelerations = point.accelerations * int(rng.choice([0, 3]))
    elif kind == 5:
        point.transforms = point.transforms * int(rng.choice([0, 2]))
    elif kind == 6:
        message.points = []
    else:
        point.velocities, point.accelerations = [], point.accelerations * 2


def alter_joints(message: JointTrajectory, rng: np.random.Generator) -> None:
    """Change what makes the layout."""
    point = message.points[int(rng.integers(len(message.points)))]
    field = str(rng.choice(['positions', 'velocities', 'accelerations', 'effort', 'names']))
    if field == 'names':
        message.joint_names = rng.permutation(LEGS).tolist()[:int(rng.integers(5, 7))]
    else:
        setattr(point, field, [0.5] * int(rng.choice([0, 5, 7] if field != 'effort' else [1, 6])))


# How a random message is made, how its layout is changed, and what reads it.
KINDS = {
    'poses': (random_message, alter, poses()),
    'joints': (joint_message, alter_joints, RequestReader(JointTrajectory, LEGS))}
every_kind = pytest.mark.parametrize('kind', KINDS)


@every_kind
@settings(max_examples=200)
@given(POINTS, SEEDS)
def test_bytes_and_objects_give_the_same_numbers(kind: str, points: int, seed: int) -> None:
    make, _, reader = KINDS[kind]
    message = make(points, seed)
    assert from_bytes(reader, message) == outcome(reader.of_message, message)


@every_kind
@settings(max_examples=300)
@given(POINTS, SEEDS)
def test_whatever_differs_from_the_layout_is_left_to_the_ordinary_path(
    kind: str, points: int, seed: int,
) -> None:
    make, change, reader = KINDS[kind]
    message = make(points, seed)
    change(message, np.random.default_rng(seed))
    assert outcome(reader.read, serialize_message(message)) == outcome(reader.of_message, message)


@every_kind
@settings(max_examples=200)
@given(POINTS, SEEDS)
def test_changed_bytes_give_the_ordinary_numbers_or_a_rejection(
    kind: str, points: int, seed: int,
) -> None:
    make, _, reader = KINDS[kind]
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


def test_truncated_bytes_over_dds_are_counted_and_survived() -> None:
    good = message_of(random_motion(np.random.default_rng(5), 3))
    data = bytes(serialize_message(good))
    with feedforward_bench() as node:
        answer = node.answer(data)
        for length in (12, 20, 48, 120, len(data) - 9, len(data) - 1):
            node.send(data[:length])
        counters = node.counters
        assert counters['received'] == 7
        assert counters['accepted'] == 1
        huge = bytearray(data)
        struct.pack_into('<I', huge, 44, 2**32 - 1)
        node.send(bytes(huge))
        assert node.answer(good) == answer
        assert sum(node.counters[code] for code in ('SIZE', 'EMPTY', 'NAMES', 'FRAME')) == 7


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
