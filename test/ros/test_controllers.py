# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What ros2_control's controllers accept of what the nodes publish, and the action proxy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from controller_rules import WAY, ControllerSettings, objection
from node_bench import bench
from rclpy.serialization import serialize_message
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros import play_trajectory
from pprs_dynamics.ros.force_command import Feedforward
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.trajectory_request import TRAJECTORY, readers_for

CONFIG = Path(__file__).parents[2] / 'config' / 'ros2_control'
NOW = 1_700_000_000_000_000_000  # [ns]
RATE = 100.0
STOP = 0.1  # [s] by default of feedforward.launch.py
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
    points: int, ahead: float, sample: int = 100, rate: float = RATE, stop_time: float = STOP,
) -> JointTrajectory:
    """Return what feedforward makes of a message of play_trajectory, in the middle of a path."""
    model = DriveModel.load()
    motion = HelicalPath().motion(np.arange(sample, sample + points) / rate)
    message = conversions.write_trajectory(
        motion, conversions.time(NOW + round(ahead * 1e9)),
        [round(k * 1e9 / rate) for k in range(points)])
    request = readers_for(model)[TRAJECTORY].read(serialize_message(message), NOW, 'reject')
    feedforward = Feedforward(model, OWN)
    drives = feedforward.ending_at_rest(feedforward.answer(request), stop_time)
    return drives.message(request.start, conversions.PAPER)


@pytest.mark.parametrize('rate', [50.0, 1000.0])
def test_a_stream_is_taken_with_reserve_by_the_defaults(rate: float) -> None:
    given = {one.name: one.default for one in play_trajectory.PARAMETERS}
    for allows, stop_time in ((False, STOP), (True, 0.0)):
        message = forwarded(given['points'], given['ahead'], rate=rate, stop_time=stop_time)
        controller = replace(settings(), allow_nonzero_velocity_at_trajectory_end=allows)
        assert objection(message, controller, NOW + 2 * WAY) == ''


def test_a_piece_in_motion_needs_an_end_at_rest() -> None:
    """The file that users copy keeps the safe default of the controller."""
    plain = ControllerSettings(DRIVES)
    assert not settings().allow_nonzero_velocity_at_trajectory_end
    assert 'last point' in objection(forwarded(10, 0.02, stop_time=0.0), plain, NOW + WAY)
    assert objection(forwarded(10, 0.02), plain, NOW + WAY) == ''


ALONG = np.linspace(0.0, HelicalPath.duration, 48)  # [s] of a path from rest to rest


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
            motion = HelicalPath().motion(ALONG)
            expected = model.drive_forces(motion)
            goal = action.Goal()
            goal.trajectory.joint_names = list(DRIVES)
            position, velocity, acceleration = expected.drive_motion
            for k in range(len(motion)):
                goal.trajectory.points.append(point(
                    ALONG[k], position[k], velocity[k], acceleration[k]))
            result = answered(bench, client, goal)
            assert result.result.error_code == 0
            assert len(taken) == 1
            efforts = np.array([one.effort for one in taken[0].points])
            np.testing.assert_allclose(efforts[:-1], expected.total, atol=1e-6)
            # The path ends accelerated: what a controller holds afterwards has no inertia.
            np.testing.assert_allclose(
                efforts[-1], model.drive_forces(motion.held()).total[-1], atol=1e-6)
            assert np.abs(efforts[-1] - expected.total[-1]).max() > 0.1
            assert list(taken[0].points[-1].positions) == list(taken[0].points[-2].positions)
            assert objection(taken[0], settings(), NOW) == ''
            assert list(taken[0].joint_names) == list(DRIVES)


    @pytest.mark.nodes
    def test_a_goal_that_breaks_a_rule_is_refused_when_it_is_asked(self, action: Any) -> None:
        with controller(action) as (bench, client, taken):
            bench.follow_status('/trajectory_proxy/status')
            found = DriveModel.load().drive_forces(HelicalPath().motion([1.0, 1.1])).drive_motion
            for joints, stamp, moving, far, code, said in (
                    (['a', *DRIVES[1:]], 0, False, 0.0, 'NAMES', 'must hold each'),
                    (list(DRIVES), 5, False, 0.0, 'TIME', 'ended'),
                    (list(DRIVES), 0, False, 5.0, 'WORKSPACE', ''),
                    (list(DRIVES), 0, True, 0.0, 'LIMIT', 'in motion')):
                goal = action.Goal()
                goal.trajectory.joint_names = joints
                goal.trajectory.header.stamp.sec = stamp
                goal.trajectory.points = [
                    point(0.1 * (k + 1), found[0][k] + far, found[1][k] * moving, found[2][k])
                    for k in range(2)]
                sent = client.send_goal_async(goal)
                assert bench.spin_until(sent.done)
                assert not sent.result().accepted
                assert bench.spin_until(lambda code=code: bench.status[-1]['code'] == code)
                assert said in bench.status[-1]['message']
            assert taken == []


    @pytest.mark.nodes
    @pytest.mark.parametrize('ending', ['abort', 'succeed'])
    def test_after_an_aborted_goal_the_pose_is_held_with_gravity(
        self, action: Any, ending: str,
    ) -> None:
        pose = HelicalPath().motion([1.0]).held()
        expected = DriveModel.load().drive_forces(pose)
        with controller(action, ending) as (bench, client, _):
            held = bench.listen(JointTrajectory, '/arm/joint_trajectory')
            states = JointStates(bench, expected.mechanism.position[0])
            assert bench.connected()
            assert held == []  # it has commanded nothing
            answered(bench, client, resting_goal(action))
            bench.spin_for(0.5)
            assert len(held) == (1 if ending == 'abort' else 0)
            for message in held:
                given, = message.points
                np.testing.assert_allclose(given.effort, expected.total[0], atol=1e-6)
                np.testing.assert_allclose(
                    given.positions, expected.mechanism.position[0], atol=1e-9)
                assert not any(given.velocities)
                assert objection(message, settings(), NOW) == ''
            states.stop()


