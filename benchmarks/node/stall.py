# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A feedforward node that is stopped (SIGSTOP) in the middle of a stream, and goes on.

What it commands then is compared with where the path is by that time. Usage:

    python -m benchmarks.node.reliability stall
"""

from __future__ import annotations

import signal
import time
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from benchmarks.node.stream import Stream, feedforward, served
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.ros.messages import conversions

SPEED = 0.015  # [m/s] of a platform that is raised: each setpoint is told by its height
LOWEST = 0.44  # [m]
LIFT = 3  # its place among the drives, which rises as the platform does
BEFORE, AFTER = 0.8, 2.0  # [s] of the stream around the stop
# [s] after the node went on: that long ago the stream's first messages after it were sent.
LOOKED_AT = 0.3
QUIET = 0.02  # [s] without an answer, after which the node writes none
SETPOINT_AGE = 0.1  # [s] beyond which a setpoint is called old


def run(seconds: float, rate: float = 500.0, domain: int | None = None) -> dict[str, Any]:
    """Stop the node for that long, with stamps and without, and return what it sent afterwards."""
    found = {}
    for name, stamped in (('stamped', True), ('unstamped', False)):
        with served(feedforward(each=False), domain=domain) as (stream, process):
            found[name] = stopped(stream, process, seconds, rate, stamped)
    return {'stopped_s': seconds, 'rate': rate, **found}


def stopped(stream: Stream, process: Any, seconds: float, rate: float, stamped: bool,
            ) -> dict[str, Any]:
    """Return how old the setpoints are that a node executes after it was stopped."""
    executed: list[tuple[float, float]] = []  # when, and which height
    held: list[float] = []

    def take(data: bytes) -> None:
        command, now = deserialize_message(data, JointState), time.monotonic()
        if command.velocity[LIFT]:
            executed.append((now, command.position[LIFT]))
        else:  # the action of a command that went stale, at the pose where the drives stand
            held.append(now)

    stream.listen(JointState, 'joint_command', take)
    stream.connect()
    began = time.monotonic()
    stopped_at, continued_at = began + BEFORE, began + BEFORE + seconds
    due, is_stopped, sent = began, False, 0
    while (now := time.monotonic()) < continued_at + AFTER:
        if not is_stopped and stopped_at <= now < continued_at:
            while stream.spin(QUIET):  # what it writes just now would be finished after the stop
                pass
            process.send_signal(signal.SIGSTOP)
            due = time.monotonic()
            is_stopped, continued_at = True, due + seconds
        elif is_stopped and now >= continued_at:
            process.send_signal(signal.SIGCONT)
            is_stopped, continued_at = False, now
        if now >= due:
            stream.publish(setpoint(now - began, stamped))
            sent, due = sent + 1, due + 1 / rate
        else:
            stream.spin(due - now)
    when, height = np.array(executed).T
    moment = (height - height[0]) / SPEED + (when[0] - began)
    late = (when >= continued_at) & (when < continued_at + LOOKED_AT)
    age = when[late] - began - moment[late]
    return {'sent': sent, 'held': len(held), 'commands': int(late.sum()),
            'old_commands': int((age > SETPOINT_AGE).sum()),
            'oldest_s': round(float(age.max(initial=0.0)), 3),
            'farthest_mm': round(float(age.max(initial=0.0)) * SPEED * 1e3, 1),
            'back_after_s': round(float(np.min(
                when[when >= continued_at], initial=np.inf) - continued_at), 3),
            **{name: stream.status['counters'][name]
               for name in ('received', 'accepted', 'superseded', 'TIME')}}


def setpoint(moment: float, stamped: bool) -> bytes:
    """Return the message for a moment of the path [s]."""
    rest = np.zeros((1, 3))
    motion = PlatformMotion(np.array([[0.0, 0.0, LOWEST + SPEED * moment]]), [[0.0, 0, 0, 1]],
                            np.array([[0.0, 0.0, SPEED]]), rest, rest, rest)
    stamp = conversions.time(time.time_ns()) if stamped else Time()
    return bytes(serialize_message(conversions.write_trajectory(motion, stamp, [0])))


def passed(found: dict[str, Any]) -> bool:
    """Return whether nothing old was executed."""
    return not any(found[name]['old_commands'] for name in ('stamped', 'unstamped'))
