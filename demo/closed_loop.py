# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robot in closed loop over topics: three processes, and what its platform makes of the path.

`play_trajectory` -> `feedforward` -> `simulated_robot`, as processes over DDS. This one listens to
the commands and to joint_states, and says how far the platform was from where it should have been.
Commands can be executed in simulated time as well, in which none is late and none is lost.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from ros_processes import environment, executable, node_process
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.paths import Excitation, HelicalPath, with_lead_in
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import find_file
from pprs_dynamics.ros.setpoints import SetpointQueue
from pprs_dynamics.simulation.drive_control import Setpoint
from pprs_dynamics.simulation.plant import Plant
from pprs_dynamics.simulation.simulated_robot import BANDWIDTH, DAMPING_RATIO, SimulatedRobot

LEAD_IN = 2.0  # [s] from the home pose to the path's start, not counted
AHEAD = 0.05  # [s] that each pose is sent before its moment, as a trajectory controller is fed
RATE = 200.0  # [Hz]
STATE_RATE = 500.0  # of joint_states [Hz], as simulated_robot has it by default
SEED = 0  # of the robot's noise and injected effects
SETTLE = 1.0  # [s] for discovery, which is one-sided
PATIENCE = 30.0  # [s] beyond the path's own time


@dataclass(frozen=True)
class Case:
    """What the robot is driven with.

    Parameters
    ----------
    name : str
    feedforward : {'none', 'rigid_body', 'friction'}
        'none' is the gravity-compensated PD loop alone.
    hidden : tuple of str
        Effects in the robot that the model does not know of.
    model : path
        Model file of the feedforward; of the paper's robot by default.
    """

    name: str
    feedforward: str
    hidden: tuple[str, ...] = ()
    model: Path = field(default_factory=lambda: find_file('config/paper.yaml'))


CASES = (
    Case('PD alone', 'none'),
    Case('rigid-body feedforward', 'rigid_body'),
    Case('friction-compensated feedforward', 'friction'),
)


@dataclass(frozen=True)
class Tracking:
    """How the platform followed.

    Parameters
    ----------
    time : (N,) array
        Since the path's start [s].
    position_error : (N, 3) array
        [m]
    angle_error : (N,) array
        [rad]
    late_share : float
        Share of the robot's cycles that were late.
    commands, states : (K, 19), (L, 19) arrays
        Time [s], then positions, velocities and efforts of the drives: commanded, and from
        joint_states; the lead-in is among them.
    """

    time: np.ndarray
    position_error: np.ndarray
    angle_error: np.ndarray
    late_share: float
    commands: np.ndarray
    states: np.ndarray

    @property
    def position_rms(self) -> float:
        """Root of the mean squared distance [m]."""
        return float(np.sqrt(np.mean(np.sum(self.position_error ** 2, axis=1))))

    @property
    def angle_rms(self) -> float:
        """Root of the mean squared angle [rad]."""
        return float(np.sqrt(np.mean(self.angle_error ** 2)))

    def recording(self, name: str) -> Recording:
        """Return joint_states of the run, from its first command to its last."""
        inside = ((self.states[:, 0] >= self.commands[0, 0])
                  & (self.states[:, 0] <= self.commands[-1, 0]))
        time, position, velocity, effort = _columns(self.states[inside])
        return Recording.from_arrays(name, time, position, velocity, effort)


def run_case(
    case: Case, path: Sequence[str], duration: float, domain: int, folder: Path,
) -> Tracking:
    """Run one case and return how the platform followed.

    Parameters
    ----------
    case : Case
    path : sequence of str
        Parameters of play_trajectory, e.g. ['source:=helix'].
    duration : float
        Of the path [s].
    domain : int
        ROS domain, which must be this process's too.
    folder : path
        For the nodes' logs.
    """
    os.environ.update({name: value for name, value in environment(domain).items()
                       if name.startswith('ROS_')})
    player = [f'rate:={RATE}', f'lead_in:={LEAD_IN}', f'ahead:={AHEAD}', *path]
    with _Listener() as listener, ExitStack() as nodes:
        for name, command in (('robot', _robot(case)), ('feedforward', _feedforward(case))):
            nodes.enter_context(node_process(command, domain, folder / f'{name}.log'))
        listener.wait_for_nodes()
        nodes.enter_context(node_process(
            _command('play_trajectory', player), domain, folder / 'player.log'))
        listener.spin_until(LEAD_IN + duration, PATIENCE)
    return listener.tracking()


def commands_for(case: Case, path: HelicalPath | Excitation) -> np.ndarray:
    """Return the commands that are published for a path, (K, 19) as in `Tracking`."""
    times = np.arange(0.0, path.duration + 1 / RATE, 1 / RATE)
    motion = with_lead_in(path.motion(times), LEAD_IN, RATE)
    forces = DriveModel.load(case.model).drive_forces(motion)
    effort = forces.parts['rigid_body'] if case.feedforward == 'rigid_body' else forces.total
    return np.column_stack((np.arange(len(motion)) / RATE, forces.mechanism.position,
                            forces.mechanism.velocity, effort))


