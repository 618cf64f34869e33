# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A goal whose controller dies is not waited for."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future

from pprs_dynamics.ros.node.action_answer import PERIOD, is_answered
from pprs_dynamics.ros.node.executor import StoppableExecutor

pytestmark = pytest.mark.nodes


@dataclass
class Client:
    """What is asked of an action's client; no wheel has the interfaces of an action."""

    is_ready: bool = True

    def server_is_ready(self) -> bool:
        """Return whether somebody serves the action."""
        return self.is_ready


@contextmanager
def spun(**options: Any) -> Iterator[tuple[Node, StoppableExecutor]]:
    """Give a node that the executor of nodes with actions spins in a thread."""
    context = Context()
    rclpy.init(context=context)
    executor = StoppableExecutor(context=context)
    node = Node('waiting', context=context, **options)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield node, executor
    finally:
        executor.stop()
        thread.join(10)
        node.destroy_node()
        context.try_shutdown()


def within(task: Any, patience: float) -> Any:
    """Return the result of a task, or fail where there is none in time [s]."""
    end = time.monotonic() + patience
    while not task.done() and time.monotonic() < end:
        time.sleep(0.01)
    assert task.done()
    return task.result()


def test_an_answer_is_taken_as_it_comes() -> None:
    with spun() as (node, executor):
        answer: Future[str] = Future()
        task = executor.create_task(is_answered(node, Client(), answer))
        begin = time.process_time()
        time.sleep(3 * PERIOD)
        assert not task.done()
        assert time.process_time() - begin < PERIOD  # it waits, and does not ask all the time
        answer.set_result('done')
        assert within(task, 2.0)
        assert not list(node.timers)


@pytest.mark.parametrize('is_simulated', [False, True])  # a simulated clock that nobody drives
def test_a_server_that_goes_ends_the_wait(is_simulated: bool) -> None:
    with spun(parameter_overrides=[Parameter('use_sim_time', value=is_simulated)]) as (
            node, executor):
        client, answer = Client(), Future[str]()
        task = executor.create_task(is_answered(node, client, answer))
        time.sleep(2 * PERIOD)
        assert not task.done()
        client.is_ready = False
        assert not within(task, 4 * PERIOD)
        assert not list(node.timers)
