# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What keeps a drive safe: limits, scale, stale commands, warnings before rejections."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from controller_rules import WAY, ControllerSettings, objection
from feedforward_bench import EQUAL, feedforward_bench, held, message_of, random_motion
from node_bench import overrides
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.messages import conversions

pytestmark = pytest.mark.nodes

TIMEOUT = 0.15  # [s]
MOTION = random_motion(np.random.default_rng(11), 3)
FORCES = DriveModel.load().drive_forces(MOTION)


def test_a_force_over_the_nodes_own_limit_is_rejected_and_below_it_passes() -> None:
    peak = np.abs(FORCES.total).max(axis=0)
    with feedforward_bench(effort_limits=(peak * 1.01).tolist()) as node:
        node.answer(message_of(MOTION))
        tight = (peak * 1.01).tolist()
        tight[4] = float(peak[4] * 0.99)
        result, = node.node.set_parameters([Parameter('effort_limits', value=tight)])
        assert result.successful, result.reason
        node.send(message_of(MOTION))
        assert node.counters['LIMIT'] == 1
        assert 'lift_2' in node.wait_for_status(code='LIMIT')['message']
        assert len(node.commands) == 1


def test_clamped_forces_are_within_the_limit_on_every_topic_and_told() -> None:
    limits = np.abs(FORCES.total).max(axis=0) * [0.5, 2, 2, 0.9, 2, 2]
    with feedforward_bench(effort_limits=limits.tolist(), limit_policy='clamp') as node:
        found = node.answer(message_of(MOTION))
        expected = np.clip(FORCES.total, -limits, limits)
        np.testing.assert_allclose(found, expected[0], rtol=0, atol=EQUAL)
        assert node.bench.spin_until(lambda: node.joint_trajectory and node.joint_command)
        efforts = [point.effort for point in node.joint_trajectory[-1].points]
        np.testing.assert_allclose(efforts, expected, rtol=0, atol=EQUAL)
        np.testing.assert_allclose(node.joint_command[-1].effort, expected[0], rtol=0, atol=EQUAL)
        status = node.wait_for_status(code='CLAMPED')
        assert status['level'] == 'WARN'
        assert status['counters']['clamped'] == 1


def test_clamping_never_lets_a_number_through_that_is_none() -> None:
    motion = random_motion(np.random.default_rng(1), 1)
    message = message_of(motion)
    message.points[0].velocities[0].angular.x = 1e300
    with feedforward_bench(limit_policy='clamp') as node:
        node.send(message)
        assert node.counters['OUTPUT'] == 1
        node.answer(message_of(motion))
        assert len(node.commands) == 1


@pytest.mark.parametrize('action', ['hold_gravity', 'zero', 'silent'])
def test_a_stale_command_is_acted_on_once_and_the_next_message_recovers(action: str) -> None:
    with feedforward_bench(command_timeout=TIMEOUT, timeout_action=action) as node:
        answer = node.answer(message_of(MOTION))
        for round_number in (1, 2):
            node.wait_for_status(code='STALE', level='STALE')
            node.bench.spin_for(3 * TIMEOUT)
            assert node.counters['stale'] == round_number
            if action == 'silent':
                assert len(node.commands) == round_number
            else:
                assert len(node.commands) == 2 * round_number
                expected = held(MOTION) if action == 'hold_gravity' else np.zeros(6)
                np.testing.assert_allclose(node.commands[-1].data, expected, rtol=0, atol=EQUAL)
                assert node.bench.spin_until(
                    lambda count=2 * round_number: len(node.joint_command) == count)
                command = node.joint_command[-1]
                np.testing.assert_allclose(command.velocity, 0, atol=0)
                # The only setpoint that a drive without the trajectory has got.
                np.testing.assert_allclose(
                    command.position, FORCES.mechanism.position[0], rtol=0, atol=EQUAL)
                # A trajectory controller would go on with the last point's speed for good.
                assert node.bench.spin_until(
                    lambda count=2 * round_number: len(node.joint_trajectory) == count)
                point, = node.joint_trajectory[-1].points
                np.testing.assert_allclose(point.effort, expected, rtol=0, atol=EQUAL)
                np.testing.assert_allclose(
                    point.positions, FORCES.mechanism.position[-1], rtol=0, atol=EQUAL)
                assert not any(point.velocities)
                assert not any(point.accelerations)
                assert objection(node.joint_trajectory[-1], ControllerSettings(DRIVES),
                                 node.node.get_clock().now().nanoseconds + WAY) == ''
            seen = len(node.bench.status)
            assert node.answer(message_of(MOTION)) == answer
            # Soon it is stale again: the status that passed counts.
            assert node.bench.spin_until(
                lambda seen=seen: 'OK' in [status['code'] for status in node.bench.status[seen:]])


