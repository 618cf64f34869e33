# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the controllers of ros2_control do with what the nodes send, and what the nodes say of it.

    python -m benchmarks.cell.controllers [CASE ...] [--json FILE]

Runs where ros2_control, ros2_controllers and this package are installed and sourced; builds
nothing. Hardware is the mock of ros2_control, which is where it is commanded to be; the case `loop`
closes a loop through simulated_robot and needs joint_state_topic_hardware_interface, too.
"""

from __future__ import annotations

import argparse
import json
import signal
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from builtin_interfaces.msg import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from benchmarks.cell.cell import TOPICS, Cell, Efforts, States, cell, configured
from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.paths import HelicalPath

JTC, FORWARD, BROADCASTER = ('joint_trajectory_controller', 'forward_command_controller',
                             'joint_state_broadcaster')
VERSIONS = ('controller_manager', JTC, FORWARD, BROADCASTER)
PASSED_ON = ('position', 'effort')  # command interfaces: a drive's own loop, and the feedforward
STOP_TIME = 0.1  # [s] by default of feedforward.launch.py
DROPPED = {'late': 'ends in the past', 'moves at the end': 'Velocity of last trajectory point',
           'efforts': 'Trajectories with effort fields', 'joints': "don't match the controller"}
ENDED_BY = {'killed': signal.SIGKILL, 'stopped': signal.SIGSTOP}
SAME = 1e-9  # [N] commands that are that near are one
NEAR = 0.05  # [N] of the gravity: that near it is held
HALF_WAY = 2.0  # [s] into the path, where streams and goals are broken off
CAUGHT_UP = 0.01  # [s] that a state of simulated_robot may be old before a loop is closed
DEADLINE = 60.0  # [s] for a path of 4.73 s on a busy machine


def at_start(names: tuple[str, ...] = DRIVES) -> dict[str, float]:
    """Return joints and where they are at the beginning of the path."""
    found = DriveModel.load().drive_forces(HelicalPath().motion([0.0]))
    return dict(zip(names, found.drive_motion[0][0].tolist(), strict=True))


def gravity_of(position: Array) -> Array:
    """Return what holds the drives at rest at positions (6,), which need not be on the path."""
    model, rest = DriveModel.load(), np.zeros((1, len(DRIVES)))
    motion = JointMotion(position[None], rest, rest)
    return np.asarray(model.drive_forces(motion).total[0])


def beside(running: Cell, controller: str = JTC, **parameters: Any) -> list[dict[str, Any]]:
    """Start feedforward as its launch file does, and return what it says."""
    status = running.status('feedforward')
    running.start('feedforward', '-r', f'~/commands:=/{controller}/commands',
                  '-r', f'~/joint_trajectory:=/{controller}/joint_trajectory',
                  **{'demo': True, 'stop_time': STOP_TIME, **parameters})
    running.wait(lambda: status and status[-1]['code'] == 'WAITING', 'feedforward')
    return status


def played(running: Cell, **parameters: Any) -> float:
    """Play the path to its end and return when it began [s]."""
    began = time.monotonic()
    process = running.start('play_trajectory', **parameters)
    running.wait(lambda: process.poll() is not None, 'play_trajectory', DEADLINE)
    running.spin(0.5)
    return began


def codes(status: list[dict[str, Any]], since: float) -> str:
    """Return in words which codes a node has said since a moment, and the first reason."""
    found = [entry for entry in status if entry['at'] >= since]
    first = next((entry for entry in found if entry['code'] == 'CONTROLLER'), None)
    order = list(dict.fromkeys(entry['code'] for entry in found))
    return ' '.join(order) + (f': {first["message"].rpartition("follow: ")[2]}' if first else '')


def trajectory_cell(running: Cell, interfaces: tuple[str, ...] = PASSED_ON,
                    extra: Mapping[str, float] | None = None, **changed: Any) -> States:
    """Start a joint_trajectory_controller by the file that users copy, and follow its state."""
    joints = {**at_start(), **(extra or {})}
    running.manage(configured(JTC, command_interfaces=list(interfaces), joints=list(joints),
                              **changed), joints, interfaces)
    states = States(running, JTC, DRIVES)
    running.activate(BROADCASTER, JTC)
    return states


# --- cases --------------------------------------------------------------------------------------

def forward(rate: float) -> dict[str, Any]:
    """Return how many commands of feedforward arrive at the drives' effort interface."""
    with cell() as running:
        running.manage(configured(FORWARD), at_start())
        seen, sent = Efforts(running, DRIVES), list[Array]()
        running.listen(Float64MultiArray, f'/{FORWARD}/commands',
                       lambda message: sent.append(np.array(message.data)))
        running.activate(BROADCASTER, FORWARD)
        status = beside(running, FORWARD)
        began = played(running, rate=rate)
        arrived = np.array(seen.rows)
        found = sum(bool((np.abs(arrived - point).max(axis=1) < SAME).any()) for point in sent)
        return {'sent': len(sent), 'seen at the drives': found, 'status': codes(status, began)}


