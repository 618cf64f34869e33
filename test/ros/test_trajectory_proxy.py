# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What trajectory_proxy passes on, refuses and holds; the relay has tests of its own."""

from __future__ import annotations

import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from control_msgs_stand_in import FollowJointTrajectory, install
from controller_rules import ControllerSettings, objection
from model_recordings import with_effects
from node_bench import Bench, bench, overrides
from rclpy.action import GoalResponse
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros.messages import conversions

pytestmark = pytest.mark.nodes

MODEL = DriveModel.load()
ALONG = np.linspace(0.0, HelicalPath.duration, 48)  # [s] of a path from rest to rest
PATH = MODEL.drive_forces(HelicalPath().motion(ALONG))
POSE = HelicalPath().motion([1.0]).held()
HELD = MODEL.drive_forces(POSE)


class Relay:
    """In place of the connection to a controller, which ends each goal at once."""

    def __init__(self, status: int) -> None:
        self.status, self.is_idle, self.goals = status, True, list[Any]()

    async def accepted(self, handle: Any, goal: Any, duration: float) -> Any:
        self.goals.append(goal)
        return SimpleNamespace(sent_at=time.time_ns())

    async def finished(self, watched: Any) -> Any:
        return SimpleNamespace(status=self.status, result=FollowJointTrajectory.Result())


class Handle:
    """Of a goal that a client has sent."""

    is_cancel_requested = False

    def __init__(self, goal: Any) -> None:
        self.request, self.ended = goal, ''

    def succeed(self) -> None:
        self.ended = 'succeeded'

    def abort(self) -> None:
        self.ended = 'aborted'


class Cell:
    """The node and what it sends."""

    def __init__(self, running: Bench, node: Any, status: int) -> None:
        self.bench, self.node = running, node
        self.relay = node._relay = Relay(status)
        self.held = running.listen(JointTrajectory, '/arm/joint_trajectory')
        running.follow_status('/trajectory_proxy/status')
        assert running.connected()

    def execute(self, goal: Any) -> tuple[str, Any]:
        """Return how a goal ends, and its result."""
        handle = Handle(goal)
        with pytest.raises(StopIteration) as ended:
            self.node._execute(handle).send(None)
        return handle.ended, ended.value.value

    def state(self, velocity: Any = 0.0, times: int = 3, scaling: float = 1.0) -> None:
        """Tell the node what a controller says that is at the pose."""
        reference = SimpleNamespace(positions=HELD.drive_motion[0][0].tolist(),
                                    velocities=(np.ones(6) * velocity).tolist())
        for _ in range(times):
            self.node._on_controller(SimpleNamespace(
                joint_names=list(DRIVES), reference=reference, speed_scaling_factor=scaling,
                output=SimpleNamespace(effort=[0.0] * 6)))
        self.bench.spin_for(0.3)


