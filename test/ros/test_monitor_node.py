# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The monitor over DDS: joint_states in, model effort, residual and running error out."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import checked
from monitor_bench import RATE, START, MonitorBench
from node_bench import bench, overrides
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from ros_processes import executable, node_process
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.monitor import MonitorNode
from pprs_dynamics.ros.node.qos import LATCHED

pytestmark = pytest.mark.nodes

# What smoothing over 0.12 s leaves of exact positions below 0.6 Hz, most of it where friction
# turns over within a millimetre per second.
RECONSTRUCTION = 0.01  # [N]
OFFSET = 0.5  # [N]


@pytest.fixture
def monitor() -> Iterator[MonitorBench]:
    with bench() as running:
        yield MonitorBench(running)


def stamps(messages: list[JointState]) -> list[int]:
    return [conversions.nanoseconds(message.header.stamp) for message in messages]


def test_a_model_that_explains_the_robot_leaves_nothing(monitor: MonitorBench) -> None:
    monitor.send(1500)
    assert len(monitor.residual) == len(monitor.model_effort) > 1300
    residual = np.array([message.effort for message in monitor.residual])
    assert np.sqrt(np.mean(residual ** 2, axis=0)).max() < RECONSTRUCTION
    # At the measured stamps: each answer is the effort sent with that stamp, minus the residual.
    rows = (np.array(stamps(monitor.model_effort)) - START) * RATE // 1_000_000_000
    assert np.all(np.diff(rows) == 1)
    model = np.array([message.effort for message in monitor.model_effort])
    np.testing.assert_allclose(model + residual, monitor.effort[rows], rtol=0, atol=1e-9)
    assert tuple(monitor.residual[0].name) == DRIVES
    assert max(monitor.error[-1].data) < RECONSTRUCTION


def test_what_the_model_lacks_is_the_residual_and_falls_when_it_is_added(
    monitor: MonitorBench,
) -> None:
    change = np.array([0, 0, 0, 0, OFFSET, 0])
    monitor.send(900, change)
    np.testing.assert_allclose(monitor.error[-1].data, change, atol=RECONSTRUCTION)
    for name, value in (('effects.effort_offset.lift_2.force', OFFSET),
                        ('effects.active', ['effort_offset'])):
        result, = monitor.node.set_parameters([Parameter(name, value=value)])
        assert result.successful, result.reason
    monitor.send(600, change)
    assert max(monitor.error[-1].data) < RECONSTRUCTION


def test_an_effort_that_is_not_a_number_is_no_measurement(monitor: MonitorBench) -> None:
    monitor.send(600)
    monitor.effort[600:900, 2] = np.nan
    monitor.send(500)
    residual = np.array([message.effort for message in monitor.residual])
    assert np.isnan(residual[:, 2]).sum() == 300
    assert np.isfinite(np.delete(residual, 2, axis=1)).all()
    assert np.isfinite(monitor.error[-1].data).all()
    assert np.isfinite([message.effort for message in monitor.model_effort]).all()


def status_of(sha256: str) -> str:
    """Return what a node that drives says of itself and its model."""
    return json.dumps({'robot': '3-PPRS', 'model': {'files': [], 'sha256': sha256}, 'changes': 0})


def test_a_feedforward_of_another_model_is_told(monitor: MonitorBench) -> None:
    publisher = monitor.bench.probe.create_publisher(String, '/feedforward/status', LATCHED)
    own = DriveModel.load().fingerprint
    for sha256, code in (('0' * 64, 'MODEL'), (own, 'OK')):
        publisher.publish(String(data=status_of(sha256)))
        monitor.bench.spin_for(0.3)
        monitor.send(400)
        assert monitor.says(code)
    publisher.publish(String(data=status_of('0' * 64)))
    monitor.send(300)
    assert f'sha256 {12 * "0"}, not {own[:12]}' in monitor.bench.status[-1]['message']
    monitor.bench.probe.destroy_publisher(publisher)  # nothing drives any more
    assert monitor.bench.spin_until(
        lambda: not monitor.node.count_publishers('/feedforward/status'))
    monitor.send(300)
    assert monitor.says('OK')