def stream(rate: float = 100.0, interfaces: tuple[str, ...] = PASSED_ON,
           extra: Mapping[str, float] | None = None, stop_time: float = STOP_TIME,
           changed: Mapping[str, Any] | None = None, **parameters: Any) -> dict[str, Any]:
    """Return how many messages of a path a joint_trajectory_controller drops, and the status."""
    with cell() as running:
        trajectory_cell(running, interfaces, extra, **(changed or {}))
        sent: list[float] = []
        running.listen(JointTrajectory, f'/{JTC}/joint_trajectory',
                       lambda message: sent.append(time.monotonic()))
        status = beside(running, stop_time=stop_time)
        running.spin(1.0)
        sent.clear()
        began = played(running, rate=rate, **parameters)
        dropped = {name: count for name, words in DROPPED.items()
                   if (count := running.said(words, began))}
        return {'sent': len(sent), 'dropped': dropped or 0, 'status': codes(status, began)}


def broken(**changed: Any) -> dict[str, Any]:
    """Return what the controller holds after a stream was killed half way."""
    with cell() as running:
        states = trajectory_cell(running, **changed)
        status = beside(running)
        process = running.start('play_trajectory')
        running.wait(lambda: status[-1]['code'] == 'OK', 'commands')
        running.spin(HALF_WAY)
        process.send_signal(signal.SIGKILL)
        killed = time.monotonic()
        running.spin(2.5)
        when, position, velocity, effort = states.since(killed)
        gravity = gravity_of(position[-1])
        moving = np.abs(velocity).max(axis=1) > 1e-9
        return {
            'at rest after [s]': round(float(when[moving].max(initial=0.0)), 3),
            'gravity from [s]': held_from(when, effort, gravity),
            'efforts at the end [N]': rounded(effort[-1]), 'gravity [N]': rounded(gravity),
            'status': codes(status, killed)}


def activation(**changed: Any) -> dict[str, Any]:
    """Return for how long a controller that becomes active holds without gravity."""
    with cell() as running:
        states = trajectory_cell(running, **changed)
        beside(running)
        found = []
        running.spin(1.0)
        for _ in range(3):
            running.switch(deactivate=[JTC])
            running.spin(1.5)
            began = time.monotonic()
            running.switch(activate=[JTC])
            running.spin(1.0)
            when, position, _, effort = states.since(began)
            found.append(without(when, effort, gravity_of(position[-1])))
        return {'without gravity, three times [s]': found}