class JointStates:
    """States of a controller that holds one position."""

    def __init__(self, bench: Any, position: Sequence[float], controller: str = '/arm') -> None:
        from control_msgs.msg import JointTrajectoryControllerState

        message = JointTrajectoryControllerState(joint_names=list(DRIVES))
        message.reference.positions = list(position)
        message.reference.velocities = [0.0] * len(DRIVES)
        message.output.effort = [0.0] * len(DRIVES)
        publisher = bench.probe.create_publisher(
            type(message), f'{controller}/controller_state', 10)
        assert bench.spin_until(publisher.get_subscription_count)
        self._timer = bench.probe.create_timer(0.02, lambda: publisher.publish(message))

    def stop(self) -> None:
        self._timer.cancel()


def resting_goal(action: Any, duration: float = 0.2) -> Any:
    """Return a goal that is reached at rest after a duration [s]."""
    found = DriveModel.load().drive_forces(HelicalPath().motion([1.0]).held()).drive_motion
    goal = action.Goal()
    goal.trajectory.joint_names = list(DRIVES)
    goal.trajectory.points.append(point(duration, *(each[0] for each in found)))
    return goal


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


def duration_of(trajectory: JointTrajectory) -> float:
    """Return when a trajectory reaches its last point [s]."""
    return conversions.nanoseconds(trajectory.points[-1].time_from_start) / 1e9


def after(bench: Any, duration: float) -> Future[None]:
    """Return what is done after a time [s]."""
    passed: Future[None] = Future()

    def end() -> None:
        timer.cancel()
        passed.set_result(None)

    timer = bench.probe.create_timer(duration, end)
    return passed


def controller(action: Any, ending: str = 'succeed', share: float = 1.0) -> Any:
    """Return a context with the proxy, a client of it, and what reaches a stand-in controller.

    It ends a goal after a share of its motion.
    """
    from contextlib import contextmanager

    from rclpy.action import ActionClient, ActionServer
    from rclpy.parameter import Parameter

    from pprs_dynamics.ros.trajectory_proxy import TrajectoryProxyNode

    @contextmanager
    def running() -> Any:
        with bench() as running_bench:
            taken: list[Any] = []

            async def execute(handle: Any) -> Any:
                trajectory = handle.request.trajectory
                now = running_bench.probe.get_clock().now().nanoseconds
                if said := objection(trajectory, settings(), now):
                    handle.abort()
                    return action.Result(error_code=-1, error_string=said)
                taken.append(trajectory)
                await after(running_bench, share * duration_of(trajectory))
                getattr(handle, ending)()
                return action.Result()

            server = ActionServer(running_bench.probe, action, '/arm/follow_joint_trajectory',
                                  execute)
            running_bench.add(TrajectoryProxyNode, parameter_overrides=[
                Parameter('demo', value=True),
                Parameter('action', value='/arm/follow_joint_trajectory')])
            client = ActionClient(running_bench.probe, action,
                                  '/trajectory_proxy/follow_joint_trajectory')
            assert running_bench.spin_until(client.server_is_ready)
            yield running_bench, client, taken
            client.destroy()
            server.destroy()

    return running()
