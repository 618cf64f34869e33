# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The nodes with an arm and with a robot with loops: trajectories in, efforts per joint out."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from feedforward_bench import EQUAL, FeedforwardBench, feedforward_bench, message_of
from node_bench import Bench
from rclpy.parameter import Parameter
from ros_processes import executable, node_process
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint, MultiDOFJointTrajectory

from pprs_dynamics import DriveModel, JointMotion, PlatformMotion
from pprs_dynamics.physics.model.parameter_file import find_file, read_parameters

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
            'robot__urdf': str((file.parent / values['robot.urdf']).resolve()), **more}


def motion(points: int = 3, seed: int = 0) -> JointMotion:
    """Return points within the range, 10 ms apart, that do not follow from one another."""
    q, v, a = np.random.default_rng(seed).uniform(-1, 1, (3, points, 3))
    return JointMotion(q, v, a, np.arange(points) * STEP / 1e9)


def joints_message(moved: JointMotion) -> JointTrajectory:
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


def test_efforts_are_the_models_on_every_topic(node: FeedforwardBench, model: DriveModel) -> None:
    moved = motion()
    forces = model.drive_forces(moved)
    parts = {name: node.bench.listen(JointState, f'/feedforward/effort/{name}')
             for name in forces.parts}
    assert node.bench.spin_until(lambda: all(
        node.node.count_subscribers(f'/feedforward/effort/{name}') for name in parts))
    np.testing.assert_allclose(node.answer(joints_message(moved)), forces.total[0], rtol=0,
                               atol=EQUAL)
    assert node.bench.spin_until(
        lambda: node.joint_trajectory and node.joint_command and all(parts.values()))
    assert list(node.joint_trajectory[-1].joint_names) == list(arm.JOINTS)
    np.testing.assert_allclose([point.effort for point in node.joint_trajectory[-1].points],
                               forces.total, rtol=0, atol=EQUAL)
    command = node.joint_command[-1]
    assert list(command.name) == list(arm.JOINTS)
    np.testing.assert_allclose(command.position, moved.position[0], rtol=0, atol=EQUAL)
    np.testing.assert_allclose(sum(np.array(messages[-1].effort) for messages in parts.values()),
                               command.effort, rtol=0, atol=1e-9)
    status = node.wait_for_status(code='OK', level='OK')
    assert 0 < status['workspace_margin'] < 1
    assert 'singularity_margin' not in status


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
        np.testing.assert_allclose(node.answer(joints_message(moved)), effort[0], rtol=0,
                                   atol=EQUAL)
        assert node.bench.spin_until(lambda: len(currents) == 2)
        np.testing.assert_allclose(currents[0].data, effort[0] / gain, rtol=0, atol=EQUAL)
        assert list(currents[1].data) == [0.0] * 3  # the timeout's action reaches it, too
        tight = np.full(3, LIMIT)
        tight[1] = np.abs(effort[:, 1]).max() * 0.9
        result, = node.node.set_parameters([Parameter('effort_limits', value=tight.tolist())])
        assert result.successful
        node.send(joints_message(moved))
        assert 'swing needs' in (said := node.wait_for_status(code='LIMIT')['message'])
        assert ' N m, ' in said or ' N, ' in said
        assert len(currents) == 2
    with feedforward_bench(JointTrajectory, **parameters(file)) as node:
        topics = [publisher.topic_name for publisher in node.node.publishers]
        assert '/feedforward/commands' in topics
        assert '/feedforward/current' not in topics


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
            publisher.publish(joints_message(moved[k:k + 1].with_time([0.0])))
        assert running.spin_until(lambda: len(commands) == len(moved)), running.status[-1]
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
    np.testing.assert_allclose([sent.data for sent in commands], model.drive_forces(moved).total,
                               rtol=0, atol=EQUAL)


# The nodes with a robot with loops: trajectories of its drives or of its tool in, efforts out.

HEXAPOD = 'config/hexapod.yaml'


def poses(rng: np.random.Generator, points: int = 1) -> PlatformMotion:
    """Return poses about home that move, and do not follow from one another."""
    return PlatformMotion(
        np.array([0.0, 0.0, 0.45]) + rng.uniform(-0.02, 0.02, (points, 3)),
        Rotation.from_rotvec(rng.uniform(-0.1, 0.1, (points, 3))).as_quat(),
        *(rng.normal(scale=0.5, size=(points, 3)) for _ in range(4)), np.arange(points) * 0.01)


def test_poses_of_the_tool_are_answered_or_refused_as_those_of_a_platform() -> None:
    model, motion = DriveModel.load(HEXAPOD), poses(np.random.default_rng(4), 3)
    forces = model.drive_forces(motion)
    with feedforward_bench(MultiDOFJointTrajectory, 'pose_trajectory',
                           **parameters(find_file(HEXAPOD))) as node:
        np.testing.assert_allclose(node.answer(message_of(motion)), forces.total[0], rtol=0,
                                   atol=EQUAL)
        assert node.bench.spin_until(lambda: node.joint_trajectory)
        np.testing.assert_allclose([point.positions for point in node.joint_trajectory[-1].points],
                                   forces.mechanism.position, rtol=0, atol=EQUAL)
        status = node.wait_for_status(code='OK')
        assert 0.9 < status['singularity_margin'] < 1
        assert 0 < status['workspace_margin'] < 1
        twisted = Rotation.from_rotvec([[0.0, 0.0, 1.7]]).as_quat()
        at_home = [[0.0, 0.0, 0.45]]
        for code, wrong, said in (
            ('WORKSPACE', message_of(PlatformMotion.at_rest([[0.0, 0.0, 0.85]])), 'leg_1'),
            ('WORKSPACE', message_of(PlatformMotion.at_rest([[0.0, 0.0, 400.0]])), 'reach'),
            ('SINGULAR', message_of(PlatformMotion.at_rest(at_home, twisted)), 'singularity'),
            ('NAMES', MultiDOFJointTrajectory(joint_names=['rod_1'], points=message_of(
                motion).points), 'platform'),
        ):
            before, counted = len(node.commands), node.counters[code]
            node.send(wrong)
            assert node.bench.spin_until(lambda said=said: said in node.bench.status[-1]['message'])
            assert node.counters[code] == counted + 1
            assert len(node.commands) == before
        near = Rotation.from_rotvec([[0.0, 0.0, 1.4]]).as_quat()
        answer, = node.node.set_parameters([Parameter('warning_margin', value=0.99)])
        assert answer.successful
        node.bench.spin_for(0.02)  # margins are computed 100 times a second
        node.send(message_of(PlatformMotion.at_rest(at_home, near)))
        assert node.wait_for_status(code='NEAR_SINGULAR')['singularity_margin'] < 0.99