def goal(ending: str) -> dict[str, Any]:
    """Return what comes of a goal through the proxy that ends in one way, and what is held."""
    from control_msgs.action import FollowJointTrajectory
    from rclpy.action import ActionClient

    changed: dict[str, Any] = {}
    # Mock hardware is always where it is told to be: one that stays where it is leaves a path.
    interfaces = ('effort',) if ending == 'aborted' else PASSED_ON
    if ending == 'aborted':
        changed['constraints'] = {name: {'trajectory': 0.02} for name in DRIVES}
        changed['gains'] = {name: {'p': 0.0, 'i': 0.0, 'd': 0.0} for name in DRIVES}
    with cell() as running:
        states = trajectory_cell(running, interfaces, **changed)
        status = running.status('trajectory_proxy')
        running.start('trajectory_proxy', demo=True)
        running.wait(lambda: status, 'trajectory_proxy')
        client = ActionClient(running.node, FollowJointTrajectory,
                              '/trajectory_proxy/follow_joint_trajectory')
        another = running.node.create_publisher(JointTrajectory, f'/{JTC}/joint_trajectory', 1)
        running.wait(client.server_is_ready, 'the proxy\'s action')
        running.spin(1.0)
        handle = running.answered(client.send_goal_async(path_goal(FollowJointTrajectory)), 'goal')
        result = handle.get_result_async()
        if ending == 'canceled':
            running.spin(HALF_WAY)
            handle.cancel_goal_async()
        elif ending == 'deactivated':
            running.spin(HALF_WAY)
            running.switch(deactivate=[JTC])
        elif ending == 'replaced':
            running.spin(HALF_WAY)
            now = states.since(0.0)[1][-1]
            another.publish(JointTrajectory(
                joint_names=list(DRIVES), points=[JointTrajectoryPoint(positions=now.tolist())]))
        elif ending in ENDED_BY:
            running.spin(HALF_WAY)
            running.end_manager(ENDED_BY[ending])
        asked = time.monotonic()
        running.wait(result.done, 'a result', DEADLINE)
        ended = time.monotonic()
        answer = result.result()
        found = {'code': answer.result.error_code, 'says': answer.result.error_string,
                 'answer after [s]': round(ended - asked, 3)}
        running.spin(1.0)
        if ending != 'deactivated' and ending not in ENDED_BY:
            when, position, _, effort = states.since(ended - 0.2)
            gravity = gravity_of(position[-1])
            found |= {'without gravity [s]': without(when, effort, gravity),
                      'efforts at the end [N]': rounded(effort[-1]),
                      'gravity [N]': rounded(gravity)}
        client.destroy()
        return found


def two_robots() -> dict[str, Any]:
    """Return whether two robots in namespaces of their own get what is theirs."""
    found = {}
    with cell() as running:
        statuses = {}
        for side in ('left', 'right'):
            names = tuple(f'{side}_{name}' for name in DRIVES)
            given = configured(JTC, command_interfaces=list(PASSED_ON), joints=list(names),
                               gains={name: {'p': 0.0} for name in names})
            running.manage(given, at_start(names), PASSED_ON, namespace=side)
            running.activate(BROADCASTER, JTC, namespace=side)
            statuses[side] = running.status(f'{side}/feedforward')
            running.start(
                'feedforward', '-r', f'__ns:=/{side}',
                '-r', f'~/joint_trajectory:={JTC}/joint_trajectory',
                demo=True, stop_time=STOP_TIME, joint_prefix=f'{side}_')
            running.wait(lambda side=side: statuses[side], f'{side} feedforward')
        players = [running.start('play_trajectory', '-r', f'__ns:=/{side}') for side in statuses]
        running.wait(lambda: all(p.poll() is not None for p in players), 'paths', DEADLINE)
        running.spin(0.5)
        for side, status in statuses.items():
            found[side] = {'accepted': status[-1]['counters']['accepted'],
                           'status': codes(status, 0.0)}
        return {**found, 'dropped': sum(running.said(words) for words in DROPPED.values())}


def monitored() -> dict[str, Any]:
    """Return the monitor's status where hardware returns its commands, and its comparison."""
    with cell() as running:
        trajectory_cell(running)
        efforts = Efforts(running, DRIVES)
        beside(running)
        status = running.status('monitor')
        running.start('monitor', demo=True)
        running.wait(lambda: status, 'monitor')
        began = played(running)
        running.spin(0.5)
        last = status[-1]
        return {'order': ' '.join(efforts.order), 'samples': last['counters']['samples'],
                'compared': last['counters']['compared'], 'gaps': last['counters']['gaps'],
                'status': codes(status, began), 'says': last['message']}