@pytest.fixture
def cell(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[Cell]:
    """A cell whose controller ends each goal with the status that is the parameter."""
    install(monkeypatch)
    from pprs_dynamics.ros.trajectory_proxy import TrajectoryProxyNode

    with bench() as running:
        node = running.add(TrajectoryProxyNode, parameter_overrides=overrides(
            action='/arm/follow_joint_trajectory'))
        yield Cell(running, node, getattr(request, 'param', GoalStatus.STATUS_SUCCEEDED))


def goal(offsets: Any, position: Any, velocity: Any, acceleration: Any) -> Any:
    """Return a goal of drives."""
    trajectory = JointTrajectory(joint_names=list(DRIVES), points=[
        JointTrajectoryPoint(time_from_start=conversions.duration(round(offset * 1e9)),
                             positions=q.tolist(), velocities=v.tolist(), accelerations=a.tolist())
        for offset, q, v, a in zip(offsets, position, velocity, acceleration, strict=True)])
    return FollowJointTrajectory.Goal(trajectory=trajectory)


def test_a_goal_reaches_the_controller_with_its_efforts(cell: Cell) -> None:
    # All but the end, so that it can be reached at once.
    asked = goal(ALONG / 1e3, *PATH.drive_motion)
    assert cell.node._accept(asked) == GoalResponse.ACCEPT
    cell.execute(goal(ALONG, *PATH.drive_motion))
    taken = cell.relay.goals[0].trajectory
    efforts = np.array([point.effort for point in taken.points])
    np.testing.assert_allclose(efforts[:-1], PATH.total, atol=1e-6)
    # The path ends accelerated: what a controller holds afterwards has no inertia.
    resting = MODEL.drive_forces(HelicalPath().motion(ALONG[-1:]).held()).total[0]
    np.testing.assert_allclose(efforts[-1], resting, atol=1e-6)
    assert np.abs(efforts[-1] - PATH.total[-1]).max() > 0.1
    assert list(taken.points[-1].positions) == list(taken.points[-2].positions)
    assert objection(taken, ControllerSettings(DRIVES), 0) == ''


def test_effects_with_memory_act_along_a_goal_of_drives(cell: Cell) -> None:
    warming = with_effects(MODEL, {'friction_drift': {'slide_1.force': 5.0, 'slide_1.time': 0.5}})
    wanted = warming.drive_forces(HelicalPath().motion(ALONG)).total
    asked = cell.node._request(warming, goal(ALONG, *PATH.drive_motion))
    np.testing.assert_allclose(warming.drive_forces(asked.motion).total, wanted, atol=1e-6)
    assert np.abs(wanted - PATH.total).max() > 1.0


def test_a_goal_that_breaks_a_rule_is_refused_when_it_is_asked(cell: Cell) -> None:
    found = MODEL.drive_forces(HelicalPath().motion([1.0, 1.1])).drive_motion
    for joint, stamp, moving, far, code, said in (
            ('a', 0, False, 0.0, 'NAMES', 'must contain each'),
            (DRIVES[0], 5, False, 0.0, 'TIME', 'ended'),
            (DRIVES[0], 0, False, 5.0, 'WORKSPACE', ''),
            (DRIVES[0], 0, True, 0.0, 'LIMIT', 'in motion')):
        asked = goal((0.1, 0.2), found[0] + far, found[1] * moving, found[2])
        asked.trajectory.joint_names[0] = joint
        asked.trajectory.header.stamp.sec = stamp
        assert cell.node._accept(asked) == GoalResponse.REJECT
        assert cell.bench.spin_until(lambda code=code: cell.bench.status[-1]['code'] == code)
        assert said in cell.bench.status[-1]['message']
    assert cell.relay.goals == []


@pytest.mark.parametrize('scaling', [1.0, np.inf, 1e300, np.nan])
def test_a_goal_that_is_reached_too_early_was_replaced(cell: Cell, scaling: float) -> None:
    cell.state(scaling=scaling, times=1)
    ended, result = cell.execute(goal(ALONG, *PATH.drive_motion))
    assert ended == 'aborted'
    assert result.error_code == FollowJointTrajectory.Result.PATH_TOLERANCE_VIOLATED
    assert 'followed another trajectory' in result.error_string


@pytest.mark.parametrize('cell', [GoalStatus.STATUS_ABORTED], indirect=True)
def test_after_an_aborted_goal_the_pose_is_held_with_gravity(cell: Cell) -> None:
    assert cell.execute(goal((0.2,), *HELD.drive_motion))[0] == 'aborted'
    cell.state(velocity=0.1)
    assert cell.held == []
    cell.relay.is_idle = False  # in the middle of the next goal
    cell.state()
    assert cell.held == []
    cell.relay.is_idle = True
    cell.state()
    message, = cell.held
    point, = message.points
    np.testing.assert_allclose(point.effort, HELD.total[0], atol=1e-6)
    np.testing.assert_allclose(point.positions, HELD.drive_motion[0][0], atol=1e-9)
    assert not any(point.velocities)
    assert objection(message, ControllerSettings(DRIVES), 0) == ''


def test_a_proxy_that_has_passed_nothing_on_stops_no_controller(cell: Cell) -> None:
    """As one that is started beside a controller that moves, or is moved by others."""
    cell.state(velocity=0.3)
    cell.state()
    time.sleep(1.2)  # a silence of the controller
    cell.state()
    assert cell.held == []