def test_messages_that_are_no_joint_states_of_this_robot_are_counted_and_survived(
    monitor: MonitorBench,
) -> None:
    good = conversions.joint_state(START, monitor.effort[0], monitor.position[0],
                                   monitor.position[0])
    for code, change in (('NAMES', {'name': ['a', 'b']}), ('SIZE', {'position': [0.0] * 5}),
                         ('NON_FINITE', {'position': [float('inf')] * 6})):
        message = JointState(name=good.name, position=good.position, effort=good.effort)
        for field, value in change.items():
            setattr(message, field, value)
        monitor.publish(message)
        assert monitor.says(code)
        assert monitor.bench.status[-1]['counters'][code] == 1
    monitor.send(300)
    assert monitor.says('OK')


def test_all_joints_are_published_while_somebody_draws_them(monitor: MonitorBench) -> None:
    monitor.send(100)
    joints = monitor.bench.listen(JointState, '/monitor/joint_states_full', 1000)
    assert monitor.bench.connected()
    # Beside the node; compilers take their time where nothing is compiled yet.
    for _ in range(60):
        monitor.send(20)
        if joints:
            break
        monitor.bench.spin_for(1.0)
    found = dict(zip(joints[-1].name, joints[-1].position, strict=True))
    assert {'hinge_1', 'hinge_2', 'hinge_3', *DRIVES} <= set(found)
    row = (stamps(joints)[-1] - START) * RATE // 1_000_000_000
    assert [found[drive] for drive in DRIVES] == pytest.approx(monitor.position[row])


@pytest.mark.parametrize(('reliability', 'stamped', 'code'), [
    (ReliabilityPolicy.BEST_EFFORT, True, 'OK'), (ReliabilityPolicy.RELIABLE, True, 'OK'),
    (ReliabilityPolicy.RELIABLE, False, 'TIME')], ids=['best effort', 'reliable', 'stamp of 0'])
def test_a_process_compares_or_warns_with_the_reason(
    ros_domain: int, tmp_path: Path, reliability: ReliabilityPolicy, stamped: bool, code: str,
) -> None:
    motion = Excitation(20.0, seed=3).motion(np.arange(0, 20.0, 0.02))
    forces = DriveModel.load().drive_forces(motion)
    with bench() as running:
        running.follow_status('/monitor/status')
        publisher = running.probe.create_publisher(
            JointState, '/joint_states', QoSProfile(depth=10, reliability=reliability))
        command = [executable('monitor'), '--ros-args', '-p', 'demo:=true']
        with node_process(command, ros_domain, tmp_path / 'log') as process:
            assert running.spin_until(publisher.get_subscription_count)
            for row in range(len(motion)):
                publisher.publish(conversions.joint_state(
                    START + row * 20_000_000 if stamped else 0, forces.total[row],
                    forces.mechanism.position[row], forces.mechanism.velocity[row]))
                running.spin_for(0.02)
                if row > 50 and running.status[-1]['code'] == code:
                    break
            status = running.status[-1]
            assert process.poll() is None
        assert status['code'] == code
        assert status['level'] == ('OK' if stamped else 'WARN')
        if stamped:
            assert status['counters']['compared'] > 0
        else:
            assert 'header.stamp of /joint_states stays at 0 s' in status['message']


def test_a_monitor_that_hears_nothing_or_no_efforts_warns(monitor: MonitorBench) -> None:
    assert monitor.bench.spin_until(lambda: monitor.bench.status[-1]['level'] == 'WARN')
    assert 'no joint states on /joint_states' in monitor.bench.status[-1]['message']
    assert 'publishers: /probe' in monitor.bench.status[-1]['message']
    monitor.send(300)
    assert monitor.says('OK')
    monitor.effort[:] = np.nan
    for _ in range(20):  # for longer than the monitor waits, however fast the samples go
        monitor.send(50)
    assert monitor.says('WAITING')
    assert 'efforts are not measured' in monitor.bench.status[-1]['message']


# Messages on the topics of a node that no node of this package sends: none ends the node.

FOREIGN = [  # on the status topic of the node that drives
    'no JSON', 'null', '[]', '{}', '{"model": "x"}', '{"model": null, "changes": 1}',
    '{"model": {"sha256": 3, "files": [1]}, "robot": "r", "changes": 0}',
    '{"model": {"sha256": "a", "files": []}, "robot": "r", "changes": 1e999}',
    '{"model": {"sha256": "a", "files": []}, "robot": "r", "changes": null}']


