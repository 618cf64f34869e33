# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated robot over DDS: start, stop, lost and impossible commands, and the closed loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from unittest.mock import Mock

import numpy as np
import pytest
from node_bench import Bench, bench, overrides
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.setpoints import SetpointQueue
from pprs_dynamics.ros.simulated_robot import SimulatedRobotNode
from pprs_dynamics.simulation.drive_control import Setpoint

pytestmark = pytest.mark.nodes

HOME = DriveModel.load().drive_forces(PlatformMotion.at_rest((0.0, 0.0, 0.5)))
REST = HOME.mechanism.position[0]
WEIGHT = HOME.parts['rigid_body'][0]


class RobotBench:
    """The node, what it publishes, and publishers of both kinds of commands."""

    def __init__(self, running: Bench, **values: object) -> None:
        self.bench = running
        self.node = running.add(SimulatedRobotNode, parameter_overrides=overrides(**values))
        self.states = running.listen(JointState, '/joint_states', 1000)
        running.follow_status('/simulated_robot/status')
        self.setpoint = running.probe.create_publisher(
            JointState, '/simulated_robot/joint_command', 100)
        self.efforts = running.probe.create_publisher(
            Float64MultiArray, '/simulated_robot/commands', 100)
        assert running.spin_until(lambda: self.setpoint.get_subscription_count()
                                  and self.efforts.get_subscription_count())
        assert running.connected()

    def command(self, position: Array, effort: Array = WEIGHT) -> JointState:
        """Return a setpoint at rest, executed at once."""
        message = conversions.joint_state(0, effort, position, np.zeros(6))
        message.header.stamp.sec = message.header.stamp.nanosec = 0
        return message

    def keep_sending(self, message: object, publisher: object, duration: float) -> None:
        """Publish at 50 Hz for a time [s]."""
        for _ in range(int(duration * 50)):
            publisher.publish(message)  # type: ignore[attr-defined]
            self.bench.spin_for(0.02)

    @property
    def position(self) -> Array:
        """Last measured drive positions [m]."""
        return np.array(self.states[-1].position)

    def says(self, code: str) -> Callable[[], bool]:
        """Return whether the status has ever had a code."""
        return lambda: code in [status['code'] for status in self.bench.status]


@pytest.fixture
def robot() -> Iterator[RobotBench]:
    with bench() as running:
        yield RobotBench(running)


def test_it_holds_at_home_and_publishes_at_500_hz(robot: RobotBench) -> None:
    assert robot.bench.spin_until(lambda: len(robot.states) > 300, 20)
    stamps = np.array([conversions.nanoseconds(state.header.stamp) for state in robot.states])
    assert np.median(np.diff(stamps)) == 2_000_000
    assert tuple(robot.states[-1].name) == DRIVES
    np.testing.assert_allclose(robot.position, REST, atol=1e-5)
    # The effort is what holds the weight, but for noise of 0.08 N.
    effort = np.mean([state.effort for state in robot.states[100:]], axis=0)
    np.testing.assert_allclose(effort, WEIGHT, atol=0.05)


def test_it_follows_setpoints_and_holds_when_they_stop(robot: RobotBench) -> None:
    goal = REST + np.array([0, 0, 0, 0.01, 0.01, 0.01])

    def is_there() -> bool:
        robot.keep_sending(robot.command(goal), robot.setpoint, 0.1)
        return bool(np.allclose(robot.position, goal, rtol=0, atol=5e-4))

    assert robot.bench.spin_until(is_there)
    assert robot.says('OK')()
    assert robot.bench.spin_until(robot.says('HOLD'))
    held = robot.position
    robot.bench.spin_for(0.5)
    np.testing.assert_allclose(robot.position, held, atol=5e-4)


@pytest.mark.parametrize(('change', 'words'), [
    ({'position': [float('nan')] * 6}, 'must be finite'),
    ({'name': ['a', 'b', 'c', 'd', 'e', 'f']}, 'must contain slide_1'),
    ({'velocity': []}, 'velocity has 0 values'),
    ({'position': [9.0] * 6}, 'would have to be at'),
])
def test_impossible_setpoints_are_refused_and_the_robot_stays(
    robot: RobotBench, change: dict[str, object], words: str,
) -> None:
    message = robot.command(REST)
    for field, value in change.items():
        setattr(message, field, value)
    robot.setpoint.publish(message)
    assert robot.bench.spin_until(robot.says('REFUSED'))
    refused = [status for status in robot.bench.status if status['code'] == 'REFUSED']
    assert words in refused[0]['message']
    robot.bench.spin_for(0.2)
    np.testing.assert_allclose(robot.position, REST, atol=1e-4)


def test_what_is_hidden_changes_while_it_runs(robot: RobotBench) -> None:
    """Switched on, changed and off over the service of parameters; what acts stays what it is."""
    call = robot.bench.probe.create_client(SetParameters, '/simulated_robot/set_parameters')
    assert robot.bench.spin_until(call.service_is_ready)

    def change(name: str, value: object) -> SetParametersResult:
        answer = call.call_async(SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]))
        assert robot.bench.spin_until(answer.done)
        return answer.result().results[0]

    assert change('injected_effects', ['effort_offset:lift_2']).successful
    assert change('injected_effects', ['effort_offset:lift_2', 'effort_offset:slide_1']).successful
    _, second = robot.node._robot.plant.injected
    assert change('injected_effects', ['effort_offset:slide_1']).successful
    assert robot.node._robot.plant.injected == [second]
    for name, value, words in (
        ('injected_effects', ['friction'], 'cannot be injected'),
        ('injected_effects', ['payload_mass:lift_1'], "does not act in 'lift_1'"),
        ('injected_effects', ['effort_offset:lift_9'], 'lift_9'),
        ('injected_effects', 'effort_offset', 'a list of words'),
        ('injected_scale', -1.0, 'at least 0'),
        ('bandwidth', 10.0, 'stay as it was at the start'),
        ('masses.payload', 2.0, 'stay as it was at the start'),
    ):
        answer = change(name, value)
        assert not answer.successful
        assert words in answer.reason
        assert len(answer.reason.splitlines()) == 1
    assert robot.node._robot.plant.injected == [second]
    assert change('injected_effects', []).successful
    assert robot.node._robot.plant.injected == []


def test_a_clock_that_is_set_back_does_not_stop_the_robot() -> None:
    with bench() as running:
        clock = running.probe.create_publisher(Clock, '/clock', 10)
        robot = RobotBench(running, use_sim_time=True)
        assert running.spin_until(clock.get_subscription_count)

        def run(first: float, last: float) -> list[int]:
            before = len(robot.states)
            for moment in np.arange(first, last, 0.02):
                clock.publish(Clock(clock=conversions.time(round(moment * 1e9))))
                running.spin_for(0.01)
            return [conversions.nanoseconds(state.header.stamp) for state in robot.states[before:]]

        run(500.0, 501.0)
        stamps = run(3.0, 5.0)
        # A thousand are due; a busy machine passes some over.
        assert len(stamps) > 20
        assert max(stamps[-10:]) < 5.1e9


def test_a_setpoint_replaces_what_waits_for_its_time_or_a_later_one() -> None:
    control = Mock()
    queue = SetpointQueue(control)
    old, new = Setpoint(REST), Setpoint(REST + 0.001)
    for moment, setpoint in ((1.0, old), (2.0, old), (1.0, new)):
        queue.add(moment, setpoint)
    queue.advance(1.5)
    control.command.assert_called_once_with(1.0, new, taken=1.5)
