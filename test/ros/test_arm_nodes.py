# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The nodes with an arm's model file: joint trajectories in, efforts per joint out."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from feedforward_bench import EQUAL, FeedforwardBench, feedforward_bench
from node_bench import LATCHED, Bench, bench, overrides
from rclpy.parameter import Parameter
from ros_processes import executable, node_process
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.physics.model.parameter_file import read_parameters
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.monitor import MonitorNode

pytestmark = pytest.mark.nodes

ORDER = (2, 0, 1)  # joints are matched by name, in any order
LIMIT = 200.0  # of the URDF [N m, N]
TIMEOUT = 0.15  # [s]
FRICTION = {key.replace('.', '__'): list(value) for key, value in arm.FRICTION.items()}
STEP = 10_000_000  # [ns] between points


@pytest.fixture(scope='module')
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return arm.write_arm(tmp_path_factory.mktemp('arm'), **FRICTION)


@pytest.fixture(scope='module')
def model(file: Path) -> DriveModel:
    return DriveModel.load(file)


def parameters(file: Path, **more: Any) -> dict[str, Any]:
    """Return the file's parameters as a bench takes them."""
    values = read_parameters(file)
    return {**{name.replace('.', '__'): value for name, value in values.items()},
            'robot__urdf': str(file.parent / values['robot.urdf']), **more}


def motion(points: int = 3, seed: int = 0) -> JointMotion:
    """Return points within the range, 10 ms apart, that do not follow from one another."""
    q, v, a = np.random.default_rng(seed).uniform(-1, 1, (3, points, 3))
    return JointMotion(q, v, a, np.arange(points) * STEP / 1e9)


def message_of(moved: JointMotion) -> JointTrajectory:
    message = JointTrajectory(joint_names=[arm.JOINTS[k] for k in ORDER])
    for k in range(len(moved)):
        rows = [values[k, list(ORDER)].tolist()
                for values in (moved.position, moved.velocity, moved.acceleration)]
        message.points.append(JointTrajectoryPoint(
            positions=rows[0], velocities=rows[1], accelerations=rows[2],
            time_from_start=Duration(nanosec=k * STEP)))
    return message


@pytest.fixture
def node(file: Path) -> Iterator[FeedforwardBench]:
    with feedforward_bench(JointTrajectory, **parameters(file)) as running:
        yield running


def test_efforts_are_the_models_on_every_topic(
    node: FeedforwardBench, model: DriveModel,
) -> None:
    moved = motion()
    forces = model.drive_forces(moved)
    parts = {name: node.bench.listen(JointState, f'/feedforward/effort/{name}')
             for name in forces.parts}
    assert node.bench.spin_until(lambda: all(
        node.node.count_subscribers(f'/feedforward/effort/{name}') for name in parts))
    np.testing.assert_allclose(node.answer(message_of(moved)), forces.total[0], rtol=0, atol=EQUAL)
    assert node.bench.spin_until(
        lambda: node.joint_trajectory and node.joint_command and all(parts.values()))
    assert list(node.joint_trajectory[-1].joint_names) == list(arm.JOINTS)
    np.testing.assert_allclose([point.effort for point in node.joint_trajectory[-1].points],
                               forces.total, rtol=0, atol=EQUAL)
    command = node.joint_command[-1]
    assert list(command.name) == list(arm.JOINTS)
    np.testing.assert_allclose(command.position, moved.position[0], rtol=0, atol=EQUAL)
    np.testing.assert_allclose(sum(np.array(each[-1].effort) for each in parts.values()),
                               command.effort, rtol=0, atol=1e-9)
    status = node.wait_for_status(code='OK', level='OK')
    assert 0 < status['workspace_margin'] < 1
    assert 'singularity_margin' not in status
    assert status['taken_from_paper'] == []


