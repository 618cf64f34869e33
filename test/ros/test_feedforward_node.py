# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The feedforward node over DDS with real messages."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from feedforward_bench import EQUAL, FeedforwardBench, feedforward_bench, message_of, random_motion
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.ros.messages.status_codes import REJECTIONS

pytestmark = pytest.mark.nodes


@pytest.fixture
def feedforward() -> Iterator[FeedforwardBench]:
    with feedforward_bench() as running:
        yield running


def test_forces_equal_the_python_api(feedforward: FeedforwardBench) -> None:
    rng, model = np.random.default_rng(5), DriveModel.load()
    for count, points in enumerate((1, 1, 1, 7, 40), start=1):
        motion = random_motion(rng, points)
        expected = model.drive_forces(motion)
        found = feedforward.answer(message_of(motion))
        np.testing.assert_allclose(found, expected.total[0], rtol=0, atol=EQUAL)
        assert feedforward.bench.spin_until(
            lambda count=count: len(feedforward.joint_trajectory) == count)
        answer = feedforward.joint_trajectory[-1]
        assert tuple(answer.joint_names) == DRIVES
        state = expected.mechanism
        for name, values in (('effort', expected.total), ('positions', state.position),
                             ('velocities', state.velocity), ('accelerations', state.acceleration)):
            np.testing.assert_allclose([getattr(point, name) for point in answer.points], values,
                                       rtol=0, atol=EQUAL)


def test_joint_command_is_stamped_with_header_plus_time_from_start(
    feedforward: FeedforwardBench,
) -> None:
    stamp = Time(sec=12, nanosec=700_000_000)
    message = message_of(random_motion(np.random.default_rng(1), 2), stamp)
    message.points[0].time_from_start.nanosec = 500_000_000
    message.points[1].time_from_start.nanosec = 600_000_000
    feedforward.answer(message)
    assert feedforward.bench.spin_until(lambda: feedforward.joint_command)
    command = feedforward.joint_command[-1]
    assert (command.header.stamp.sec, command.header.stamp.nanosec) == (13, 200_000_000)
    assert tuple(command.name) == DRIVES
    assert list(command.effort) == list(feedforward.commands[-1].data)


def test_parts_are_published_while_somebody_listens_and_sum_to_the_command(
    feedforward: FeedforwardBench,
) -> None:
    running = feedforward.bench
    motion = random_motion(np.random.default_rng(2), 1)
    parts = {name: running.listen(JointState, f'/feedforward/effort/{name}')
             for name in ('rigid_body', 'active_friction', 'passive_friction')}
    assert running.spin_until(lambda: all(
        feedforward.node.count_subscribers(f'/feedforward/effort/{name}') for name in parts))
    total = feedforward.answer(message_of(motion))
    assert running.spin_until(lambda: all(parts.values()))
    np.testing.assert_allclose(
        np.sum([received[-1].effort for received in parts.values()], axis=0), total, atol=EQUAL)
    expected = DriveModel.load().drive_forces(motion).parts
    for name, received in parts.items():
        np.testing.assert_allclose(received[-1].effort, expected[name][0], rtol=0, atol=EQUAL)


# --- messages that break a rule -----------------------------------------------------------------

NAN = float('nan')
FLAT = {'translation.x': 0.3499, 'translation.y': 0.0, 'translation.z': 0.5, 'rotation.x': 0.0,
        'rotation.y': 0.0, 'rotation.z': 0.0, 'rotation.w': 1.0}
# Codes, and what a message has then, by the path of a field.
DAMAGES: list[tuple[str, dict[str, Any]]] = [
    ('EMPTY', {'points': []}), ('NAMES', {'joint_names': ['gripper']}),
    ('FRAME', {'header.frame_id': 'world'}), ('SIZE', {'points.1.velocities': []}),
    ('NON_FINITE', {'points.1.transforms.0.translation.y': NAN}),
    ('QUATERNION', {f'points.0.transforms.0.rotation.{axis}': 0.0 for axis in 'xyzw'}),
    ('TIME', {'points.1.time_from_start.nanosec': 0}),
    ('WORKSPACE', {'points.1.transforms.0.translation.x': 0.6}),
    ('WORKSPACE', {'points.0.transforms.0.translation.x': 1e308}),
    # R - A.e = 0.15 - (x + 0.1) = -0.2999 m of the rod's 0.3 m: sin u = 0.026 < 0.05.
    ('SINGULAR', {f'points.{k}.transforms.0.{key}': value for k in (0, 1)
                  for key, value in FLAT.items()}),
    ('LIMIT', {'points.1.accelerations.0.linear.z': 1000.0}),
    ('OUTPUT', {'points.0.velocities.0.angular.x': 1e300})]


def damaged(good: MultiDOFJointTrajectory, fields: dict[str, Any]) -> MultiDOFJointTrajectory:
    """Return a copy of a message with other values in some of its fields."""
    message = copy.deepcopy(good)
    for path, value in fields.items():
        *way, last = path.split('.')
        part: Any = message
        for step in way:
            part = part[int(step)] if step.isdigit() else getattr(part, step)
        setattr(part, last, value)
    return message


def test_damaged_messages_are_counted_explained_silent_and_survived(
    feedforward: FeedforwardBench,
) -> None:
    running, good = feedforward.bench, message_of(random_motion(np.random.default_rng(3), 2))
    answer = feedforward.answer(good)
    for code, fields in DAMAGES:
        counters, silent = feedforward.counters, len(feedforward.commands)
        feedforward.send(damaged(good, fields))
        expected = {**counters, 'received': counters['received'] + 1, code: counters[code] + 1}
        assert feedforward.counters == expected, fields
        assert running.spin_until(lambda code=code: running.status[-1]['code'] == code)
        assert running.status[-1]['counters'][code] >= 1
        assert running.status[-1]['level'] == 'ERROR'
        assert running.status[-1]['message']
        # Both topics come from one publisher thread: the next valid answer is the next command.
        assert feedforward.answer(good) == answer
        assert len(feedforward.commands) == silent + 1, fields
    assert all(np.isfinite(command.data).all() for command in feedforward.commands)
    # EFFECT is no message's fault: test_failing_effects.py
    assert {code for code in REJECTIONS if not feedforward.counters[code]} == {'EFFECT'}


def test_the_status_says_what_effects_with_a_memory_assume() -> None:
    effect = {'effects__active': ['hysteresis'], 'effects__hysteresis__slide_1__force': 2.0,
              'effects__hysteresis__slide_1__distance': 0.01}
    with feedforward_bench(**effect) as node:
        node.bench.follow_status('/feedforward/status')
        assert node.bench.spin_until(lambda: node.bench.status)
        assert set(node.bench.status[-1]['assumed']) == {'hysteresis'}
