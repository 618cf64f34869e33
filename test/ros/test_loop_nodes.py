# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The feedforward node with a robot with loops: trajectories of the drives in, efforts out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from feedforward_bench import EQUAL, FeedforwardBench, feedforward_bench
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pprs_dynamics import ArmModel, JointMotion
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


def message_of(model: ArmModel, position: np.ndarray) -> JointTrajectory:
    zero = np.zeros(len(position)).tolist()
    return JointTrajectory(joint_names=list(model.drives), points=[JointTrajectoryPoint(
        positions=position.tolist(), velocities=zero, accelerations=zero,
        time_from_start=Duration())])


def test_efforts_are_the_models_and_what_cannot_be_is_refused(node: FeedforwardBench) -> None:
    model = ArmModel.load(FILE)
    home = model.robot.structure.home[model.robot.structure.tables.drives]
    near = home + 0.01 * np.arange(6)
    rest = np.zeros((1, 6))
    expected = model.drive_forces(JointMotion(near[None], rest, rest, np.zeros(1))).total[0]
    np.testing.assert_allclose(node.answer(message_of(model, near)), expected, rtol=0, atol=EQUAL)
    # Within every leg's stroke, and beyond what six legs can reach together.
    far = np.array([0.41, 0.655, 0.41, 0.655, 0.41, 0.655])
    with pytest.raises(WorkspaceError):
        model.drive_forces(JointMotion(far[None], rest, rest, np.zeros(1)))
    node.send(message_of(model, far))
    node.wait_for_status(code='WORKSPACE')
    assert node.counters['WORKSPACE'] == 1
