# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What ros2_control's controllers accept of what the nodes publish, and the action proxy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from controller_rules import WAY, ControllerSettings, objection
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros import play_trajectory
from pprs_dynamics.ros.force_command import Feedforward
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.conversions import RobotNames
from pprs_dynamics.ros.messages.measured_states import MeasuredStates
from pprs_dynamics.ros.messages.serialisation import CommandBytes
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.messages.trajectory_request import reader_for

CONFIG = Path(__file__).parents[2] / 'config' / 'ros2_control'
NOW = 1_700_000_000_000_000_000  # [ns]
RATE = 100.0
OWN = {'feedforward_scale': 1.0, 'effort_limits': (), 'limit_policy': 'reject',
       'missing_derivatives': 'reject'}


def settings() -> ControllerSettings:
    """Return the controller's, from the file that users copy."""
    content = yaml.safe_load((CONFIG / 'joint_trajectory_controller.yaml').read_text())
    given = content['joint_trajectory_controller']['ros__parameters']
    return ControllerSettings(
        given['joints'], given['command_interfaces'], given['allow_partial_joints_goal'],
        given['allow_nonzero_velocity_at_trajectory_end'])


def forwarded(
    points: int, ahead: float, sample: int = 100, rate: float = RATE,
) -> JointTrajectory:
    """Return what feedforward makes of a message of play_trajectory, in the middle of a path."""
    model = DriveModel.load()
    motion = HelicalPath().motion(np.arange(sample, sample + points) / rate)
    message = conversions.write_trajectory(
        motion, conversions.time(NOW + round(ahead * 1e9)),
        [round(k * 1e9 / rate) for k in range(points)])
    request = reader_for(model).read(serialize_message(message), NOW, 'reject')
    answer = Feedforward(model, OWN).answer(request)
    found = deserialize_message(CommandBytes(conversions.PAPER).joint_trajectory(
        request.start, request.offsets, answer.forces, answer.effort), JointTrajectory)
    assert isinstance(found, JointTrajectory)
    return found


@pytest.mark.parametrize(('points', 'ahead', 'said'), [
    (1, 0.0, 'ends in the past'), (2, 0.0, 'ends in the past'),
    (1, 0.02, ''), (10, 0.0, ''), (10, 0.02, '')])
def test_a_stream_is_taken_where_it_ends_after_its_arrival(
    points: int, ahead: float, said: str,
) -> None:
    assert objection(forwarded(points, ahead), settings(), NOW + WAY) == said


@pytest.mark.parametrize('rate', [50.0, 100.0, 500.0, 1000.0])
def test_a_stream_is_taken_with_reserve_by_the_defaults(rate: float) -> None:
    given = {one.name: one.default for one in play_trajectory.PARAMETERS}
    message = forwarded(given['points'], given['ahead'], rate=rate)
    assert objection(message, settings(), NOW + 2 * WAY) == ''


def test_a_piece_in_motion_needs_the_parameter_of_our_file() -> None:
    plain = ControllerSettings(DRIVES)
    assert 'last point' in objection(forwarded(10, 0.02), plain, NOW + WAY)


def test_efforts_need_the_effort_interface() -> None:
    positions = ControllerSettings(DRIVES, ('position',),
                                   allow_nonzero_velocity_at_trajectory_end=True)
    assert 'effort' in objection(forwarded(10, 0.02), positions, NOW + WAY)


@pytest.mark.parametrize('name', ['forward_command_controller', 'joint_trajectory_controller'])
def test_the_files_name_the_drives_in_the_order_of_commands(name: str) -> None:
    content = yaml.safe_load((CONFIG / f'{name}.yaml').read_text())
    given = content[name]['ros__parameters']
    assert given['joints'] == list(DRIVES)
    types = content['controller_manager']['ros__parameters']
    assert name in types
    assert types[name]['type'].startswith(f'{name}/')
    if name == 'forward_command_controller':
        assert given['interface_name'] == 'effort'
    else:
        assert set(given['state_interfaces']) == {'position', 'velocity'}
        assert set(given['gains']) == set(DRIVES)