RULES: list[tuple[str, dict[str, Any], str]] = [
    ('EMPTY', {'points': []}, 'at least 1'),
    ('NAMES', {'joint_names': ['turn', 'swing']}, 'reach'),
    ('NAMES', {'joint_names': ['turn', 'swing', 'reach', 'gripper']}, 'nothing else'),
    ('NAMES', {'joint_names': ['turn', 'turn', 'reach']}, 'once'),
    ('SIZE', {'positions': [0.0, 0.0]}, 'point 1 has 2 positions, must have 3'),
    ('SIZE', {'accelerations': []}, 'point 1 has 0 accelerations, must have 3'),
    ('NON_FINITE', {'velocities': [0.0, float('nan'), 0.0]}, 'velocity'),
    ('TIME', {'time_from_start': Duration(sec=-1)}, 'strictly increase'),
    ('WORKSPACE', {'positions': [0.0, 3.5, 0.0]}, 'turn would have to be at 3.5 rad'),
    ('LIMIT', {'accelerations': [900.0, 0.0, 0.0]}, 'N, the effort limit of URDF or node allows'),
    ('OUTPUT', {'velocities': [1e300, 1e300, 1e300]}, 'not finite'),
]


def test_parameters_change_between_messages_and_what_is_no_arm_is_refused(
    node: FeedforwardBench, model: DriveModel,
) -> None:
    moved = motion(1, 7)
    before = np.array(node.answer(message_of(moved)))
    steps = (('effects.payload_mass.mass', 0.8), ('effects.active', ['payload_mass']))
    for name, value in steps:
        result, = node.node.set_parameters([Parameter(name, value=value)])
        assert result.successful, result.reason
    loaded = DriveModel.from_parameters({**model.values, **dict(steps)}, model.source)
    np.testing.assert_allclose(node.answer(message_of(moved)),
                               loaded.drive_forces(moved).total[0], rtol=0, atol=EQUAL)
    for name, value, said in (('friction.viscous', [1.0, 2.0], 'friction.viscous'),
                              ('robot.urdf', '/nowhere.urdf', '/nowhere.urdf'),
                              ('robot.drives', ['swing', 'turn', 'reach'], 'when the node started'),
                              ('geometry.rod_length', 0.3, 'geometry.rod_length')):
        result, = node.node.set_parameters([Parameter(name, value=value)])
        assert not result.successful
        assert said in result.reason
    result, = node.node.set_parameters(
        [Parameter('effects.active', Parameter.Type.STRING_ARRAY, [])])
    assert result.successful, result.reason
    np.testing.assert_allclose(node.answer(message_of(moved)), before, rtol=0, atol=EQUAL)


def test_currents_have_a_topic_of_their_own_and_efforts_stay_efforts(
    file: Path, model: DriveModel,
) -> None:
    gain, moved = np.array([10.0, 5.0, 40.0]), motion(2, 4)
    effort = model.drive_forces(moved).total
    with feedforward_bench(JointTrajectory, **parameters(
            file, robot__gain=gain.tolist(), robot__effort_unit='A', command_timeout=TIMEOUT,
            timeout_action='zero')) as node:
        currents = node.bench.listen(Float64MultiArray, '/feedforward/current', 1000)
        assert node.bench.connected()
        np.testing.assert_allclose(node.answer(message_of(moved)), effort[0], rtol=0, atol=EQUAL)
        assert node.bench.spin_until(lambda: len(currents) == 2)
        np.testing.assert_allclose(currents[0].data, effort[0] / gain, rtol=0, atol=EQUAL)
        assert list(currents[1].data) == [0.0] * 3  # the timeout's action reaches it, too
        tight = np.full(3, LIMIT)
        tight[1] = np.abs(effort[:, 1]).max() * 0.9
        result, = node.node.set_parameters([Parameter('effort_limits', value=tight.tolist())])
        assert result.successful
        node.send(message_of(moved))
        assert 'swing needs' in (said := node.wait_for_status(code='LIMIT')['message'])
        assert ' N m, ' in said or ' N, ' in said
        assert len(currents) == 2
    with feedforward_bench(JointTrajectory, **parameters(file)) as node:
        topics = [each.topic_name for each in node.node.publishers]
        assert '/feedforward/commands' in topics
        assert '/feedforward/current' not in topics


@pytest.fixture
def running() -> Iterator[Bench]:
    with bench() as probe:
        yield probe


