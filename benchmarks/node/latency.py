# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Round trips of the feedforward node against an echo node, in one run.

    python -m benchmarks.node.latency [SECONDS]

Both nodes are processes of their own; which one is measured alternates, so that a machine that
is busy for a while is busy for both. Prints a table and a JSON line.
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
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from benchmarks.node import echo_node
from benchmarks.node.stream import Stream, feedforward, node_process, served
from pprs_dynamics import DriveModel
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros.messages.conversions import write_trajectory
from pprs_dynamics.simulation.injection import draw_motion

RATES = (100.0, 500.0, 1000.0)
HEXAPOD_RATE = 500.0
ROUNDS = 5
CEILINGS = np.arange(500.0, 5001.0, 250.0)
LONG = 1000  # points
HEXAPOD = 'config/hexapod.yaml'  # from the package's folder


def trajectory(points: int) -> bytes:
    """Return a serialised stretch of the paper's path."""
    motion = HelicalPath().motion(1.0 + 0.001 * np.arange(points))
    return bytes(serialize_message(write_trajectory(
        motion, Time(), [k * 1_000_000 for k in range(points)])))


def hexapod_setpoint(model: DriveModel) -> bytes:
    """Return a serialised setpoint of the drives of a robot with loops, in motion."""
    motion = draw_motion(model, 2.0, 1, HEXAPOD_RATE)
    q, v, a = (values[len(values) // 2].tolist() for values in (
        motion.position, motion.velocity, motion.acceleration))
    return bytes(serialize_message(JointTrajectory(joint_names=list(model.drives), points=[
        JointTrajectoryPoint(positions=q, velocities=v, accelerations=a)])))


def main() -> int:
    """Measure and print."""
    found = run(float(sys.argv[1]) if len(sys.argv) > 1 else 5.0)
    print('\n'.join(rows(found)))
    print(json.dumps(found))
    return 0


def run(seconds: float) -> dict[str, Any]:
    """Stream for that long at each rate and return what was measured."""
    echo = [sys.executable, echo_node.__file__]
    path, found = trajectory(1), dict[str, Any]()
    with served(echo, '/echo', has_status=False) as (floor, _):
        domain = int(os.environ['ROS_DOMAIN_ID'])
        found['start_s'] = [start_time(path, domain) for _ in range(3)]
        with served(feedforward('command_timeout:=0.0'), domain=domain) as (node, _):
            for rate in RATES:
                found[f'{rate:g} Hz'] = in_turns(floor, node, path, rate, seconds)
            found['sustained'] = {'echo': ceiling(floor, path), 'feedforward': ceiling(node, path)}
            found['long_ms'] = long_trajectory(node)
        found['6-UPS'] = hexapod(seconds, domain)
    return found


def hexapod(seconds: float, domain: int) -> dict[str, dict[str, float]]:
    """Return round trips of a 6-UPS at the lower rate, in joints."""
    setpoint = hexapod_setpoint(DriveModel.load(HEXAPOD))
    command = [*feedforward('command_timeout:=0.0'), '--params-file', HEXAPOD]
    with served([sys.executable, echo_node.__file__, 'joints'], '/echo', domain, False,
                JointTrajectory) as (floor, _), served(
                    command, domain=domain, kind=JointTrajectory) as (node, _):
        return in_turns(floor, node, setpoint, HEXAPOD_RATE, seconds)


def in_turns(floor: Stream, node: Stream, data: bytes, rate: float, seconds: float,
             ) -> dict[str, dict[str, float]]:
    """Return the round trips of echo and node at a rate, measured in turns."""
    times: dict[str, list[np.ndarray]] = {'echo': [], 'feedforward': []}
    for _ in range(ROUNDS):
        for name, stream in (('echo', floor), ('feedforward', node)):
            times[name].append(stream.steadily(data, rate, int(rate * seconds / ROUNDS)))
    return {name: _percentiles(np.concatenate(values)) for name, values in times.items()}


def start_time(data: bytes, domain: int) -> float:
    """Return the time from the start of the process to its first command [s]."""
    stream = Stream()
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, node_process(
            feedforward(), domain, Path(folder) / 'log'):
        while not stream.commands and time.perf_counter() < began + 20:
            stream.publish(data)
            stream.spin(0.005)
        took = time.perf_counter() - began
    stream.close()
    return took


def ceiling(stream: Stream, data: bytes) -> float:
    """Return the highest rate at which every message is answered within a quarter second [Hz]."""
    best = 0.0
    for rate in CEILINGS:
        times = stream.steadily(data, rate, int(rate))
        if len(times) < int(rate) or np.max(times) > 0.25:
            break
        best = float(rate)
    return best


def long_trajectory(stream: Stream, count: int = 30) -> float:
    """Return how long a thousand points take there and back as a joint trajectory [ms]."""
    arrived: list[float] = []
    stream.listen(JointTrajectory, 'joint_trajectory', lambda _: arrived.append(
        time.perf_counter()))
    stream.connect()
    data, round_trips = trajectory(LONG), []
    for k in range(count):
        sent = time.perf_counter()
        stream.publish(data)
        stream.wait_until(lambda k=k: len(arrived) > k, 'a long trajectory')
        round_trips.append(arrived[-1] - sent)
    return float(np.median(round_trips) * 1e3)


def _percentiles(times: np.ndarray) -> dict[str, float]:
    p50, p99 = np.percentile(times, (50, 99))
    return {'count': len(times), 'p50_ms': float(p50 * 1e3), 'p99_ms': float(p99 * 1e3),
            'max_ms': float(times.max() * 1e3)}


def rows(found: dict[str, Any]) -> list[str]:
    """Return the rows of a table: what, echo, feedforward, ratio, goal."""
    table = ['| | echo | feedforward | ratio | goal |', '|---|---|---|---|---|']
    for what, case, limits in (
            *((f'at {rate:g} Hz', f'{rate:g} Hz', (1.10, 1.25)) for rate in RATES),
            (f'of a 6-UPS at {HEXAPOD_RATE:g} Hz', '6-UPS', (1.15, 1.25))):
        echo, node = (found[case][name] for name in ('echo', 'feedforward'))
        for key, limit in zip(('p50_ms', 'p99_ms'), limits, strict=True):
            table.append(f'| round trip {what}, {key[:3]} | {echo[key]:.2f} ms | '
                         f'{node[key]:.2f} ms | {node[key] / echo[key]:.2f} | {limit:.2f} |')
    echo, node = (found['sustained'][name] for name in ('echo', 'feedforward'))
    table.append(f'| sustained without loss | {echo:g} Hz | {node:g} Hz | '
                 f'{node / max(echo, 1):.2f} | 0.90 |')
    table.append(f'| {LONG} points, there and back | | {found["long_ms"]:.1f} ms | | '
                 '8 ms in the node |')
    table.append(f'| process start to first command, warm | | {min(found["start_s"]):.2f} s | | '
                 '1.5 s |')
    return table


if __name__ == '__main__':
    sys.exit(main())
