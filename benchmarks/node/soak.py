# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A feedforward node under a steady stream: its memory, and whether anything is lost.

Usage:

    python -m benchmarks.node.reliability soak
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks.node.latency import trajectory
from benchmarks.node.stream import feedforward, resident_memory, served

SETTLING = 60.0  # [s] that memory may grow in
BEHIND = 0.05  # [s] that this client makes up for
SILENCE = 5.0  # [s]
LOOK = 5.0  # [s] between two looks at the memory


def run(
    minutes: float, rate: float = 500.0, domain: int | None = None,
) -> dict[str, Any]:
    """Stream for that long and return what came of it."""
    data, memory = trajectory(1), []
    with served(feedforward(), domain=domain) as (stream, process):
        began = due = time.monotonic()
        sent, looked = 0, 0.0
        while (elapsed := (now := time.monotonic()) - began) < minutes * 60:
            if now >= due:
                stream.publish(data)
                sent += 1
                # Held up by the machine, go on from now: a burst would be no steady stream.
                due = max(due, now - BEHIND) + 1 / rate
            else:
                stream.spin(due - now)
            if elapsed - looked > LOOK:
                looked = elapsed
                memory.append((elapsed, resident_memory(process)))
        # What has not come after so long a silence is lost.
        while stream.commands < sent and time.perf_counter() < stream.answered_at[-1] + SILENCE:
            stream.spin(0.1)
        settled_at = time.monotonic() + 2
        while time.monotonic() < settled_at:
            stream.spin(0.1)
        status, answered = stream.status, stream.commands
    settled = [size for elapsed, size in memory if elapsed >= min(SETTLING, minutes * 30)]
    return {
        'minutes': minutes, 'rate': rate, 'sent': sent,
        # Commands of a stale stream come on top, where the machine stalled for so long.
        'answered': answered - status['counters']['stale'],
        'stale': status['counters']['stale'],
        'memory_mb': round(settled[0], 2) if settled else None,
        'growth_mb': round(float(np.max(settled) - settled[0]), 2) if settled else None,
        'lag': status['lag'], 'compute_time': status['compute_time']}


def passed(found: dict[str, Any]) -> bool:
    """Return whether all was answered, and memory grew by less than 2 MB."""
    return found['answered'] == found['sent'] and (found['growth_mb'] or 0) < 2