def test_a_status_of_another_program_does_not_end_the_monitor(monitor: MonitorBench) -> None:
    publisher = monitor.bench.probe.create_publisher(String, '/feedforward/status', LATCHED)
    assert monitor.bench.spin_until(publisher.get_subscription_count)
    for text in FOREIGN:
        publisher.publish(String(data=text))
        monitor.bench.spin_for(0.02)
    monitor.send(100)
    assert monitor.says('OK')
    publisher.publish(bytes(serialize_message(String(data='cut off')))[:-3])
    model = {'sha256': 'another', 'files': [{'file': '/somewhere/robot.yaml'}]}
    publisher.publish(String(data=json.dumps({'robot': 'r', 'model': model, 'changes': 2})))
    monitor.bench.spin_for(0.2)
    monitor.send(100)
    assert monitor.says('MODEL')
    assert '(sha256 another, not ' in monitor.bench.status[-1]['message']


# The monitor says what changed on the running robot, over topics, and it is adopted.

STATES_RATE, SPAN = 100, 10.0  # [Hz, s]
BEGUN = 1_700_000_000_000_000_000  # [ns]
CHANGE, NOISE = 1.0, 0.05  # [N]
PATIENCE = 180.0  # [s] for a diagnosis on a busy machine


@pytest.mark.slow
def test_a_change_is_told_within_two_windows() -> None:
    model = DriveModel.load()
    motion = Excitation(5 * SPAN, seed=4).motion(np.arange(0, 5 * SPAN, 1 / STATES_RATE))
    forces = model.drive_forces(motion)
    position, effort = forces.mechanism.position, forces.total
    effort = effort + NOISE * np.random.default_rng(0).standard_normal(effort.shape)
    effort[round(1.05 * SPAN * STATES_RATE):, 3] += CHANGE  # with the second window
    with bench() as running:
        node = running.add(MonitorNode, parameter_overrides=overrides(
            diagnose_every=SPAN, diagnose_span=SPAN))
        feedforward = running.add(FeedforwardNode, parameter_overrides=overrides())
        told = running.listen(String, '/monitor/diagnosis', LATCHED)
        running.follow_status('/monitor/status')
        states = running.probe.create_publisher(JointState, '/joint_states', 1000)
        assert running.spin_until(states.get_subscription_count)
        assert running.connected()
        sent = 0

        def send(rows: int) -> None:
            nonlocal sent
            for row in range(sent, sent + rows):
                states.publish(conversions.joint_state(
                    BEGUN + row * 10**9 // STATES_RATE, effort[row], position[row], np.zeros(6)))
                running.executor.spin_once(timeout_sec=0.0)
            sent += rows

        for number in range(1, 5):
            send(round(SPAN * STATES_RATE) + 5)
            assert running.spin_until(lambda n=number: len(told) >= n, PATIENCE), number
        first, second, _, fourth = (checked(message.data, 'diagnosis') for message in told[:4])
        assert first['effects'] == []
        assert first['confirmed'] is False
        assert second['confirmed'] is False  # one window alone is a hypothesis
        assert fourth['confirmed'] is True, fourth
        assert fourth['effects'][0]['drives'] == ['lift_1']
        assert fourth['since'] == pytest.approx(BEGUN / 1e9 + 1.05 * SPAN, abs=1.5)
        assert 'lift_1' in fourth['text']
        send(200)
        assert running.spin_until(lambda: running.status[-1]['code'] == 'CHANGED', 20.0)
        assert running.status[-1]['level'] == 'WARN'
        # A person adopts it: the node that drives takes it, and the monitor follows.
        adopting = running.probe.create_client(Trigger, '/monitor/adopt_confirmed')
        assert running.spin_until(adopting.service_is_ready)
        future = adopting.call_async(Trigger.Request())
        assert running.spin_until(future.done, 20.0)
        assert future.result().success, future.result().message

        def offset(owner: Any) -> float:
            name = 'effects.effort_offset.lift_1.force'
            return float(owner.get_parameter(name).value) if owner.has_parameter(name) else 0.0
        assert running.spin_until(lambda: abs(offset(node) - CHANGE) < 0.2, 20.0)
        assert offset(feedforward) == offset(node)
