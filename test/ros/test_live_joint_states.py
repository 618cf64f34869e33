# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the workbench hears of a running robot, and what it must survive."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from node_bench import LATCHED, Bench, bench
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from pprs_dynamics import DriveModel
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros.live_joint_states import LiveJointStates, LiveNodes
from pprs_dynamics.ros.messages import conversions

pytestmark = pytest.mark.nodes

MODEL = DriveModel.load()


@pytest.fixture
def running() -> Iterator[tuple[Bench, Any]]:
    with bench() as made:
        yield made, made.add(lambda **options: LiveJointStates(
            MODEL, 'joint_states', 'monitor', 'feedforward', **options))


def test_what_is_no_message_of_the_monitor_is_passed_over(running: tuple[Bench, Any]) -> None:
    bench, node = running
    error, diagnosis = (bench.probe.create_publisher(kind, topic, qos) for kind, topic, qos in (
        (Float64MultiArray, '/monitor/error', 10), (String, '/monitor/diagnosis', LATCHED)))
    assert bench.spin_until(error.get_subscription_count)
    assert bench.spin_until(diagnosis.get_subscription_count)
    for data in (b'\x00\x01\x00\x00\xff\xff\xff\xff', bytes(serialize_message(
            Float64MultiArray(data=[1.0, 2.0])))[:-6]):
        error.publish(data)
    for data in (b'\x00\x01\x00\x00\x02\x00\x00\x00\xff\x00', b'\x00\x01\x00\x00\x09\x00\x00\x00a',
                 String(data='[1]'), String(data='no JSON'),
                 String(data=json.dumps({'since': float('nan'), 'effects': []}))):
        diagnosis.publish(data)
    error.publish(Float64MultiArray(data=[3.0, 4.0]))
    assert bench.spin_until(lambda: node.to_dict()['monitor_error'] == [3.0, 4.0])
    assert bench.spin_until(lambda: node.to_dict()['diagnosis'] == {'since': None, 'effects': []})


@pytest.mark.parametrize('comes', ['before', 'after'])
def test_joint_states_of_a_best_effort_publisher_are_heard(comes: str) -> None:
    """A driver over a network publishes best effort, which who asks for more never receives."""
    message = conversions.joint_state(0, np.zeros(6), np.zeros(6), np.zeros(6))
    with bench() as running:
        def publish() -> Any:
            return running.probe.create_publisher(JointState, '/joint_states', QoSProfile(
                depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))

        early = publish() if comes == 'before' else None
        node: Any = running.add(lambda **options: LiveJointStates(
            MODEL, 'joint_states', 'monitor', 'feedforward', **options))
        publisher = early or publish()
        assert running.spin_until(publisher.get_subscription_count)
        assert running.spin_until(lambda: publisher.publish(message) or node.to_dict()['received'])


def test_remapping_prefix_and_qos_come_from_the_command_line(ros_domain: int) -> None:
    message = conversions.joint_state(0, np.zeros(6), np.zeros(6), np.zeros(6))
    message.name = [f'left_{name}' for name in message.name]
    with bench() as running:
        publisher = running.probe.create_publisher(JointState, '/cell/joint_states', 10)
        nodes = LiveNodes(MODEL, arguments=[
            '--ros-args', '-r', 'joint_states:=/cell/joint_states', '-p', 'joint_prefix:=left_',
            '-p', 'qos_overrides./cell/joint_states.subscription.reliability:=reliable'])
        try:
            assert running.spin_until(publisher.get_subscription_count)
            info, = running.probe.get_subscriptions_info_by_topic('/cell/joint_states')
            assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
            assert running.spin_until(
                lambda: publisher.publish(message) or nodes.to_dict()['age'] is not None)
        finally:
            nodes.close()


def test_a_simulation_at_half_speed_is_compared_in_its_own_time(ros_domain: int) -> None:
    began, path = time.monotonic(), HelicalPath()
    with bench() as running:
        clock = running.probe.create_publisher(Clock, '/clock', 10)
        states = running.probe.create_publisher(JointState, '/joint_states', 100)
        nodes = LiveNodes(MODEL, arguments=['--ros-args', '-p', 'use_sim_time:=true'])

        def publish() -> None:
            passed = 0.5 * (time.monotonic() - began)
            now = round((100.0 + passed) * 1e9)
            clock.publish(Clock(clock=conversions.time(now)))
            forces = MODEL.drive_forces(path.motion([passed % path.duration]))
            position, velocity, _ = forces.drive_motion
            states.publish(conversions.joint_state(now, forces.total[0], position[0], velocity[0]))

        timer = running.probe.create_timer(0.005, publish)
        try:
            assert running.spin_until(lambda: len(nodes.to_dict()['time']) > 100)
            found = nodes.to_dict()
            assert found['trouble'] == ''
            # Half as many seconds have passed as on the wall; at that speed the forces agree.
            assert found['kept'] < 0.6 * (time.monotonic() - began)
            size = np.std(MODEL.drive_forces(path.motion(np.arange(0.0, 2.0, 0.01))).total, axis=0)
            assert (np.array(found['error'], dtype=float) < 0.1 * size).all()
        finally:
            timer.cancel()
            nodes.close()
