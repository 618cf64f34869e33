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
from trajectory_msgs.msg import JointTrajectory

from benchmarks.node import echo_node
from benchmarks.node.stream import Stream, feedforward, node_process, served
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros.messages.conversions import write_trajectory

RATES = (500.0, 1000.0)
ROUNDS = 5
CEILINGS = np.arange(500.0, 5001.0, 250.0)
LONG = 1000  # points


def trajectory(points: int) -> bytes:
    """Return a serialised stretch of the paper's path."""
    motion = HelicalPath().motion(1.0 + 0.001 * np.arange(points))
    return bytes(serialize_message(write_trajectory(
        motion, Time(), [k * 1_000_000 for k in range(points)])))


def main() -> int:
    """Measure and print."""
    found = run(float(sys.argv[1]) if len(sys.argv) > 1 else 5.0)
    print('\n'.join(rows(found)))
    print(json.dumps(found))
    return 0


def run(seconds: float) -> dict[str, Any]:
    """Stream for that long at each rate and return what was measured."""
    echo = [sys.executable, echo_node.__file__]
    one, found = trajectory(1), dict[str, Any]()
    with served(echo, '/echo', has_status=False) as (floor, _):
        domain = int(os.environ['ROS_DOMAIN_ID'])
        found['start_s'] = [start_time(one, domain) for _ in range(3)]
        with served(feedforward('command_timeout:=0.0'), domain=domain) as (node, _):
            for rate in RATES:
                times: dict[str, list[np.ndarray]] = {'echo': [], 'feedforward': []}
                for _ in range(ROUNDS):
                    for name, stream in (('echo', floor), ('feedforward', node)):
                        times[name].append(
                            stream.steadily(one, rate, int(rate * seconds / ROUNDS)))
                found[f'{rate:g} Hz'] = {name: _percentiles(np.concatenate(each))
                                         for name, each in times.items()}
            found['sustained'] = {'echo': ceiling(floor, one), 'feedforward': ceiling(node, one)}
            found['long_ms'] = long_trajectory(node)
    return found


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
    for rate in RATES:
        echo, node = (found[f'{rate:g} Hz'][name] for name in ('echo', 'feedforward'))
        for key, limit in (('p50_ms', 1.10), ('p99_ms', 1.25)):
            table.append(f'| round trip at {rate:g} Hz, {key[:3]} | {echo[key]:.2f} ms | '
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
