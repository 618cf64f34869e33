# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A node process that ends, or whose simulation is slow, in the middle of a path."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from node_bench import Bench, bench
from ros_processes import executable, node_process
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros.messages import conversions

pytestmark = pytest.mark.nodes

MODEL = DriveModel.load()
PATH = HelicalPath()
STEP = 0.05  # [s]
NEAR = 1e-3  # [m] between the path and a straight line over 1 ms of it


def feedforward(*arguments: str) -> list[str]:
    """Return the command of a node that takes messages of any age: a busy machine delays them."""
    return [executable('feedforward'), '--ros-args', '-p', 'demo:=true', '-p', 'max_age:=0.0',
            *arguments]


class Cell:
    """A process of feedforward, who sends to it, and what it sends to controllers."""

    def __init__(self, running: Bench) -> None:
        self.bench = running
        self.trajectories = running.listen(JointTrajectory, '/feedforward/joint_trajectory')
        self.commands = running.listen(Float64MultiArray, '/feedforward/commands')
        self.setpoints = running.listen(JointState, '/feedforward/joint_command')
        self.publisher = running.probe.create_publisher(
            MultiDOFJointTrajectory, '/feedforward/trajectory', 10)
        running.follow_status('/feedforward/status')

    def send(self, first: float, last: float, start: int) -> None:
        """Ask for the part of the path between two times [s], from a stamp [ns] on."""
        times = np.arange(first, last, STEP)
        self.publisher.publish(conversions.write_trajectory(
            PATH.motion(times), conversions.time(start),
            [round((moment - first) * 1e9) for moment in times]))

    def clock_stands(self) -> bool:
        """Return whether the node has said that ROS time does not advance."""
        return any(status['code'] == 'STALE' and 'ROS time does not advance' in status['message']
                   for status in self.bench.status)

    def ready(self) -> None:
        assert self.bench.spin_until(self.publisher.get_subscription_count)
        assert self.bench.connected()


@pytest.fixture
def cell() -> Iterator[Cell]:
    with bench() as running:
        yield Cell(running)


