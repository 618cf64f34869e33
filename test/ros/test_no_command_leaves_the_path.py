# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A node process that ends, or whose simulation is slow, in the middle of a path."""

from __future__ import annotations

import time
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

    def ready(self) -> None:
        assert self.bench.spin_until(self.publisher.get_subscription_count, 20)
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


def distance(position: np.ndarray, places: np.ndarray) -> float:
    return float(np.abs(places - position).max(axis=1).min())


def stopped(cell: Cell, ros_domain: int, log: Path, last: float) -> float:
    """Stop the process in the middle of a path, and return where on it [s]."""
    command = [executable('feedforward'), '--ros-args', '-p', 'demo:=true']
    with node_process(command, ros_domain, log):
        cell.ready()
        began = time.monotonic()
        cell.send(1.0, last, cell.bench.probe.get_clock().now().nanoseconds)
        assert cell.bench.spin_until(lambda: cell.trajectories and cell.setpoints)
        cell.bench.spin_for(0.8)
        where = 1.0 + time.monotonic() - began
    assert cell.bench.spin_until(lambda: len(cell.commands) == 2)
    cell.bench.spin_for(0.5)
    return where


def check_held(cell: Cell, where: float) -> None:
    """Check that what goes out for drives without a trajectory belongs to a pose on the path."""
    near, efforts = on_the_path(where - 0.05, where + 0.3)
    assert distance(np.array(cell.setpoints[-1].position), near) < NEAR
    assert distance(np.array(cell.commands[-1].data), efforts) < 0.02  # [N]


def test_a_controller_completes_a_trajectory_that_ends_at_rest(
    cell: Cell, ros_domain: int, tmp_path: Path,
) -> None:
    where = stopped(cell, ros_domain, tmp_path / 'log', PATH.duration + 0.1)
    assert len(cell.trajectories) == 1  # of the message alone
    assert not any(cell.trajectories[0].points[-1].velocities)
    check_held(cell, where)


def test_a_controller_whose_trajectory_ends_in_motion_is_stopped_along_the_path(
    cell: Cell, ros_domain: int, tmp_path: Path,
) -> None:
    where = stopped(cell, ros_domain, tmp_path / 'log', 3.0)
    given, stop = cell.trajectories
    assert any(given.points[-1].velocities)
    places, efforts = on_the_path(where - 0.05, where + 0.5)
    for point in stop.points:
        assert distance(np.array(point.positions), places) < NEAR
    assert not any(stop.points[-1].velocities)
    assert not any(stop.points[-1].accelerations)
    assert distance(np.array(stop.points[-1].effort), efforts) < 0.02
    times = [conversions.nanoseconds(point.time_from_start) for point in stop.points]
    assert np.all(np.diff(times) > 0)
    # From the speed of the path at the place of the stop.
    speed = MODEL.drive_forces(PATH.motion([where, where + 0.15])).mechanism.velocity
    assert np.abs(stop.points[0].velocities - speed).max(axis=1).min() < 0.3 * np.abs(speed).max()
    check_held(cell, where)


@pytest.mark.parametrize('factor', [0.5, 0.0], ids=['half as fast', 'stands'])
def test_a_simulation_slower_than_real_time_keeps_to_the_path(
    cell: Cell, ros_domain: int, tmp_path: Path, factor: float,
) -> None:
    began = time.monotonic()
    factors = {'now': 1.0}
    past = {'simulated': 100.0, 'real': began}

    def simulated() -> float:
        now = time.monotonic()
        past['simulated'] += factors['now'] * (now - past['real'])
        past['real'] = now
        return past['simulated']

    clock = cell.bench.probe.create_publisher(Clock, '/clock', 10)
    timer = cell.bench.probe.create_timer(
        0.01, lambda: clock.publish(Clock(clock=conversions.time(round(simulated() * 1e9)))))
    command = [executable('feedforward'), '--ros-args', '-p', 'demo:=true', '-p',
               'use_sim_time:=true']
    with node_process(command, ros_domain, tmp_path / 'log'):
        cell.ready()
        start = simulated()
        cell.send(3.0, PATH.duration + 0.1, round(start * 1e9))  # 1.8 s of simulated time
        assert cell.bench.spin_until(lambda: cell.setpoints)
        cell.bench.spin_for(0.4)
        factors['now'] = factor
        if factor:
            cell.bench.spin_for(2.2)
            passed = simulated() - start
            assert 1.2 < passed < 1.75
            # In the middle of the path nothing but the answer to the message has gone out.
            assert [len(each) for each in (cell.commands, cell.setpoints, cell.trajectories)
                    ] == [1, 1, 1]
            assert cell.bench.spin_until(lambda: len(cell.commands) == 2, 3.0)
            assert simulated() - start > PATH.duration + 0.1 - 3.0
        else:
            # Whoever follows single commands is held where the path was when the clock stopped.
            assert cell.bench.spin_until(lambda: len(cell.commands) == 2, 3.0)
            assert cell.bench.spin_until(lambda: cell.bench.status[-1]['code'] == 'STALE')
            assert 'the clock has stood still' in cell.bench.status[-1]['message']
            check_held(cell, 3.0 + simulated() - start - 0.05)
            assert len(cell.trajectories) == 1
    timer.cancel()