def test_the_executable_takes_an_arms_file_and_finds_the_urdf_beside_it(
    running: Bench, ros_domain: int, file: Path, model: DriveModel, tmp_path: Path,
) -> None:
    commands = running.listen(Float64MultiArray, '/feedforward/commands', 1000)
    running.follow_status('/feedforward/status')
    publisher = running.probe.create_publisher(JointTrajectory, '/feedforward/trajectory', 100)
    moved = motion(5, 1)
    # Started in another folder than the file's.
    with node_process([executable('feedforward'), '--ros-args', '--params-file', str(file),
                       '-p', 'command_timeout:=0.0', '-p', 'timeout_action:=silent',
                       '-p', 'max_age:=0.0'], ros_domain, tmp_path / 'log') as process:
        assert running.connected()
        assert running.spin_until(publisher.get_subscription_count)
        for k in range(len(moved)):
            publisher.publish(message_of(moved[k:k + 1].with_time([0.0])))
        assert running.spin_until(lambda: len(commands) == len(moved)), running.status[-1]
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0
    np.testing.assert_allclose([one.data for one in commands], model.drive_forces(moved).total,
                               rtol=0, atol=EQUAL)


def test_two_nodes_in_one_process_each_have_their_own_files(tmp_path: Path) -> None:
    """A relative URDF counts from the file of its node, not from that of the other."""
    interval = sys.getswitchinterval()
    with bench() as running:
        for name in ('left', 'right'):
            (tmp_path / name).mkdir()
            given = arm.write_arm(tmp_path / name, **FRICTION)
            node: Any = running.add(FeedforwardNode, namespace=name, cli_args=[
                '--ros-args', '--params-file', str(given)])
            assert node.get_parameter('robot.urdf').value == str(given.with_name('made_up.urdf'))
            status: list[Any] = []
            running.probe.create_subscription(
                String, f'/{name}/feedforward/status',
                lambda message, status=status: status.append(json.loads(message.data)), LATCHED)
            assert running.spin_until(lambda status=status: status)
            assert status[-1]['model']['files'][0]['file'] == str(given)
    assert sys.getswitchinterval() == interval


def test_the_monitor_tells_what_the_model_of_an_arm_lacks(
    running: Bench, file: Path, model: DriveModel,
) -> None:
    gain = np.array([10.0, 5.0, 40.0])
    values = parameters(file, robot__gain=gain.tolist(), robot__effort_unit='A', error_span=1.0)
    node = running.add(MonitorNode, parameter_overrides=overrides(**values))
    residual = running.listen(JointState, '/monitor/residual', 1000)
    error = running.listen(Float64MultiArray, '/monitor/error', 1000)
    running.follow_status('/monitor/status')
    publisher = running.probe.create_publisher(JointState, '/joint_states', 1000)
    assert running.spin_until(publisher.get_subscription_count)
    assert running.connected()
    moved = arm.motion(6.0, 200.0)
    lacking = np.array([0.0, 3.0, 0.0])  # [N m] that the model does not know of
    current = (model.drive_forces(moved).total + lacking) / gain
    for row in range(len(moved)):
        names = [arm.JOINTS[k] for k in ORDER]
        message = JointState(name=names, position=moved.position[row, list(ORDER)].tolist(),
                             effort=current[row, list(ORDER)].tolist())
        message.header.stamp = conversions.time(1_700_000_000_000_000_000 + row * 5_000_000)
        publisher.publish(message)
        if row % 20 == 0:
            assert running.spin_until(lambda row=row: node._counters['received'] > row)
    assert running.spin_until(lambda: len(residual) > 1100)
    assert tuple(residual[-1].name) == arm.JOINTS
    # Smoothing over 0.12 s blurs where friction turns over: 12 N m and 18 N within milliseconds.
    np.testing.assert_allclose(
        np.nanmedian([one.effort for one in residual], axis=0), lacking, rtol=0, atol=0.1)
    assert error[-1].data[1] > 2
    assert running.spin_until(lambda: 'N or N m' in running.status[-1]['message'])