def loop(rate: float, stiffness: float = 0.0, damping: float = 0.0) -> dict[str, Any]:
    """Return how a loop over topics holds simulated_robot on its path.

    The controller closes it with gains of PID; without gains it passes positions and efforts on,
    and the robot's drives close a loop of their own. The robot's states and the controller's
    cycles come at one rate [Hz].
    """
    with cell() as running:
        interfaces = ('effort',) if stiffness else PASSED_ON
        content = configured(JTC, command_interfaces=list(interfaces), gains={
            name: {'p': stiffness, 'i': 0.0, 'd': damping} for name in DRIVES})
        content['controller_manager']['ros__parameters']['update_rate'] = int(rate)
        efforts = running.node.create_publisher(Float64MultiArray, '/simulated_robot/commands', 1)
        setpoints = running.node.create_publisher(JointState, '/simulated_robot/joint_command', 1)
        ways: dict[str, list[float]] = {'states': [], 'commands': []}
        last: list[tuple[float, Array]] = []

        def pass_on(command: Any) -> None:
            """Relay what the hardware publishes by name to what the robot takes."""
            found = {name: np.array([dict(zip(command.name, values, strict=True))[drive]
                                     for drive in DRIVES])
                     for name, values in (('position', command.position),
                                          ('effort', command.effort)) if len(values)}
            if set(found) != set(interfaces) or not all(
                    np.isfinite(values).all() for values in found.values()):
                return
            late = age(command)
            ways['commands'].append(late)
            if stiffness:
                efforts.publish(Float64MultiArray(data=found['effort'].tolist()))
                return
            now, position = time.monotonic() - late, found['position']
            velocity = ((position - last[0][1]) / max(now - last[0][0], 0.5 / rate) if last
                        else np.zeros(len(DRIVES)))
            last[:] = [(now, position)]
            setpoints.publish(JointState(
                name=list(DRIVES), position=position.tolist(), velocity=velocity.tolist(),
                effort=found['effort'].tolist()))

        running.listen(JointState, TOPICS['joint_commands_topic'], pass_on, 1)
        robot = running.status('simulated_robot')
        running.start('simulated_robot', '-r', f'joint_states:={TOPICS["joint_states_topic"]}',
                      demo=True, rate=rate, command_timeout=0.0)
        running.wait(lambda: robot, 'simulated_robot')
        measured: list[tuple[float, Array]] = []

        def measure(state: Any) -> None:
            ways['states'].append(age(state))
            measured.append((time.monotonic() - ways['states'][-1], np.array(state.position)))

        running.listen(JointState, TOPICS['joint_states_topic'], measure)
        status = beside(running)
        running.manage(content, at_start(), interfaces, TOPICS)
        states = States(running, JTC, DRIVES)
        running.wait(lambda: measured, 'states of simulated_robot')
        # Its simulation has caught up with the clock, which what starts beside it holds up.
        running.wait(lambda: time.monotonic() - measured[-1][0] < CAUGHT_UP, 'the simulation')
        running.activate(BROADCASTER, JTC)
        for way in ways.values():
            way.clear()
        activated = len(measured)
        running.spin(2.0)
        sag = np.array([place for _, place in measured[activated:]]) - measured[activated][1]
        before = dict(robot[-1]['counters'])
        began = played(running, lead_in=2.0)
        when, reference, _, _ = states.since(began)
        times = np.array([when for when, _ in measured]) - began
        where = np.array([place for _, place in measured])
        error = np.abs(np.array([reference[k] - where[np.abs(times - time).argmin()]
                                 for k, time in enumerate(when)])).max(axis=1)
        counters = robot[-1]['counters']
        return {'sag [mm]': round(1e3 * float(np.abs(sag).max()), 3),
                'error, rms and largest [mm]': [
                    round(1e3 * float(value), 3)
                    for value in (np.sqrt(np.mean(error**2)), error.max())],
                'ways of states and of commands, median and 99 % [ms]': [
                    [round(1e3 * float(value), 1) for value in np.percentile(way, (50, 99))]
                    for way in ways.values()],
                'late cycles': f'{counters["late"] - before["late"]} of '
                               f'{counters["cycles"] - before["cycles"]}',
                'robot': codes(robot, began), 'status': codes(status, began)}


def age(message: Any) -> float:
    """Return how long ago a message was stamped [s]."""
    return time.time() - message.header.stamp.sec - 1e-9 * message.header.stamp.nanosec


# --- what is found --------------------------------------------------------------------------------

def held_from(when: Array, effort: Array, gravity: Array) -> float | None:
    """Return from when on [s] efforts (N, 6) are a gravity for good; None where they are not."""
    off = np.abs(effort - gravity).max(axis=1) > NEAR
    if off[-1]:
        return None
    return round(float(when[off].max(initial=0.0)), 3)


def without(when: Array, effort: Array, gravity: Array) -> float | None:
    """Return for how long [s] efforts are zero; None where they are so for good."""
    zero = np.abs(effort).max(axis=1) < NEAR
    if zero[-1] and np.abs(gravity).max() > NEAR:
        return None
    return round(float(np.ptp(when[zero])) if zero.any() else 0.0, 3)


