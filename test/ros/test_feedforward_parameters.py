# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the running feedforward node, set over DDS as `ros2 param set` does."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from feedforward_bench import EQUAL, FeedforwardBench, feedforward_bench, message_of, random_motion
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import (
    DescribeParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from sensor_msgs.msg import JointState

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.model.model_file import build_model

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

    def set_at_once(self, values: dict[str, Any]) -> SetParametersResult:
        """Set all or none."""
        return self.call(
            SetParametersAtomically, 'set_parameters_atomically', parameters=[
                Parameter(name, value=value).to_parameter_msg()
                for name, value in values.items()]).result


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
    values = {**DriveModel.load().values, 'effects.active': ['stribeck_friction', 'effort_offset'],
              'effects.stribeck_friction.lift_1.force': 1.2,
              'effects.stribeck_friction.lift_1.velocity': 0.01,
              'effects.effort_offset.slide_3.force': -0.7}
    expected = build_model(values).drive_forces(MOTION)
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


def test_an_effect_of_measurement_enters_no_command(caller: Caller) -> None:
    plain = caller.node.answer(MESSAGE)
    assert caller.set('effects.effort_gain.lift_1.gain', 0.2).successful
    result = caller.set('effects.active', ['effort_gain'])
    assert result.successful, result.reason
    assert caller.node.answer(MESSAGE) == plain
    assert not caller.bench.probe.count_publishers('/feedforward/effort/effort_gain')


def test_many_parameters_change_at_once_or_not_at_all(caller: Caller) -> None:
    plain = caller.node.answer(MESSAGE)
    half = {'masses.payload': 2.0, 'friction.approach': 'a_third_one'}
    result = caller.set_at_once(half)
    assert not result.successful
    assert 'friction.approach' in result.reason
    assert caller.node.answer(MESSAGE) == plain
    whole = {'masses.payload': 2.0, 'friction.approach': 'independent_chains', 'max_age': 3.0,
             'limits.rod_cosine': 0.001}
    assert caller.set_at_once(whole).successful
    values = {**DriveModel.load().values, **whole}
    values.pop('max_age')
    np.testing.assert_allclose(caller.node.answer(MESSAGE),
                               build_model(values).drive_forces(MOTION).total[0], atol=EQUAL)


@pytest.mark.parametrize(('name', 'value', 'told'), [
    ('masses.payload', -1.0, 'masses.payload is -1.0, must be at least 0'),
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
])
def test_what_is_not_allowed_is_refused_with_name_value_and_rule(
    caller: Caller, name: str, value: Any, told: str,
) -> None:
    plain = caller.node.answer(MESSAGE)
    result = caller.set(name, value)
    assert not result.successful
    assert told in result.reason
    assert caller.node.answer(MESSAGE) == plain


def test_every_parameter_says_what_it_is_and_numbers_say_their_range(caller: Caller) -> None:
    assert caller.set('effects.effort_offset.lift_1.force', 0.1).successful
    names = caller.call(ListParameters, 'list_parameters').result.names
    own = [name for name in names if not name.startswith(('qos_overrides.', 'use_sim_time',
                                                          'start_type_description_service'))]
    assert {'command_timeout', 'geometry.rod_length', 'effects.active',
            'effects.effort_offset.lift_1.force'} <= set(own)
    described = caller.call(DescribeParameters, 'describe_parameters', names=own).descriptors
    for descriptor in described:
        assert descriptor.description, descriptor.name
        assert descriptor.additional_constraints.startswith('must '), descriptor.name
    ranges = {each.name: each.floating_point_range for each in described}
    assert ranges['feedforward_scale'][0].to_value == 1.0
    assert ranges['masses.payload'][0].from_value == 0.0
    assert ranges['effects.effort_offset.lift_1.force'][0].to_value > 0


def test_topics_have_the_qos_that_is_asked_for() -> None:
    overrides = {'qos_overrides./feedforward/commands.publisher.reliability': 'best_effort',
                 'qos_overrides./feedforward/trajectory.subscription.depth': 7}
    with feedforward_bench(**overrides) as node:
        info, = node.bench.probe.get_publishers_info_by_topic('/feedforward/commands')
        assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
        assert node.node._subscription.qos_profile.depth == 7
        status, = node.bench.probe.get_publishers_info_by_topic('/feedforward/status')
        assert status.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        others, = node.bench.probe.get_publishers_info_by_topic('/feedforward/joint_command')
        assert others.qos_profile.reliability == ReliabilityPolicy.RELIABLE


def test_a_qos_that_is_none_is_one_sentence() -> None:
    override = {'qos_overrides./feedforward/commands.publisher.reliability': 'hopeful'}
    with pytest.raises(ModelError, match='hopeful'), feedforward_bench(**override):
        pass