@pytest.mark.parametrize('action', ['hold_gravity', 'zero'])
def test_a_controller_that_was_given_a_stop_is_held_where_it_stopped(action: str) -> None:
    with feedforward_bench(command_timeout=0.5, stop_time=0.3, timeout_action=action) as node:
        node.answer(message_of(MOTION))
        node.wait_for_status(code='STALE')
        node.bench.spin_for(TIMEOUT)
        given, *later = node.joint_trajectory
        stopped = np.array(given.points[-1].positions)
        assert np.abs(stopped - FORCES.mechanism.position[-1]).max() > 1e-3  # [m]
        assert len(later) == (action == 'zero')  # with its gravity it is held already
        for message in later:
            np.testing.assert_array_equal([point.positions for point in message.points], [stopped])
            assert not np.any(message.points[-1].effort)


def test_nothing_goes_stale_before_the_first_command_nor_with_a_timeout_of_0() -> None:
    with feedforward_bench(command_timeout=TIMEOUT) as node:
        node.bench.spin_for(3 * TIMEOUT)
        rejected = message_of(MOTION)
        rejected.joint_names = ['gripper']
        node.send(rejected)
        node.bench.spin_for(3 * TIMEOUT)
        assert node.counters['stale'] == 0
        result, = node.node.set_parameters([Parameter('command_timeout', value=0.0)])
        assert result.successful
        node.answer(message_of(MOTION))
        node.bench.spin_for(3 * TIMEOUT)
        assert node.counters['stale'] == 0
        # Switched on in mid-stream, it counts for the command that is in force.
        node.node.set_parameters([Parameter('command_timeout', value=TIMEOUT)])
        node.wait_for_status(code='STALE')


def test_the_stale_timer_counts_from_the_trajectorys_end_and_a_shorter_one_replaces_it() -> None:
    long = message_of(MOTION)
    long.points[-1].time_from_start.sec = 20
    with feedforward_bench(command_timeout=TIMEOUT) as node:
        node.answer(long)
        node.bench.spin_for(4 * TIMEOUT)
        assert node.counters['stale'] == 0
        node.answer(message_of(MOTION))
        node.wait_for_status(code='STALE')


def test_a_rejected_message_does_not_keep_a_command_fresh() -> None:
    bad = message_of(MOTION)
    bad.header.frame_id = 'world'
    with feedforward_bench(command_timeout=TIMEOUT) as node:
        node.answer(message_of(MOTION))
        for _ in range(8):
            node.send(bad)
            node.bench.spin_for(TIMEOUT / 4)
        assert node.counters['stale'] == 1


def test_holding_stays_within_limits_and_scale() -> None:
    with feedforward_bench(command_timeout=TIMEOUT, feedforward_scale=0.5, limit_policy='clamp',
                           effort_limits=[4.0] * 6) as node:
        node.answer(message_of(MOTION))
        node.wait_for_status(code='STALE')
        assert node.bench.spin_until(lambda: len(node.commands) == 2)
        np.testing.assert_allclose(node.commands[-1].data,
                                   np.clip(0.5 * held(MOTION), -4, 4), rtol=0, atol=EQUAL)


def at(x: float, z: float) -> PlatformMotion:
    zero = np.zeros((1, 3))
    return PlatformMotion([[x, 0.0, z]], [[0, 0, 0, 1.0]], zero, zero, zero, zero)


