# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the running feedforward node, set over DDS as `ros2 param set` does."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from feedforward_bench import EQUAL, FeedforwardBench, feedforward_bench, message_of, random_motion
from model_recordings import with_effects
from node_bench import bench, overrides
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.parameter import Parameter
from ros_processes import executable, node_process
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from pprs_dynamics import DriveModel
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.monitor import MonitorNode

pytestmark = pytest.mark.nodes

MOTION = random_motion(np.random.default_rng(21), 1)
MESSAGE = message_of(MOTION)


class Caller:
    """Calls the node's parameter services over DDS."""

    def __init__(self, node: FeedforwardBench) -> None:
        self.node, self.bench = node, node.bench

    def call(self, kind: Any, name: str, **fields: Any) -> Any:
        client = self.bench.probe.create_client(kind, f'/feedforward/{name}')
        assert self.bench.spin_until(client.service_is_ready)
        future = client.call_async(kind.Request(**fields))
        assert self.bench.spin_until(future.done)
        return future.result()

    def set(self, name: str, value: Any) -> SetParametersResult:
        """Set one parameter."""
        kind = Parameter.Type.STRING_ARRAY if name == 'effects.active' else None
        message = Parameter(name, kind, value).to_parameter_msg()
        return self.call(SetParameters, 'set_parameters', parameters=[message]).results[0]


@pytest.fixture
def caller() -> Iterator[Caller]:
    with feedforward_bench() as node:
        yield Caller(node)


def test_effects_come_and_go_with_their_topics_while_running(caller: Caller) -> None:
    node, plain = caller.node, np.array(caller.node.answer(MESSAGE))
    assert not caller.set('effects.active', ['stribeck_friction']).successful
    assert caller.set('effects.stribeck_friction.lift_1.force', 1.2).successful
    assert caller.set('effects.stribeck_friction.lift_1.velocity', 0.01).successful
    assert caller.set('effects.effort_offset.slide_3.force', -0.7).successful
    assert node.answer(MESSAGE) == plain.tolist()
    assert caller.set('effects.active', ['stribeck_friction', 'effort_offset']).successful
    expected = with_effects(DriveModel.load(), {
        'stribeck_friction': {'lift_1.force': 1.2, 'lift_1.velocity': 0.01},
        'effort_offset': {'slide_3.force': -0.7}}).drive_forces(MOTION)
    topic = '/feedforward/effort/effort_offset'
    part = node.bench.listen(JointState, topic)
    assert node.bench.spin_until(lambda: node.node.count_subscribers(topic))
    np.testing.assert_allclose(node.answer(MESSAGE), expected.total[0], rtol=0, atol=EQUAL)
    assert node.bench.spin_until(lambda: part)
    assert list(part[-1].effort) == [0, 0, -0.7, 0, 0, 0]
    # A parameter of an effect in force acts at once; the effect goes, and its topic with it.
    assert caller.set('effects.effort_offset.slide_3.force', 0.2).successful
    assert node.answer(MESSAGE)[2] == pytest.approx(expected.total[0, 2] + 0.9, abs=EQUAL)
    assert caller.set('effects.active', ['stribeck_friction']).successful
    assert node.bench.spin_until(lambda: not node.bench.probe.count_publishers(topic))
    assert caller.set('effects.active', []).successful
    assert node.answer(MESSAGE) == plain.tolist()


REFUSED = [
    ('masses.payload', -1.0, 'masses.payload is -1.0, must be a finite number at least 0'),
    ('masses.paylod', 1.0, 'did you mean masses.payload'),
    ('limits.effort', [1.0, 2.0], 'limits.effort is [1.0, 2.0]'),
    ('friction.approach', 'third', 'whole_mechanism'),
    ('feedforward_scale', 1.5, 'feedforward_scale is 1.5'),
    ('limit_policy', 'ignore', 'reject, clamp'),
    ('effort_limits', [1.0] * 5, 'effort_limits is [1.0, 1.0, 1.0, 1.0, 1.0]'),
    ('effort_limits', [1.0] * 5 + [0.0], 'effort_limits is'),
    ('command_timeout', float('nan'), 'command_timeout is nan'),
    ('timeout_action', 3, 'timeout_action is 3'),
    ('effects.active', ['friction_of_the_third_kind'], 'effects.active: unknown effect'),
]


