# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A node that speaks to a machine takes no other robot's model for it by itself."""

from __future__ import annotations

import subprocess

import pytest
from node_bench import bench
from rclpy.parameter import Parameter
from ros_processes import environment, executable

from pprs_dynamics.errors import PprsError
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.monitor import MonitorNode

pytestmark = pytest.mark.nodes


@pytest.mark.parametrize('node', ['feedforward', 'monitor'])
def test_without_a_model_it_does_not_start_and_says_what_to_write(
    node: str, ros_domain: int,
) -> None:
    done = subprocess.run([executable(node)], env=environment(ros_domain), capture_output=True,
                          text=True, timeout=60)
    assert done.returncode == 2
    said = done.stderr.strip().splitlines()[-1]
    assert said.startswith(f'{node} was given no model')
    assert '--params-file FILE' in said
    assert 'demo:=true' in said


@pytest.mark.parametrize(('kind', 'given'), [
    (FeedforwardNode, {}), (FeedforwardNode, {'masses.payload': 2.0}),
    (MonitorNode, {'demo': False})])
def test_changes_of_the_papers_robot_are_no_model(kind: type, given: dict[str, object]) -> None:
    with bench() as running, pytest.raises(PprsError, match='given no model'):
        running.add(kind, parameter_overrides=[
            Parameter(name, value=value) for name, value in given.items()])


def test_a_demonstration_stays_one() -> None:
    with bench() as running:
        node = running.add(FeedforwardNode, parameter_overrides=[Parameter('demo', value=True)])
        answer, = node.set_parameters([Parameter('demo', value=False)])
        assert not answer.successful