def rounded(values: Array) -> list[float]:
    """Return efforts to a hundredth of a newton."""
    return [round(float(value), 2) for value in values]


def path_goal(action: Any) -> Any:
    """Return a goal along the path, positions alone."""
    moments = np.arange(0.0, HelicalPath.duration, 0.05)
    positions = DriveModel.load().drive_forces(HelicalPath().motion(moments)).drive_motion[0]
    goal = action.Goal()
    goal.trajectory = JointTrajectory(joint_names=list(DRIVES))
    for moment, position in zip(moments, positions, strict=True):
        nanoseconds = round((moment + 0.2) * 1e9)
        goal.trajectory.points.append(JointTrajectoryPoint(
            positions=position.tolist(), time_from_start=Duration(
                sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)))
    return goal


CASES: dict[str, Callable[[], dict[str, Any]]] = {
    'forward 100 Hz': lambda: forward(100.0),
    'forward 500 Hz': lambda: forward(500.0),
    'stream by default': stream,
    'stream 500 Hz': lambda: stream(500.0),
    'stream points 1 ahead 0': lambda: stream(points=1, ahead=0.0),
    'stream points 1 ahead 0, no end at rest': lambda: stream(
        points=1, ahead=0.0, stop_time=0.0,
        changed={'allow_nonzero_velocity_at_trajectory_end': True}),
    'stream points 2 ahead 0, no end at rest': lambda: stream(
        points=2, ahead=0.0, stop_time=0.0,
        changed={'allow_nonzero_velocity_at_trajectory_end': True}),
    'stream points 1 ahead 0.02, no end at rest': lambda: stream(
        points=1, ahead=0.02, stop_time=0.0,
        changed={'allow_nonzero_velocity_at_trajectory_end': True}),
    'stream without stop_time': lambda: stream(stop_time=0.0),
    'stream without effort interface': lambda: stream(interfaces=('position',)),
    'stream with one more joint': lambda: stream(extra={'gripper': 0.0}),
    'stream with one more joint, partial': lambda: stream(
        extra={'gripper': 0.0}, changed={'allow_partial_joints_goal': True}),
    'stream broken off': broken,
    'stream broken off, cmd_timeout 0.5': lambda: broken(cmd_timeout=0.5),
    'activation': activation,
    'goal reached': lambda: goal('reached'),
    'goal canceled': lambda: goal('canceled'),
    'goal aborted': lambda: goal('aborted'),
    'goal deactivated': lambda: goal('deactivated'),
    'goal, trajectory replaced': lambda: goal('replaced'),
    'goal, controller killed': lambda: goal('killed'),
    'goal, controller stopped': lambda: goal('stopped'),
    'two robots': two_robots,
    'monitor': monitored,
    'loop of the drives 100 Hz': lambda: loop(100.0),
    'loop of the drives 200 Hz': lambda: loop(200.0),
    'loop 500 Hz': lambda: loop(500.0, 4000.0, 150.0),
}


def versions() -> dict[str, str]:
    """Return the versions of what is run."""
    found = {}
    for name in VERSIONS:
        file = Path(get_package_prefix(name)) / 'share' / name / 'package.xml'
        found[name] = file.read_text().partition('<version>')[2].partition('<')[0]
    return found


def main() -> None:
    """Run the cases that are named, or all, and print what comes of each."""
    parser = argparse.ArgumentParser('python -m benchmarks.cell.controllers',
                                     description=__doc__.partition('\n')[0])
    parser.add_argument('case', nargs='*', help='begins so; all by default')
    parser.add_argument('--json', type=Path, help='file for what is found')
    given = parser.parse_args()
    try:
        found: dict[str, Any] = {'versions': versions()}
    except PackageNotFoundError as error:
        parser.error(f'ros2_control is not installed, or not sourced: {error}')
    print(f'versions: {found["versions"]}')
    for name, run in CASES.items():
        if given.case and not any(name.startswith(case) for case in given.case):
            continue
        try:
            found[name] = run()
        except (TimeoutError, RuntimeError, PackageNotFoundError) as error:
            found[name] = {'failed': str(error)}
        print(f'\n{name}')
        for key, value in found[name].items():
            print(f'  {key}: {value}', flush=True)
        if given.json:
            given.json.write_text(json.dumps(found, indent=1))
    print(f'\n{Counter("failed" in case for case in found.values())[True]} cases failed to run')


if __name__ == '__main__':
    main()
