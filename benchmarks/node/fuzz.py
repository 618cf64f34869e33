# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A running feedforward node under messages of every kind of damage.

    python -m benchmarks.node.reliability fuzz

Valid messages are mixed with NaN, infinities, 1e308, denormals, bad quaternions, wrong counts,
10 000 points, names in any script, and truncated bytes. Afterwards the node must live, must have
counted each rejection under its right code, and no number that is not finite, nor any force over
its limit, may have left it on any topic.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from benchmarks.node.damage import VALID, damaged, valid_motion
from benchmarks.node.stream import feedforward, resident_memory, served
from pprs_dynamics import DriveModel
from pprs_dynamics.ros.messages.conversions import write_trajectory

BATCH = 20  # messages between two looks at the node: fewer than its queue holds
PARTS = ('rigid_body', 'active_friction', 'passive_friction')
EQUAL = 1e-12
KEPT_EVERY = 20_000  # messages


class Watch:
    """Check of every number that the node publishes."""

    def __init__(self, limits: np.ndarray) -> None:
        self.limits, self.numbers, self.bad = limits, 0, 0

    def efforts(self, values: Any, limited: bool = True) -> None:
        """Look at forces (..., 6)."""
        array = np.asarray(values, dtype=float)
        self.numbers += array.size
        good = np.isfinite(array)
        if limited:
            good &= np.abs(array) <= self.limits
        self.bad += int((~good).sum())

    def others(self, *values: Any) -> None:
        """Look at positions, velocities, accelerations."""
        for numbers in values:
            array = np.asarray(numbers, dtype=float)
            self.numbers += array.size
            self.bad += int((~np.isfinite(array)).sum())

    def state(self, data: bytes, limited: bool) -> None:
        """Look at a JointState."""
        message = deserialize_message(data, JointState)
        self.efforts(message.effort, limited)
        self.others(message.position, message.velocity)

    def command(self, data: bytes) -> None:
        """Look at a command."""
        self.efforts(deserialize_message(data, Float64MultiArray).data)

    def trajectory(self, data: bytes) -> None:
        """Look at a trajectory of the drives."""
        for point in deserialize_message(data, JointTrajectory).points:
            self.efforts(point.effort)
            self.others(point.positions, point.velocities, point.accelerations)


def run(
    messages: int, seed: int = 0, domain: int | None = None,
    keep: Callable[[int, dict[str, Any]], None] = lambda count, found: None,
) -> dict[str, Any]:
    """Send that many messages and return what came of it; `keep` gets it as it grows."""
    rng, model = np.random.default_rng(seed), DriveModel.load()
    watch, expected = Watch(model.limits.efforts), Counter[str]()
    sentinel = valid_motion(rng, 1)
    answer = model.drive_forces(sentinel).total[0]
    sentinel_bytes = bytes(serialize_message(write_trajectory(sentinel, Time(), [0])))
    with served(feedforward('command_timeout:=0.0'), domain=domain) as (stream, process):
        stream.listen(Float64MultiArray, 'commands', watch.command)
        stream.listen(JointState, 'joint_command', lambda data: watch.state(data, True))
        stream.listen(JointTrajectory, 'joint_trajectory', watch.trajectory)
        for part in PARTS:
            stream.listen(JointState, f'effort/{part}', lambda data: watch.state(data, False))
        stream.connect()
        memory, began, wrong = resident_memory(process), time.monotonic(), 0

        def found() -> dict[str, Any]:
            sent = sum(expected.values())
            stream.wait_until(
                lambda: stream.status['counters']['received'] == sent, 'the counters')
            counters = stream.status['counters']
            codes = {code for code in counters if code.isupper()} | set(expected) - {VALID}
            return {
                'messages': sent, 'alive': process.poll() is None, 'numbers_seen': watch.numbers,
                'bad_numbers': watch.bad, 'wrong_answers_after_damage': wrong,
                'accepted': counters['accepted'], 'accepted_expected': expected[VALID],
                'miscounted': {code: (counters.get(code, 0), expected[code])
                               for code in sorted(codes)
                               if counters.get(code, 0) != expected[code]},
                'rejected': {code: counters[code] for code in sorted(codes) if code in counters},
                'seconds': round(time.monotonic() - began, 1),
                'memory_growth_mb': round(resident_memory(process) - memory, 2)}

        for start in range(0, messages, BATCH):
            for _ in range(min(BATCH, messages - start)):
                code, data = damaged(rng)
                expected[code] += 1
                stream.publish(data)
            expected[VALID] += 1
            stream.publish(sentinel_bytes)
            stream.wait_until(lambda: stream.commands >= expected[VALID], 'the next answer', 60)
            answered = deserialize_message(stream.last_command, Float64MultiArray).data
            wrong += not np.allclose(answered, answer, rtol=0, atol=EQUAL)
            if start and start % KEPT_EVERY == 0:
                keep(start, found())
        return found()


def passed(found: dict[str, Any]) -> bool:
    """Return whether nothing is wrong with what `run` found."""
    return bool(found['alive'] and not found['bad_numbers'] and not found['miscounted']
                and not found['wrong_answers_after_damage']
                and found['accepted'] == found['accepted_expected'])
