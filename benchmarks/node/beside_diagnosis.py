# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Latency of feedforward and monitor while the monitor's live diagnosis works, and without.

    python -m benchmarks.node.beside_diagnosis [ROUNDS [SECONDS]]

A client streams trajectories and joint states to both nodes, each a process of its own. Rounds
with and without diagnosis alternate, so that a machine that is busy for a while is busy for both.
Prints a table and a JSON line. What the monitor answers is counted from the joint state that
completes its window, on which the answer has to wait anyway.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from ros_processes import executable, node_process
from sensor_msgs.msg import JointState

from benchmarks.node.latency import trajectory
from benchmarks.node.stream import Stream, feedforward, resident_memory, served
from pprs_dynamics import DriveModel
from pprs_dynamics.inference.residuals.live import WINDOW
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.ros.messages import conversions

RATE, STATES = 200.0, 100.0  # [Hz], of trajectories and joint states
SPAN = 10.0  # [s], of the windows diagnosed
OFFSET, NOISE = 1.0, 0.08  # [N]: something to be found takes longest
START = 1_700_000_000_000_000_000  # [ns]
BEGUN = 5.0  # [s], after which the process that diagnoses is at work


def states(seconds: float) -> list[bytes]:
    """Return serialised joint states of a robot with an effect that the model lacks."""
    motion = Excitation(seconds, seed=4).motion(np.arange(0, seconds, 1 / STATES))
    forces = DriveModel.load().drive_forces(motion)
    effort = forces.total + NOISE * np.random.default_rng(0).standard_normal(forces.total.shape)
    effort[:, 3] += OFFSET
    return [bytes(serialize_message(conversions.joint_state(
        START + round(row * 1e9 / STATES), effort[row], forces.mechanism.position[row],
        np.zeros(6)))) for row in range(len(effort))]


class Beside(Stream):
    """The stream of trajectories, with joint states and what the monitor says to them."""

    def __init__(self, recorded: list[bytes]) -> None:
        super().__init__()
        self.states = self.node.create_publisher(JointState, '/joint_states', 1000)
        self._recorded, self.sent_states = recorded, [0.0] * len(recorded)
        self.next, self.monitor_times = 0, list[float]()
        subscription = self.node.create_subscription(
            JointState, '/monitor/residual', lambda message: None, 1000, raw=True)
        self._listeners.append((subscription, self._on_residual))

    def send_state(self) -> None:
        """Publish the next joint state."""
        self.sent_states[self.next] = time.perf_counter()
        self.states.publish(self._recorded[self.next])
        self.next += 1

    def _on_residual(self, data: bytes) -> None:
        stamp = conversions.nanoseconds(deserialize_message(data, JointState).header.stamp)
        last = round((stamp - START) / 1e9 * STATES + WINDOW / 2 * STATES)
        if last < self.next:
            self.monitor_times.append(time.perf_counter() - self.sent_states[last])

    def together(self, data: bytes, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Stream both and return the times to the commands and to the residuals [s]."""
        sent: list[float] = []
        self.answered_at, self.monitor_times = [], []
        start, first = time.perf_counter() + 0.01, self.next
        while (now := time.perf_counter()) < start + seconds:
            due = start + len(sent) / RATE
            due_state = start + (self.next - first) / STATES
            if now >= due_state and self.next < len(self._recorded):
                self.send_state()
            elif now >= due:
                sent.append(now)
                self.publish(data)
            else:
                self.spin(min(due, due_state) - now)
        self.wait_until(lambda: len(self.answered_at) >= len(sent), 'commands')
        return np.array(self.answered_at) - np.array(sent), np.array(self.monitor_times)


def children_seconds(pid: int) -> float:
    """Return the processor time of a process's children [s]."""
    used = 0
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            fields = stat.read_text().rpartition(')')[2].split()
        except OSError:  # it has just ended
            continue
        if int(fields[1]) == pid:
            used += int(fields[11]) + int(fields[12])
    return used / os.sysconf('SC_CLK_TCK')


def one_round(domain: int, diagnose: bool, seconds: float, folder: Path) -> dict[str, Any]:
    """Return the times of one round with a monitor of its own."""
    recorded = states(SPAN + BEGUN + seconds + 5)
    command = [executable('monitor'), '--ros-args', '-p', 'demo:=true',
               '-p', f'diagnose_span:={SPAN}',
               '-p', f'diagnose_every:={SPAN if diagnose else 0.0}']
    with node_process(command, domain, folder / 'log') as process:
        stream = Beside(recorded)
        try:
            stream.connect()
            # Equations are compiled beside the first answers.
            stream.wait_until(lambda: stream.status.get('preparing') is False, 'feedforward', 120)
            stream.wait_until(stream.states.get_subscription_count, 'monitor')
            for _ in range(round((SPAN + 0.5) * STATES)):  # the first window, faster than real time
                stream.send_state()
                stream.spin(0.001)
            stream.together(trajectory(1), BEGUN)
            before = children_seconds(process.pid)
            commands, residuals = stream.together(trajectory(1), seconds)
            return {'commands': commands, 'residuals': residuals,
                    'worker': children_seconds(process.pid) - before,
                    'memory': resident_memory(process)}
        finally:
            stream.close()


def main() -> int:
    """Measure and print."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 4
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    found: dict[bool, list[dict[str, Any]]] = {True: [], False: []}
    with tempfile.TemporaryDirectory() as folder, served(feedforward('command_timeout:=0.0')):
        domain = int(os.environ['ROS_DOMAIN_ID'])
        for _ in range(rounds):
            for diagnose in found:
                found[diagnose].append(one_round(domain, diagnose, seconds, Path(folder)))
    print('| | without diagnosis | with | ratio |\n|---|---|---|---|')
    result: dict[str, Any] = {}
    for name in ('commands', 'residuals'):
        times = {on: np.concatenate([one[name] for one in each]) for on, each in found.items()}
        for percent in (50, 99):
            off, on = (float(np.percentile(times[one], percent)) * 1e3 for one in (False, True))
            result[f'{name} p{percent} [ms]'] = [off, on]
            print(f'| {name}, p{percent} | {off:.2f} ms | {on:.2f} ms | {on / off:.2f} |')
    result['worker [s]'] = [one['worker'] for one in found[True]]
    print(json.dumps(result))
    return 0


if __name__ == '__main__':
    sys.exit(main())
