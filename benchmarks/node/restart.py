# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A feedforward node that is killed with SIGKILL in mid-stream and started again.

    python -m benchmarks.node.reliability restart

A new node must answer every message that reaches it, from the first one on.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.node.latency import trajectory
from benchmarks.node.stream import Stream, environment, feedforward, node_process, reserve_domain

RATE = 100.0  # [Hz]
ENOUGH = 50  # answers before the next kill


def run(
    times: int, domain: int | None = None,
    keep: Callable[[int, dict[str, Any]], None] = lambda count, found: None,
) -> dict[str, Any]:
    """Kill that often and return what came of it; `keep` gets it as it grows."""
    holder = None
    if domain is None:
        domain, holder = reserve_domain()
        os.environ.update({key: value for key, value in environment(domain).items()
                           if key.startswith('ROS_')})
    data, starts, unanswered = trajectory(1), [], 0
    with tempfile.TemporaryDirectory() as folder:
        stream = Stream()
        for kills in range(1, times + 1):
            stream.commands, stream.status = 0, {}
            began = due = time.monotonic()
            with node_process(feedforward(), domain, Path(folder) / 'log') as process:
                first = None
                while stream.commands < ENOUGH or not stream.status.get('rate'):
                    if time.monotonic() > began + 30:
                        raise TimeoutError(f'no answers: {stream.status}')
                    if time.monotonic() >= due:
                        stream.publish(data)
                        due += 1 / RATE
                    stream.spin(max(due - time.monotonic(), 1e-4))
                    if first is None and stream.commands:
                        first = time.monotonic() - began
                        starts.append(first)
                counters = stream.status['counters']
                unanswered += counters['received'] - counters['accepted']
                process.kill()
                process.wait()
            while stream.spin(0.1):
                pass
            keep(kills, _found(kills, unanswered, starts))
        stream.close()
    if holder is not None:
        holder.close()
    return _found(times, unanswered, starts)


def _found(kills: int, unanswered: int, starts: list[float]) -> dict[str, Any]:
    return {'kills': kills, 'unanswered': unanswered,
            'start_to_first_command_s': [round(start, 2) for start in starts]}


def passed(found: dict[str, Any]) -> bool:
    """Return whether every message that reached a new node was answered."""
    return not found['unanswered']
