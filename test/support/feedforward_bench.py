# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The feedforward node, its topics and a publisher, for the tests of the node."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from discovery import LEASE
from node_bench import Bench, bench, overrides
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.messages import conversions

# Message fields are doubles and the model is deterministic: what remains is the rounding of
# time_from_start, which the memoryless model does not use.
EQUAL = 1e-12
SOON, FORGOTTEN = 10.0, LEASE + 10.0  # [s], for a status; until a killed node is forgotten


class FeedforwardBench:
    """The node, its topics and a publisher."""

    def __init__(
        self, bench: Bench, message: type = MultiDOFJointTrajectory, topic: str = 'trajectory',
        **options: Any,
    ) -> None:
        self.bench = bench
        self.node = bench.add(FeedforwardNode, **options)
        if self.node._preparation is not None:
            # Tests that count milliseconds have the machine to themselves.
            self.node._preparation.join(120)
        self.commands = bench.listen(Float64MultiArray, '/feedforward/commands')
        self.joint_command = bench.listen(JointState, '/feedforward/joint_command')
        self.joint_trajectory = bench.listen(JointTrajectory, '/feedforward/joint_trajectory')
        bench.follow_status('/feedforward/status')
        self.publisher = bench.probe.create_publisher(message, f'/feedforward/{topic}', 100)

    def connect(self) -> FeedforwardBench:
        """Wait until node and probe see each other on every topic."""
        assert self.bench.spin_until(self._connected)
        return self

    def _connected(self) -> bool:
        counts = [self.bench.probe.count_publishers(f'/feedforward/{name}')
                  for name in ('commands', 'joint_command', 'joint_trajectory', 'status')]
        listeners = [self.node.count_subscribers(f'/feedforward/{name}')
                     for name in ('commands', 'joint_command', 'joint_trajectory')]
        return bool(self.publisher.get_subscription_count() and self.bench.status
                    and all(counts) and all(listeners))

    @property
    def counters(self) -> dict[str, int]:
        """Of the node, now."""
        return dict(self.node._counters)

    def send(self, message: MultiDOFJointTrajectory | JointTrajectory | bytes) -> None:
        """Publish and wait until the node has dealt with the message."""
        before = self.counters['received']
        self.publisher.publish(message)
        assert self.bench.spin_until(lambda: self.counters['received'] > before)

    def answer(self, message: MultiDOFJointTrajectory | JointTrajectory | bytes) -> list[float]:
        """Publish a valid message and return the forces that come out."""
        before = len(self.commands)
        self.send(message)
        assert self.bench.spin_until(lambda: len(self.commands) > before), self.bench.status[-1]
        return list(self.commands[-1].data)

    def wait_for_status(self, **wanted: Any) -> dict[str, Any]:
        """Return the first new status with these entries.

        A node that an earlier test killed is a namesake until discovery forgets it, and until
        then nothing is OK.
        """
        found = self.bench.spin_until(lambda: all(
            self.bench.status[-1].get(key) == value for key, value in wanted.items()),
            FORGOTTEN if wanted.get('code') == 'OK' else SOON)
        assert found, self.bench.status[-1]
        return self.bench.status[-1]


@contextmanager
def feedforward_bench(
    message: type = MultiDOFJointTrajectory, topic: str = 'trajectory', **parameters: Any,
) -> Iterator[FeedforwardBench]:
    """Give a running node with parameters of its own.

    It never goes stale or lags, changes at once, and asks no message for its age or how early it
    is, unless told to.

    Keywords are parameters with `__` for the dot, `message` on `topic` what asks the node for
    forces.
    """
    given = overrides(**{'command_timeout': 0.0, 'max_age': 0.0, 'max_ahead': 0.0,
                         'lag_warning': 0.0, 'ramp_time': 0.0, **parameters})
    with bench() as running:
        yield FeedforwardBench(running, message, topic, parameter_overrides=given).connect()


def random_motion(rng: np.random.Generator, points: int) -> PlatformMotion:
    """Return points within the workspace, 10 ms apart, that do not follow from one another."""
    return PlatformMotion(
        np.array([0.0, 0.0, 0.5]) + rng.uniform(-0.08, 0.08, (points, 3)),
        Rotation.from_rotvec(rng.uniform(-0.15, 0.15, (points, 3))).as_quat(),
        *(rng.normal(scale=0.5, size=(points, 3)) for _ in range(4)),
        np.arange(points) * 0.01)


def held(motion: PlatformMotion) -> np.ndarray:
    """Return the forces of the demonstration's robot at rest in the last pose of a motion."""
    return DriveModel.load().drive_forces(motion[-1:].held()).total[0]


def message_of(motion: PlatformMotion, stamp: Time | None = None) -> MultiDOFJointTrajectory:
    """Return the message that asks for a motion, its points 10 ms apart."""
    offsets = [k * 10_000_000 for k in range(len(motion))]
    return conversions.write_trajectory(motion, stamp or Time(), offsets)
