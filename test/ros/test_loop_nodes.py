# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The nodes with a robot with loops: trajectories of its drives or of its tool in, efforts out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from feedforward_bench import EQUAL, FeedforwardBench, feedforward_bench, message_of
from rclpy.parameter import Parameter
from scipy.spatial.transform import Rotation
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint, MultiDOFJointTrajectory

from pprs_dynamics import DriveModel, JointMotion, PlatformMotion
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.physics.model.parameter_file import find_file, read_parameters

pytestmark = pytest.mark.nodes

FILE = 'config/hexapod.yaml'


def parameters() -> dict[str, Any]:
    """Return the file's parameters as a bench takes them."""
    file = find_file(FILE)
    values = read_parameters(file)
    return {**{name.replace('.', '__'): value for name, value in values.items()},
            'robot__urdf': str((file.parent / values['robot.urdf']).resolve())}


@pytest.fixture
def node() -> Iterator[FeedforwardBench]:
    with feedforward_bench(JointTrajectory, **parameters()) as running:
        yield running


def drives_message(model: DriveModel, position: np.ndarray) -> JointTrajectory:
    zero = np.zeros(len(position)).tolist()
    return JointTrajectory(joint_names=list(model.drives), points=[JointTrajectoryPoint(
        positions=position.tolist(), velocities=zero, accelerations=zero,
        time_from_start=Duration())])


def test_efforts_are_the_models_and_what_cannot_be_is_refused(node: FeedforwardBench) -> None:
    model = DriveModel.load(FILE)
    home = model.robot.structure.home[model.robot.structure.tables.drives]
    near = home + 0.01 * np.arange(6)
    rest = np.zeros((1, 6))
    expected = model.drive_forces(JointMotion(near[None], rest, rest, np.zeros(1))).total[0]
    np.testing.assert_allclose(node.answer(drives_message(model, near)), expected, rtol=0,
                               atol=EQUAL)
    # Within every leg's stroke, and beyond what six legs can reach together.
    far = np.array([0.41, 0.655, 0.41, 0.655, 0.41, 0.655])
    with pytest.raises(WorkspaceError):
        model.drive_forces(JointMotion(far[None], rest, rest, np.zeros(1)))
    node.send(drives_message(model, far))
    node.wait_for_status(code='WORKSPACE')
    assert node.counters['WORKSPACE'] == 1


def poses(rng: np.random.Generator, points: int = 1) -> PlatformMotion:
    """Return poses about home that move, and do not follow from one another."""
    return PlatformMotion(
        np.array([0.0, 0.0, 0.45]) + rng.uniform(-0.02, 0.02, (points, 3)),
        Rotation.from_rotvec(rng.uniform(-0.1, 0.1, (points, 3))).as_quat(),
        *(rng.normal(scale=0.5, size=(points, 3)) for _ in range(4)), np.arange(points) * 0.01)


def test_poses_of_the_tool_are_answered_or_refused_as_those_of_a_platform() -> None:
    model, motion = DriveModel.load(FILE), poses(np.random.default_rng(4), 3)
    forces = model.drive_forces(motion)
    with feedforward_bench(MultiDOFJointTrajectory, 'pose_trajectory', **parameters()) as node:
        np.testing.assert_allclose(node.answer(message_of(motion)), forces.total[0], rtol=0,
                                   atol=EQUAL)
        assert node.bench.spin_until(lambda: node.joint_trajectory)
        np.testing.assert_allclose([each.positions for each in node.joint_trajectory[-1].points],
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