def test_warnings_come_before_the_rejection() -> None:
    # cos u_1 = (0.15 - x - 0.1) / 0.3; the rod's sine falls to its limit of 0.05 near x = 0.35,
    # and with it the sine's share of the margin, 1 - 0.05 / sin u_1.
    def sine(margin: float) -> float:
        return float(0.05 + 0.3 * np.sqrt(1 - (0.05 / (1 - margin)) ** 2))

    with feedforward_bench(
            warning_margin=0.2, limits__condition_number=1e6, limits__slide_stroke=[-1.0, 1.0],
            limits__lift_stroke=[-1.0, 2.0]) as node:
        node.answer(message_of(at(0.0, 0.5)))
        node.wait_for_status(code='OK')
        node.answer(message_of(at(sine(0.3), 0.5)))
        node.answer(message_of(at(sine(0.1), 0.5)))
        status = node.wait_for_status(code='NEAR_SINGULAR', level='WARN')
        assert status['singularity_margin'] == pytest.approx(0.1, abs=0.01)
        node.send(message_of(at(sine(-0.1), 0.5)))
        assert node.counters['SINGULAR'] == 1


def test_of_setpoints_that_wait_the_latest_are_executed_and_the_others_are_told() -> None:
    motion = random_motion(np.random.default_rng(2), 30)
    with feedforward_bench(lag_warning=0.02) as node:
        node.answer(message_of(motion[:1]))
        for k in range(len(motion)):  # nobody spins
            node.publisher.publish(message_of(motion[k:k + 1]))
        assert node.bench.spin_until(lambda: len(node.commands) > 10)
        node.bench.spin_for(0.3)
        expected = DriveModel.load().drive_forces(motion[-10:]).total
        np.testing.assert_allclose([command.data for command in node.commands[1:]], expected,
                                   rtol=0, atol=EQUAL)
        assert node.counters['superseded'] == len(motion) - 10
        node.wait_for_status(lagging=True)


def test_the_status_tells_what_a_supervisor_wants_to_know() -> None:
    with feedforward_bench() as node:
        for _ in range(20):
            node.answer(message_of(MOTION))
        assert node.bench.spin_until(lambda: node.bench.status[-1]['counters']['accepted'] == 20)
        status = node.bench.status[-1]
        assert status['state'] == 'active'
        assert 0 < status['compute_time']['p50'] <= status['compute_time']['p99']
        assert status['compute_time']['p99'] <= status['compute_time']['max'] < 1.0
        assert status['rate'] > 0
        assert 0 < status['singularity_margin'] < 1
        assert status['model']['files'][0]['file'].endswith('config/paper.yaml')
        before = status['model']['sha256']
        node.node.set_parameters([Parameter('masses.payload', value=1.5)])
        assert node.bench.spin_until(lambda: node.bench.status[-1]['model']['sha256'] != before)


def test_what_was_sent_too_long_ago_is_not_executed_whether_it_is_stamped_or_not() -> None:
    """Messages that lay in the middleware while the node stood still."""
    limit = 0.3
    with feedforward_bench(max_age=limit) as node:
        for stamped in (True, False):
            now = node.node.get_clock().now().nanoseconds
            stamp = conversions.time(now) if stamped else None
            node.publisher.publish(message_of(MOTION, stamp))
            while node.node.get_clock().now().nanoseconds < now + 1.5e9 * limit:
                pass
            rejected, accepted = node.counters['TIME'], node.counters['accepted']
            assert node.bench.spin_until(lambda rejected=rejected: node.counters['TIME'] > rejected)
            assert node.counters['accepted'] == accepted

            def is_accepted(stamped: bool = stamped, accepted: int = accepted) -> bool:
                """Send another one, which a busy machine may find too old as well."""
                now = node.node.get_clock().now().nanoseconds
                node.send(message_of(MOTION, conversions.time(now) if stamped else None))
                return node.counters['accepted'] > accepted
            assert node.bench.spin_until(is_accepted)


def test_no_time_from_start_switches_the_watchdog_off() -> None:
    with feedforward_bench(command_timeout=TIMEOUT, max_duration=5.0) as node:
        node.answer(message_of(MOTION))
        endless = message_of(MOTION)
        endless.points[-1].time_from_start.sec = 2_000_000_000
        node.send(endless)
        assert 'max_duration allows 5 s' in node.wait_for_status(code='TIME')['message']
        assert node.bench.spin_until(lambda: node.counters['stale'] == 1)
        refused, = node.node.set_parameters([Parameter('max_duration', value=0.0)])
        assert not refused.successful  # it cannot be switched off either