def test_what_is_not_allowed_is_refused_with_name_value_and_rule(caller: Caller) -> None:
    plain = caller.node.answer(MESSAGE)
    for name, value, told in REFUSED:
        result = caller.set(name, value)
        assert not result.successful, name
        assert told in result.reason
    assert caller.node.answer(MESSAGE) == plain


def test_whole_numbers_and_empty_lists_are_taken_for_decimal_ones(caller: Caller) -> None:
    for name, value in (('masses.payload', 2), ('gravity', [0, 0, -10]), ('command_timeout', 1),
                        ('effort_limits', [2000] * 6), ('effects.active', ['effort_offset']),
                        ('effects.effort_offset.lift_1.force', 1), ('effort_limits', [])):
        result = caller.set(name, value)
        # An effect in force has to have its numbers first.
        assert result.successful or name == 'effects.active', result.reason
    assert caller.set('effects.active', ['effort_offset']).successful
    expected = DriveModel.from_parameters({
        **DriveModel.load().values, 'masses.payload': 2.0, 'gravity': [0.0, 0.0, -10.0],
        'effects.active': ['effort_offset'], 'effects.effort_offset.lift_1.force': 1.0})
    np.testing.assert_allclose(caller.node.answer(MESSAGE), expected.drive_forces(MOTION).total[0],
                               rtol=0, atol=EQUAL)


def test_a_parameter_is_described_with_unit_and_rule(caller: Caller) -> None:
    described, = caller.call(DescribeParameters, 'describe_parameters',
                             names=['masses.payload']).descriptors
    assert '[kg]' in described.description
    assert described.additional_constraints.startswith('must be a finite number at least 0')


def test_a_qos_that_does_not_fit_is_told_with_the_resolved_topic(
    ros_domain: int, tmp_path: Path,
) -> None:
    log = tmp_path / 'log'
    command = [executable('feedforward'), '--ros-args', '-p', 'demo:=true',
               '-r', '~/commands:=/effort/commands',
               '-p', 'qos_overrides./effort/commands.publisher.reliability:=best_effort']
    with bench() as running, node_process(command, ros_domain, log):
        running.listen(Float64MultiArray, '/effort/commands')  # reliable
        assert running.spin_until(lambda: 'RELIABILITY' in log.read_text()), log.read_text()
    assert "'/effort/commands', requesting incompatible QoS" in log.read_text()


@pytest.mark.parametrize(('node', 'name', 'value'), [
    (FeedforwardNode, 'frame_id', 'world'), (FeedforwardNode, 'autostart', False),
    (FeedforwardNode, 'joint_prefix', 'left_'), (FeedforwardNode, 'joint_map.lift_3', 'z_axis'),
    (MonitorNode, 'window', 0.3), (MonitorNode, 'update_rate', 10.0),
    (MonitorNode, 'diagnose_every', 5.0)])
def test_what_only_counts_at_the_start_is_refused_while_the_node_runs(
    node: Any, name: str, value: Any,
) -> None:
    with bench() as running:
        made = running.add(node, parameter_overrides=overrides())
        result, = made.set_parameters([Parameter(name, value=value)])
        assert not result.successful
        assert name.partition('.')[0] in result.reason
        assert 'stay as it was when the node started' in result.reason
        if made.has_parameter(name):  # the same value again is no change
            assert made.set_parameters([made.get_parameter(name)])[0].successful


@pytest.mark.parametrize(('node', 'name', 'value'), [
    (FeedforwardNode, 'window', 0.3), (FeedforwardNode, 'injected_effects', ['payload_mass']),
    (MonitorNode, 'command_timeout', 5.0), (MonitorNode, 'timeout_action', 'zero')])
def test_a_change_for_another_node_is_refused_as_nothing_would_come_of_it(
    node: Any, name: str, value: Any,
) -> None:
    with bench() as running:
        # A model file may hold parameters of all nodes.
        made = running.add(node, parameter_overrides=overrides(**{name: value}))
        other = 0.4 if isinstance(value, float) else 'silent' if name.endswith('action') else ['x']
        result, = made.set_parameters([Parameter(name, value=other)])
        assert not result.successful
        assert f'{made.get_name()} has no such parameter' in result.reason
        assert made.set_parameters([Parameter(name, value=value)])[0].successful
