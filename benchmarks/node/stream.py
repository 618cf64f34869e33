# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A client of one thread that streams serialised trajectories to a node and takes its answers.

An executor in a second thread would add milliseconds of its own; message objects, too.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from ros_processes import environment, executable, node_process, reserve_domain
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics.ros.node.rclpy_internals import WaitSet, take

RELIABLE = QoSProfile(depth=1000)
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SETTLE = 0.7  # [s] discovery is one-sided: the node may see us a moment after we see it
PATIENCE = 20.0  # [s]
# Of a node that answers every message, as is counted here; by itself it takes the latest ones.
EACH = ('max_age:=0.0', 'max_ahead:=0.0',
        'qos_overrides./feedforward/trajectory.subscription.depth:=1000')


class Stream:
    """Publishes to a node's `~/trajectory` and keeps what it answers.

    Parameters
    ----------
    node : str
        Fully qualified name of the node under test.
    has_status : bool
        Whether it publishes its status.
    kind : type
        Message of the trajectories.
    """

    def __init__(self, node: str = '/feedforward', has_status: bool = True,
                 kind: type = MultiDOFJointTrajectory) -> None:
        self.target = node
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node('stream', context=self.context)
        self.publisher = self.node.create_publisher(kind, f'{node}/trajectory', RELIABLE)
        self._listeners: list[tuple[Any, Callable[[bytes], None]]] = []
        self._wait_set = WaitSet(self.context)
        self.commands = 0
        self.last_command = b''
        self.answered_at: list[float] = []
        self.status: dict[str, Any] = {}
        self.listen(Float64MultiArray, 'commands', self._on_command)
        if has_status:
            self.listen(String, 'status', self._on_status, LATCHED)

    def listen(
        self, kind: type, topic: str, callback: Callable[[bytes], None],
        qos: QoSProfile = RELIABLE,
    ) -> None:
        """Hand the bytes of what arrives on one of the node's topics to a callback."""
        subscription = self.node.create_subscription(
            kind, f'{self.target}/{topic}', lambda message: None, qos, raw=True)
        self._listeners.append((subscription, callback))

    def close(self) -> None:
        """Leave the graph."""
        self.node.destroy_node()
        self.context.try_shutdown()

    def connect(self) -> None:
        """Wait until node and client see each other on every topic."""
        self.wait_until(lambda: self.publisher.get_subscription_count() and all(
            listener.get_publisher_count() for listener, _ in self._listeners), 'discovery')
        end = time.monotonic() + SETTLE
        while time.monotonic() < end:
            self.spin(0.05)

    def publish(self, data: bytes) -> None:
        """Send a serialised trajectory."""
        self.publisher.publish(data)

    def spin(self, timeout: float) -> bool:
        """Take what has arrived, waiting for a time [s] at most; False where nothing came."""
        subscriptions = [subscription for subscription, _ in self._listeners]
        self._wait_set.wait(subscriptions, timeout=max(1, round(timeout * 1e9)))
        ready = self._wait_set.ready('subscription', subscriptions)
        for subscription, callback in self._listeners:
            if subscription in ready:
                while (taken := take(subscription)) is not None:
                    callback(taken[0])
        return bool(ready)

    def wait_until(
        self, condition: Callable[[], Any], what: str, patience: float = PATIENCE,
    ) -> None:
        """Spin until a condition holds; TimeoutError where it does not in time."""
        deadline = time.monotonic() + patience
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f'{what}: not within {patience:g} s; status {self.status}')
            self.spin(0.02)

    def steadily(self, data: bytes, rate: float, count: int) -> np.ndarray:
        """Publish at a rate and return the times from publication to answer [s].

        Answers are taken in order: with none lost, the k-th belongs to the k-th message.
        """
        sent: list[float] = []
        self.answered_at = []
        start = time.perf_counter() + 0.01
        while len(self.answered_at) < count:
            now, due = time.perf_counter(), start + len(sent) / rate
            if len(sent) < count and now >= due:
                sent.append(now)
                self.publish(data)
            elif not self.spin(due - now if len(sent) < count else 0.5) and (
                    len(sent) == count and time.perf_counter() > sent[-1] + 2):
                break
        return np.array(self.answered_at) - np.array(sent[:len(self.answered_at)])

    def _on_command(self, data: bytes) -> None:
        self.answered_at.append(time.perf_counter())
        self.commands += 1
        self.last_command = data

    def _on_status(self, data: bytes) -> None:
        self.status = json.loads(deserialize_message(data, String).data)


@contextmanager
def served(
    command: list[str], name: str = '/feedforward', domain: int | None = None,
    has_status: bool = True, kind: type = MultiDOFJointTrajectory,
) -> Iterator[tuple[Stream, Any]]:
    """Run a node as a process and give a stream that is connected to it, and the process."""
    holder = None
    if domain is None:
        domain, holder = reserve_domain()
        os.environ.update({key: value for key, value in environment(domain).items()
                           if key.startswith('ROS_')})
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / 'log'
        with node_process(command, domain, log) as process:
            stream = Stream(name, has_status, kind)
            try:
                stream.connect()
                # Equations that are not compiled yet are not what is measured.
                stream.wait_until(lambda: not stream.status.get('preparing'), 'compiled equations')
                yield stream, process
            except TimeoutError:
                print(log.read_text()[-2000:], file=sys.stderr)
                raise
            finally:
                stream.close()
    if holder is not None:
        holder.close()


def feedforward(*parameters: str, each: bool = True) -> list[str]:
    """Return the command that starts the node under test, the paper's robot without a model file.

    Parameters
    ----------
    parameters : str
        As `name:=value`.
    each : bool
        Whether every message is to be answered, however late, and not only the latest ones.
    """
    words = [word for parameter in ('demo:=true', *(EACH if each else ()), *parameters)
             for word in ('-p', parameter)]
    return [executable('feedforward'), '--ros-args', *words]


def resident_memory(process: Any) -> float:
    """Return the resident memory of a process [MB]."""
    for line in Path(f'/proc/{process.pid}/status').read_text().splitlines():
        if line.startswith('VmRSS:'):
            return int(line.split()[1]) / 1024
    return float('nan')