class TestTrajectoryProxy:
    """Where control_msgs is installed; it has no wheel."""

    @pytest.fixture
    def action(self) -> Any:
        return pytest.importorskip('control_msgs.action', reason='control_msgs comes with a ROS 2 '
                                   'installation only').FollowJointTrajectory

    @pytest.mark.nodes
    def test_a_goal_reaches_the_controller_with_its_efforts(self, action: Any) -> None:
        with controller(action) as (bench, client, taken):
            model = DriveModel.load()
            motion = HelicalPath().motion(np.arange(0, 20) / 20.0)
            expected = model.drive_forces(motion)
            goal = action.Goal()
            goal.trajectory.joint_names = list(DRIVES)
            position, velocity, acceleration = expected.drive_motion
            for k in range(len(motion)):
                goal.trajectory.points.append(point(
                    k / 20.0, position[k], velocity[k], acceleration[k]))
            result = answered(bench, client, goal)
            assert result.result.error_code == 0
            assert len(taken) == 1
            efforts = np.array([one.effort for one in taken[0].points])
            np.testing.assert_allclose(efforts, expected.total, atol=1e-6)
            assert list(taken[0].joint_names) == list(DRIVES)

    @pytest.mark.nodes
    def test_points_without_derivatives_get_them_from_a_spline(self, action: Any) -> None:
        with controller(action) as (bench, client, taken):
            times = np.arange(0, 40) / 20.0
            expected = DriveModel.load().drive_forces(HelicalPath().motion(times))
            goal = action.Goal()
            goal.trajectory.joint_names = list(DRIVES)
            for time, position in zip(times, expected.drive_motion[0], strict=True):
                goal.trajectory.points.append(point(time, position, np.zeros(0), np.zeros(0)))
            result = answered(bench, client, goal)
            assert result.result.error_code == 0, result.result.error_string
            efforts = np.array([one.effort for one in taken[0].points])
            # A spline's ends know nothing of what came before.
            np.testing.assert_allclose(efforts[8:-8], expected.total[8:-8], atol=0.05)

    @pytest.mark.nodes
    def test_what_cannot_be_reached_never_reaches_the_controller(self, action: Any) -> None:
        with controller(action) as (bench, client, taken):
            goal = action.Goal()
            goal.trajectory.joint_names = list(DRIVES)
            goal.trajectory.points.append(point(0.0, np.full(6, 5.0), np.zeros(6), np.zeros(6)))
            result = answered(bench, client, goal)
            assert result.result.error_code == action.Result.INVALID_GOAL
            assert 'WORKSPACE' in result.result.error_string
            assert taken == []


def point(offset: float, *values: Any) -> Any:
    """Return a point of a trajectory."""
    from trajectory_msgs.msg import JointTrajectoryPoint

    found = JointTrajectoryPoint(time_from_start=conversions.duration(round(offset * 1e9)))
    found.positions, found.velocities, found.accelerations = (one.tolist() for one in values)
    return found


def answered(bench: Any, client: Any, goal: Any) -> Any:
    """Return the result of a goal."""
    sent = client.send_goal_async(goal)
    assert bench.spin_until(sent.done)
    assert sent.result().accepted
    result = sent.result().get_result_async()
    assert bench.spin_until(result.done)
    return result.result()


def controller(action: Any) -> Any:
    """Return a context with the proxy, a client of it, and what reaches a stand-in controller."""
    from contextlib import contextmanager

    from node_bench import bench
    from rclpy.action import ActionClient, ActionServer
    from rclpy.parameter import Parameter

    from pprs_dynamics.ros.trajectory_proxy import TrajectoryProxyNode

    @contextmanager
    def running() -> Any:
        with bench() as running_bench:
            taken: list[Any] = []

            def execute(handle: Any) -> Any:
                trajectory = handle.request.trajectory
                now = running_bench.probe.get_clock().now().nanoseconds
                if said := objection(trajectory, settings(), now):
                    handle.abort()
                    return action.Result(error_code=-1, error_string=said)
                taken.append(trajectory)
                handle.succeed()
                return action.Result()

            server = ActionServer(running_bench.probe, action, '/arm/follow_joint_trajectory',
                                  execute)
            running_bench.add(TrajectoryProxyNode, parameter_overrides=[
                Parameter('action', value='/arm/follow_joint_trajectory')])
            client = ActionClient(running_bench.probe, action,
                                  '/trajectory_proxy/follow_joint_trajectory')
            assert running_bench.spin_until(client.server_is_ready)
            yield running_bench, client, taken
            client.destroy()
            server.destroy()

    return running()


def test_a_robot_has_the_names_of_the_machine_and_its_own_frame() -> None:
    model = DriveModel.from_parameters({
        **DriveModel.load().values, 'joint_prefix': 'left_', 'joint_map.lift_3': 'z_axis'})
    names = RobotNames.of(model, 'left_base')
    motion = HelicalPath().motion(np.array([1.0]))
    for frame, accepted in (('left_base', True), ('', True), ('base', False)):
        message = conversions.write_trajectory(motion, conversions.time(NOW), [0], frame)
        read = reader_for(model, names).read
        if not accepted:
            with pytest.raises(Rejection, match='left_base'):
                read(serialize_message(message), NOW, 'reject')
            continue
        request = read(serialize_message(message), NOW, 'reject')
    answer = Feedforward(model, OWN).answer(request)
    state = deserialize_message(CommandBytes(names).joint_state(NOW, answer.effort[0]), JointState)
    assert list(state.name) == ['left_slide_1', 'left_slide_2', 'left_slide_3', 'left_lift_1',
                                'left_lift_2', 'z_axis']
    assert state.header.frame_id == 'left_base'
    measured = conversions.joint_state(NOW, answer.effort[0], np.arange(6.0), np.zeros(6), names)
    [found] = MeasuredStates(names.joints).read(serialize_message(measured))
    assert found.position.tolist() == list(range(6))
