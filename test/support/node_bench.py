# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A node under test and a probe that talks to it, in one single-threaded executor."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from documents import checked
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Bench:
    """Spins everything that was added until a condition holds."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.executor = SingleThreadedExecutor(context=context)
        self.probe = Node('probe', context=context)
        self.executor.add_node(self.probe)
        self.subscriptions: list[Any] = []
        self._status_topics: list[str] = []
        self.status: list[dict[str, Any]] = []

    def add(self, factory: Callable[..., Node], **options: Any) -> Node:
        """Start a node under test."""
        node = factory(context=self.context, **options)
        self.executor.add_node(node)
        return node

    def listen(self, message_type: type, topic: str, qos: Any = 100) -> list[Any]:
        """Return a list that fills with what arrives on a topic."""
        received: list[Any] = []
        self.subscriptions.append(
            self.probe.create_subscription(message_type, topic, received.append, qos))
        return received

    def connected(self) -> bool:
        """Spin until every topic listened to has its publisher, on both sides."""
        found = self.spin_until(
            lambda: all(subscription.get_publisher_count() for subscription in self.subscriptions))
        # Discovery is one-sided: a publisher may see us a moment after we see it. Subscriptions
        # are announced in order, so a node that answers the latest one knows all the others.
        for topic in self._status_topics:
            answers = self.listen(String, topic, LATCHED)
            found = found and self.spin_until(lambda answers=answers: answers)
        self.spin_for(0.5)
        return found

    def follow_status(self, topic: str) -> None:
        """Keep every status of a node, decoded and as its schema says, in `status`."""
        self._status_topics.append(topic)
        self.probe.create_subscription(
            String, topic, lambda message: self.status.append(checked(message.data)),
            LATCHED)

    def spin_until(self, predicate: Callable[[], Any], timeout: float = 60.0) -> bool:
        """Spin until the predicate holds; False where it does not in time, on any machine."""
        deadline = time.monotonic() + timeout
        while not predicate():
            if time.monotonic() > deadline:
                return False
            self.executor.spin_once(timeout_sec=0.02)
        return True

    def spin_for(self, duration: float) -> None:
        """Spin for a time [s], e.g. to show that nothing comes."""
        self.spin_until(lambda: False, duration)


def overrides(**values: Any) -> list[Parameter]:
    """Return parameters as a node takes them when it starts, `__` in a name for the dot.

    The robot is the paper's where they hold none.
    """
    return [Parameter(name.replace('__', '.'), value=value)
            for name, value in {'demo': True, **values}.items()]


@contextmanager
def bench() -> Iterator[Bench]:
    """Give a bench with a context of its own."""
    context = Context()
    rclpy.init(context=context)
    bench = Bench(context)
    try:
        yield bench
    finally:
        for node in bench.executor.get_nodes():
            node.destroy_node()
        bench.executor.shutdown()
        context.try_shutdown()
