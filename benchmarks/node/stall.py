# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A feedforward node that is stopped (SIGSTOP) in the middle of a stream, and goes on.

What it commands then is compared with where the path is by that time. Usage:

    python -m benchmarks.node.reliability stall
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from benchmarks.node.stream import PATIENCE, Stream, feedforward, served
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.ros.messages import conversions

SPEED = 0.015  # [m/s] of a platform that is raised: each setpoint is told by its height
LOWEST = 0.44  # [m]
LIFT = 3  # its place among the drives, which rises as the platform does
BEFORE, AFTER = 0.8, 2.0  # [s] of the stream around the stop
ANSWER_TIME = 0.2  # [s] after which a setpoint is not answered: it was refused as late
SAME = 1e-5  # [s] of the path: far above rounding, far below the time between two setpoints
SETPOINT_AGE = 0.1  # [s] before the node went on; a setpoint that was sent earlier is old


def run(seconds: float, rate: float = 500.0, domain: int | None = None) -> dict[str, Any]:
    """Stop the node for that long, with stamps and without, and return what it sent afterwards."""
    found = {}
    for name, stamped in (('stamped', True), ('unstamped', False)):
        with served(feedforward(each=False), domain=domain) as (stream, process):
            found[name] = stopped(stream, process, seconds, rate, stamped)
    return {'stopped_s': seconds, 'rate': rate, **found}


def stopped(stream: Stream, process: Any, seconds: float, rate: float, stamped: bool,
            ) -> dict[str, Any]:
    """Return how old the setpoints are that a node executes after it was stopped.

    Old is what was sent long before the node went on. Neither the time at which a command arrives
    here nor the time that the node needs says anything: both depend on the load of the machine.
    """
    sent: list[tuple[float, float]] = []  # its moment of the path, and when it had been sent
    executed: list[tuple[float, float]] = []  # when the command arrived, and its height
    held: list[float] = []

    def take(data: bytes) -> None:
        command, now = deserialize_message(data, JointState), time.monotonic()
        if command.velocity[LIFT]:
            executed.append((now, command.position[LIFT]))
        else:  # the action of a command that went stale, at the pose where the drives stand
            held.append(now)

    def send(moment: float) -> None:
        stream.publish(setpoint(moment, stamped))
        sent.append((moment, time.monotonic()))

    def is_answered() -> bool:
        return bool(executed) and bool(
            (executed[-1][1] - executed[0][1]) / SPEED > sent[-1][0] - SAME)

    stream.listen(JointState, 'joint_command', take)
    stream.connect()
    send_until(lambda: send(0.0), is_answered, stream)  # heights are counted from this one
    began = time.monotonic()
    stopped_at, continued_at = began + BEFORE, began + BEFORE + seconds
    due, is_stopped = began, False
    while (now := time.monotonic()) < continued_at + AFTER:
        if not is_stopped and stopped_at <= now < continued_at:
            # A setpoint that the node just executes would be finished after the stop.
            send_until(lambda: send(time.monotonic() - began), is_answered, stream)
            process.send_signal(signal.SIGSTOP)
            due = time.monotonic()
            is_stopped, continued_at = True, due + seconds
        elif is_stopped and now >= continued_at:
            continued_at = time.monotonic()
            process.send_signal(signal.SIGCONT)
            is_stopped = False
        if now >= due:
            send(now - began)
            due += 1 / rate
        else:
            stream.spin(due - now)
    moment, sent_at = np.array(sent).T
    when, height = np.array(executed).T
    late = when >= continued_at
    setpoints = np.searchsorted(moment, (height[late] - height[0]) / SPEED - SAME)
    age = continued_at - sent_at[setpoints]
    return {'sent': len(sent), 'held': len(held), 'commands': int(late.sum()),
            'old_commands': int((age > SETPOINT_AGE).sum()),
            'oldest_s': round(float(age.max(initial=0.0)), 3),
            'farthest_mm': round(float(age.max(initial=0.0)) * SPEED * 1e3, 1),
            'back_after_s': round(float(np.min(when[late], initial=np.inf) - continued_at), 3),
            **{name: stream.status['counters'][name]
               for name in ('received', 'accepted', 'superseded', 'TIME')}}


def send_until(send: Callable[[], None], is_answered: Callable[[], bool], stream: Stream) -> None:
    """Send setpoints until the latest one is answered: then the node executes none."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        send()
        with suppress(TimeoutError):
            stream.wait_until(is_answered, 'answer to a setpoint', ANSWER_TIME)
            return
    raise TimeoutError(f'no setpoint is answered: {stream.status}')


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