def execute(case: Case, commands: np.ndarray) -> Tracking:
    """Execute commands in simulated time, and return how they were followed.

    Parameters
    ----------
    case : Case
        Of which only what is in the robot counts, and whether it takes efforts.
    commands : (K, 19) array
        As in `Tracking`.
    """
    plant = Plant(DriveModel.load(), case.hidden, SEED)
    robot = SimulatedRobot(plant, seed=SEED, control=plant.gains(
        BANDWIDTH, DAMPING_RATIO, gravity_compensation=case.feedforward == 'none'))
    queue = SetpointQueue(robot.control)
    for time_s, position, velocity, effort in zip(*_columns(commands), strict=True):
        wanted = (position, velocity) if case.feedforward == 'none' else (
            position, velocity, effort)
        queue.add(time_s - commands[0, 0], Setpoint(*wanted))
    states = []
    for tick in range(int((commands[-1, 0] - commands[0, 0]) * STATE_RATE)):
        queue.advance(tick / STATE_RATE)
        measured = robot.tick()
        states.append([measured.time + commands[0, 0], *measured.position, *measured.velocity,
                       *measured.effort])
    return _tracking(commands, np.array(states), 0.0)


def _robot(case: Case) -> list[str]:
    parameters = [f'use_effort:={"false" if case.feedforward == "none" else "true"}',
                  f'seed:={SEED}', 'command_timeout:=0.2']
    if case.hidden:
        parameters.append(f'injected_effects:=[{",".join(case.hidden)}]')
    return _command('simulated_robot', parameters)


def _feedforward(case: Case) -> list[str]:
    files = ['--params-file', str(case.model)]
    if case.feedforward == 'rigid_body':
        files += ['--params-file', str(find_file('config/without_friction.yaml'))]
    remapped = ['-r', '~/joint_command:=/simulated_robot/joint_command']
    # No timeout: a player that stalls on a busy machine must not add a command.
    return [executable('feedforward'), '--ros-args', *files, '-p', 'command_timeout:=0.0',
            *remapped]


def _command(name: str, parameters: Sequence[str]) -> list[str]:
    return [executable(name), '--ros-args',
            *(word for parameter in parameters for word in ('-p', parameter))]


class _Listener:
    """Keeps commands and joint states while the block lasts."""

    def __enter__(self) -> _Listener:
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from sensor_msgs.msg import JointState
        from std_msgs.msg import String

        from pprs_dynamics.ros.node.qos import LATCHED

        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node('listener', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        # Bytes, to be looked at when all is over: the nodes need the processor now.
        self.commands: list[bytes] = []
        self.states: list[bytes] = []
        self.status = '{}'
        self.subscriptions = [
            self.node.create_subscription(JointState, topic, kept.append, 1000, raw=True)
            for topic, kept in (('/simulated_robot/joint_command', self.commands),
                                ('/joint_states', self.states))]
        self.subscriptions += [
            self.node.create_subscription(String, '/simulated_robot/status', self._keep, LATCHED)]
        return self

    def __exit__(self, *error: object) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def _keep(self, message: Any) -> None:
        self.status = message.data

    def wait_for_nodes(self) -> None:
        """Spin until the robot speaks and its commander is seen.

        The mere sight of a robot proves nothing: one that was killed is seen for a while.
        """
        deadline = time.monotonic() + PATIENCE
        while not (self.states and self.subscriptions[0].get_publisher_count()):
            if time.monotonic() > deadline:
                raise TimeoutError('the nodes did not appear')
            self.executor.spin_once(timeout_sec=0.05)
        end = time.monotonic() + SETTLE
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.05)

    def spin_until(self, path_time: float, patience: float) -> None:
        """Spin until the states reach the path's end."""
        deadline = time.monotonic() + path_time + patience
        while time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.05)
            if self.commands and self.states and (
                    _row(self.states[-1])[0] > _row(self.commands[0])[0] + path_time):
                return
        raise TimeoutError(f'{len(self.commands)} commands and {len(self.states)} states came')

    def tracking(self) -> Tracking:
        """Return the platform's errors over the path, the lead-in left out."""
        import json

        counters = json.loads(self.status)['counters']
        commands, states = (np.array([_row(data) for data in kept])
                            for kept in (self.commands, self.states))
        return _tracking(commands, states, counters['late'] / max(counters['cycles'], 1))


def _tracking(commands: np.ndarray, states: np.ndarray, late_share: float) -> Tracking:
    inside = (states[:, 0] > commands[0, 0] + LEAD_IN) & (states[:, 0] < commands[-1, 0])
    sent, positions, velocities, _ = _columns(commands)
    times, measured, _, _ = _columns(states[inside])
    robot, rest = DriveModel.load().robot, np.zeros_like(measured)
    wanted = CubicHermiteSpline(sent, positions, velocities)(times)
    goal, found = (robot.at(q, rest, rest).frame_of('platform') for q in (wanted, measured))
    turn = (Rotation.from_matrix(goal.R).inv() * Rotation.from_matrix(found.R)).magnitude()
    return Tracking(times - sent[0] - LEAD_IN, found.p - goal.p, turn, late_share,
                    commands, states)


def _columns(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return times, positions, velocities and efforts of rows."""
    count = len(DRIVES)
    time_s, position, velocity, effort = np.split(
        rows, (1, 1 + count, 1 + 2 * count), axis=1)
    return time_s[:, 0], position, velocity, effort


def _row(data: bytes) -> list[float]:
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import JointState

    message = deserialize_message(data, JointState)
    stamp = message.header.stamp
    return [stamp.sec % 1_000_000 + stamp.nanosec * 1e-9, *message.position, *message.velocity,
            *message.effort]