def test_two_publishers_that_take_turns_are_told_by_name() -> None:
    with feedforward_bench() as node:
        other = Node('teach_pendant', context=node.bench.context)
        try:
            publisher = other.create_publisher(
                MultiDOFJointTrajectory, '/feedforward/trajectory', 10)
            assert node.bench.spin_until(
                lambda: node.node.count_publishers('/feedforward/trajectory') == 2)
            assert node.bench.spin_until(publisher.get_subscription_count)
            for _ in range(3):
                node.answer(message_of(MOTION))
                before = len(node.commands)
                publisher.publish(message_of(MOTION))
                assert node.bench.spin_until(lambda before=before: len(node.commands) > before)
            said = node.wait_for_status(code='CONFLICT', level='WARN')['message']
            assert '/teach_pendant' in said
            assert '/probe' in said
        finally:
            other.destroy_node()
        node.bench.spin_for(1.2)
        node.answer(message_of(MOTION))
        assert node.wait_for_status(code='OK')


def test_a_second_node_of_its_name_is_told() -> None:
    with feedforward_bench() as node:
        node.answer(message_of(MOTION))
        twin = node.bench.add(FeedforwardNode, parameter_overrides=overrides())
        said = node.wait_for_status(code='CONFLICT', level='WARN')['message']
        assert '2 nodes are called /feedforward' in said
        node.bench.executor.remove_node(twin)
        twin.destroy_node()
        assert node.bench.spin_until(lambda: node.bench.status[-1]['code'] != 'CONFLICT')


def test_another_node_that_commands_the_same_drives_is_told() -> None:
    with feedforward_bench() as node:
        node.answer(message_of(MOTION))
        other = Node('other_controller', context=node.bench.context)
        topic = node.node.resolve_topic_name('~/commands')
        other.create_publisher(Float64MultiArray, topic, 1)
        said = node.wait_for_status(code='CONFLICT', level='WARN')['message']
        assert f'/other_controller publishes on {topic}' in said
        other.destroy_node()
        assert node.bench.spin_until(lambda: node.bench.status[-1]['code'] != 'CONFLICT')


def controller_state(position: np.ndarray, velocity: np.ndarray) -> Any:
    """Return what joint_trajectory_controller publishes; control_msgs has no wheel."""
    return SimpleNamespace(
        joint_names=list(DRIVES), output=SimpleNamespace(effort=[0.0] * 6),
        reference=SimpleNamespace(positions=position.tolist(), velocities=velocity.tolist()))


def test_a_node_that_has_commanded_nothing_stops_no_controller() -> None:
    position, velocity, _ = FORCES.drive_motion
    still = np.zeros(6)
    with feedforward_bench() as node:
        for speed in (velocity[0], still):
            for _ in range(3):
                node.node._on_controller(controller_state(position[0], speed))
                node.bench.spin_for(0.05)
        assert not node.joint_trajectory
        assert not node.commands


@pytest.mark.parametrize('moves', [True, False], ids=['moves', 'stands'])
def test_a_controller_that_comes_back_is_held_only_where_it_stands(moves: bool) -> None:
    position, velocity, _ = FORCES.drive_motion
    with feedforward_bench(command_timeout=TIMEOUT) as node:
        node.node._on_controller(controller_state(position[0], velocity[0]))
        node.answer(message_of(MOTION))
        node.wait_for_status(code='STALE')
        assert node.bench.spin_until(lambda: len(node.joint_trajectory) == 2)
        node.bench.spin_for(1.2)
        for k in (0, 1) if moves else (0, 0, 0):
            node.node._on_controller(controller_state(
                position[k], velocity[0] if moves else np.zeros(6)))
        node.bench.spin_for(0.3)
        assert len(node.joint_trajectory) == (2 if moves else 3)
        if not moves:
            point, = node.joint_trajectory[-1].points
            np.testing.assert_allclose(point.positions, position[0], atol=1e-8)
            assert not any(point.velocities)
