# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The executor: messages, timers, services, entities that come and go, and stopping."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import String

from pprs_dynamics.ros.node import rclpy_internals
from pprs_dynamics.ros.node.executor import PromptExecutor

pytestmark = pytest.mark.nodes

PATIENCE = 60.0  # [s]


@pytest.fixture(params=['known', 'changed'])
def spun(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch,
) -> Iterator[tuple[Node, PromptExecutor]]:
    """A node and its executor, with the known rclpy and with one whose internals differ."""
    if request.param == 'changed':
        monkeypatch.setattr(rclpy_internals, 'rclpy_implementation', None)
    context = Context()
    rclpy.init(context=context)
    node, executor = Node('spun', context=context), PromptExecutor(context=context)
    executor.add_node(node)
    # Whatever happens, the test ends.
    limit = threading.Timer(PATIENCE, executor.stop)
    limit.start()
    yield node, executor
    limit.cancel()
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def test_it_serves_messages_with_and_without_info_timers_and_services(
    spun: tuple[Node, PromptExecutor],
) -> None:
    node, executor = spun
    plain: list[Any] = []
    informed: list[Any] = []
    answered: list[Any] = []
    publisher = node.create_publisher(String, '~/words', 10)
    node.create_subscription(String, '~/words', plain.append, 10)
    node.create_subscription(
        String, '~/words', lambda data, info: informed.append((data, info)), 10, raw=True)
    from rcl_interfaces.srv import GetParameters

    client = node.create_client(GetParameters, '/spun/get_parameters')

    def tick() -> None:
        publisher.publish(String(data='word'))
        if client.service_is_ready() and not answered:
            answered.append(None)
            client.call_async(GetParameters.Request(names=['use_sim_time'])).add_done_callback(
                lambda future: answered.append(future.result()))
        if len(plain) > 5 and len(informed) > 5 and len(answered) == 2:
            executor.stop()

    node.create_timer(0.01, tick)
    executor.spin()
    assert len(answered) == 2
    assert plain[0].data == 'word'
    assert b'word' in informed[0][0]
    assert informed[0][1]['source_timestamp'] > 0


def test_entities_may_come_and_go_in_callbacks(spun: tuple[Node, PromptExecutor]) -> None:
    node, executor = spun
    publisher = node.create_publisher(String, '~/words', 10)
    received: list[int] = []
    subscriptions: list[Any] = []

    def change() -> None:
        for old in subscriptions:
            node.destroy_subscription(old)
        subscriptions[:] = [
            node.create_subscription(String, '~/words', lambda _: received.append(1), 10)
            for _ in range(3)]
        publisher.publish(String(data='word'))
        once = node.create_timer(0.001, lambda: node.destroy_timer(once))
        if len(received) > 60:
            executor.stop()

    node.create_timer(0.03, change)
    executor.spin()
    assert len(received) > 60


def test_a_cancelled_timer_stays_silent_and_can_be_set_again(
    spun: tuple[Node, PromptExecutor],
) -> None:
    node, executor = spun
    fired: list[float] = []
    lone = node.create_timer(0.02, lambda: (fired.append(time.monotonic()), lone.cancel()))

    def again() -> None:
        if len(fired) == 3:
            executor.stop()
        lone.reset()

    node.create_timer(0.1, again)
    executor.spin()
    assert len(fired) == 3


def test_stopping_from_another_thread_is_noticed_though_nothing_happens(
    spun: tuple[Node, PromptExecutor],
) -> None:
    _, executor = spun
    threading.Timer(0.2, executor.stop).start()
    began = time.monotonic()
    executor.spin()
    assert time.monotonic() - began < PATIENCE / 2


def test_a_bug_in_a_callback_surfaces(spun: tuple[Node, PromptExecutor]) -> None:
    node, executor = spun
    node.create_timer(0.01, lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        executor.spin()