def on_the_path(first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions of the drives along the path, and the efforts that hold them there."""
    motion = PATH.motion(np.arange(first, last, 0.001))
    rest = PlatformMotion.at_rest(motion.position, motion.orientation)
    forces = MODEL.drive_forces(rest)
    return forces.mechanism.position, forces.total


def stop(cell: Cell, ros_domain: int, log: Path, last: float) -> None:
    """Stop the process in the middle of a path that ends at a time [s]."""
    with node_process(feedforward(), ros_domain, log):
        cell.ready()
        cell.send(1.0, last, cell.bench.probe.get_clock().now().nanoseconds)
        assert cell.bench.spin_until(lambda: cell.trajectories and cell.setpoints)
        cell.bench.spin_for(0.8)
    assert cell.bench.spin_until(lambda: len(cell.commands) == 2)
    cell.bench.spin_for(0.5)


def check_held(cell: Cell, first: float, last: float, begin: float = 1.0) -> None:
    """Check that efforts hold a pose of the path between two times [s], and setpoints stay."""
    _, efforts = on_the_path(first, last)
    assert np.abs(efforts - np.array(cell.commands[-1].data)).max(axis=1).min() < 0.02  # [N]
    # Who follows single setpoints has got but one, and is where that said.
    given, kept = cell.setpoints
    np.testing.assert_allclose(kept.position, given.position, rtol=0, atol=1e-9)
    assert not any(kept.velocity)
    there = on_the_path(begin, begin + 0.001)[1][0]
    np.testing.assert_allclose(kept.effort, there, rtol=0, atol=1e-6)


def test_a_controller_completes_a_trajectory_that_ends_at_rest(
    cell: Cell, ros_domain: int, tmp_path: Path,
) -> None:
    stop(cell, ros_domain, tmp_path / 'log', PATH.duration + 0.1)
    assert len(cell.trajectories) == 1  # of the message alone
    assert not any(cell.trajectories[0].points[-1].velocities)
    check_held(cell, 1.3, PATH.duration - 0.5)


def test_a_controller_whose_trajectory_ends_in_motion_is_stopped_along_the_path(
    cell: Cell, ros_domain: int, tmp_path: Path,
) -> None:
    stop(cell, ros_domain, tmp_path / 'log', 4.5)
    given, end = cell.trajectories
    assert any(given.points[-1].velocities)
    places, efforts = on_the_path(1.0, PATH.duration)
    nearest = []
    for point in end.points:
        away = np.abs(places - np.array(point.positions)).max(axis=1)
        nearest.append(int(away.argmin()))
        assert away.min() < NEAR
    assert nearest == sorted(nearest)
    assert not any(end.points[-1].velocities)
    assert not any(end.points[-1].accelerations)
    assert np.abs(efforts[nearest[-1]] - np.array(end.points[-1].effort)).max() < 0.02  # [N]
    times = [conversions.nanoseconds(point.time_from_start) for point in end.points]
    assert np.all(np.diff(times) > 0)
    # From the speed of the path where the stop begins.
    speed = MODEL.drive_forces(PATH.motion([1.0 + 0.001 * nearest[0]])).mechanism.velocity[0]
    assert np.abs(end.points[0].velocities - speed).max() < 0.3 * np.abs(speed).max()
    check_held(cell, 1.3, PATH.duration)


class SimulatedClock:
    """ROS time [s] of a simulator: it advances only when told, however busy the machine is."""

    def __init__(self, running: Bench, start: float) -> None:
        self.bench, self.now = running, start
        self.publisher = running.probe.create_publisher(Clock, '/clock', 10)

    def tick(self, step: float, period: float) -> None:
        """Publish a time that is later by a step, and spin for a period of real time."""
        self.now += step
        self.publisher.publish(Clock(clock=conversions.time(round(self.now * 1e9))))
        self.bench.spin_for(period)

    def heard(self) -> bool:
        """Publish the same time until the node's status no longer says that no clock comes."""
        for _ in range(400):
            if self.bench.status and self.bench.status[-1]['code'] != 'CLOCK':
                return True
            self.tick(0.0, 0.05)
        return False


# [s] between messages of a slow simulator, or of one on a busy machine: more than the timeout.
SELDOM = 0.3


@pytest.mark.parametrize('stands', [False, True], ids=['half as fast', 'stands'])
def test_a_simulation_slower_than_real_time_keeps_to_the_path(
    cell: Cell, ros_domain: int, tmp_path: Path, stands: bool,
) -> None:
    clock = SimulatedClock(cell.bench, 100.0)
    with node_process(feedforward('-p', 'use_sim_time:=true'), ros_domain, tmp_path / 'log'):
        cell.ready()
        assert clock.heard()
        # A machine that loads kernels, or another process, may let the node stand still itself.
        assert cell.bench.spin_until(lambda: not cell.bench.status[-1]['preparing'])
        lasts = PATH.duration + 0.1 - 3.0  # 1.8 s of simulated time
        for _ in range(5):
            for received in (cell.trajectories, cell.commands, cell.setpoints, cell.bench.status):
                received.clear()
            start = clock.now
            cell.send(3.0, PATH.duration + 0.1, round(start * 1e9))
            assert cell.bench.spin_until(lambda: cell.setpoints)
            while clock.now - start < 0.4:
                clock.tick(0.02, 0.02)
            if stands:
                # Whoever follows single commands is held where the path was when the clock stopped.
                assert cell.bench.spin_until(lambda: len(cell.commands) == 2)
                assert cell.bench.spin_until(cell.clock_stands)
                where = 3.0 + clock.now - start
                check_held(cell, where - 0.02, where + 0.02, begin=3.0)
                assert len(cell.trajectories) == 1
                return
            while clock.now - start < lasts - 0.1:
                clock.tick(0.5 * SELDOM, SELDOM)
            if not cell.clock_stands():  # by a node that heard nothing for a second
                break
        # In the middle of the path nothing but the answer to the message has gone out.
        assert [len(messages) for messages in (cell.commands, cell.setpoints, cell.trajectories)
                ] == [1, 1, 1]
        while len(cell.commands) == 1 and clock.now - start < 2 * lasts:
            clock.tick(0.5 * SELDOM, SELDOM)
        assert len(cell.commands) == 2
        assert clock.now - start > lasts
