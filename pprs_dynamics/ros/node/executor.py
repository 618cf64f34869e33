# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Single-threaded executor with less overhead per message than rclpy's; stops on signals."""

from __future__ import annotations

import inspect
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any
from weakref import WeakKeyDictionary

from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.guard_condition import GuardCondition
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer

from pprs_dynamics.ros.node.rclpy_internals import InternalsChangedError, WaitSet, call_if_due, take

STOP_SIGNALS = frozenset({signal.SIGINT, signal.SIGTERM})
PATIENCE = 1.0  # [s] in which a node ends by itself
# Messages taken at once; services and timers wait for no more than these.
MESSAGES_AT_ONCE = 10
REST_PERIOD = 1.0  # [s] between looks at what nobody waits for


class StoppableExecutor(SingleThreadedExecutor):
    """rclpy's own executor, which another thread can end."""

    def __init__(self, **options: Any) -> None:
        self._stopped: Future[None] = Future()
        super().__init__(**options)

    def stop(self) -> None:
        """End `spin` after the present callback; from any thread."""
        self._stopped.set_result(None)
        with suppress(InvalidHandle):  # `spin` may have ended, and its owner destroyed all this
            self.wake()

    def spin(self) -> None:
        """Execute callbacks until `stop` or shutdown."""
        self.spin_until_future_complete(self._stopped)


class PromptExecutor(StoppableExecutor):
    """Serves messages and timers straight from the wait set; everything else goes rclpy's way.

    rclpy builds a task, a coroutine and a new wait set of every entity and every event handler
    for each message, which costs more than the model (docs/benchmarks.md). Here only services and
    guard conditions go that way. Event handlers, which report QoS that does not fit, are looked at
    once a second. With an rclpy whose internals have changed everything goes rclpy's way.
    """

    def __init__(self, **options: Any) -> None:
        # Triggered where entities come or go, or by `stop`: nothing to serve in either case.
        self._waker = GuardCondition(None, None, options.get('context'))
        self._takes_info: WeakKeyDictionary[Subscription, bool] = WeakKeyDictionary()
        super().__init__(**options)

    def wake(self) -> None:
        """Look anew at what there is to wait for."""
        super().wake()
        self._waker.trigger()

    def spin(self) -> None:
        """Execute callbacks until `stop` or shutdown."""
        try:
            self._spin_promptly()
        except InternalsChangedError as error:
            get_logger('executor').warning(
                f'this release of rclpy is not known ({error}): its own executor is used, which '
                'answers more slowly')
            super().spin()

    def _spin_promptly(self) -> None:
        rest_due, wait_set = 0.0, WaitSet(self.context)
        while not self._stopped.done() and self.context.ok():
            nodes = self.get_nodes()
            subscriptions = [subscription for node in nodes for subscription in node.subscriptions]
            timers = [timer for node in nodes for timer in node.timers]
            others = self._wait(wait_set, nodes, subscriptions, timers)
            for subscription in wait_set.ready('subscription', subscriptions):
                self._take(subscription)
            for timer in timers:
                if call_if_due(timer):
                    timer.callback()
            if others or time.monotonic() > rest_due:
                rest_due = time.monotonic() + REST_PERIOD
                self.spin_once(timeout_sec=0)

    def _wait(
        self, wait_set: WaitSet, nodes: list[Node], subscriptions: list[Subscription],
        timers: list[Timer],
    ) -> bool:
        """Wait for anything, and return whether it is neither a message nor a timer."""
        guards = [guard for node in nodes for guard in node.guards]
        clients = [client for node in nodes for client in node.clients]
        services = [service for node in nodes for service in node.services]
        wait_set.wait(subscriptions, timers, [self._waker, *guards], clients, services)
        if not self.context.ok():
            raise ExternalShutdownException
        return bool(wait_set.ready('service', services) or wait_set.ready('client', clients)
                    or wait_set.ready('guard_condition', guards))

    def _take(self, subscription: Subscription) -> None:
        wants_info = self._takes_info.get(subscription)
        if wants_info is None:
            wants_info = self._takes_info[subscription] = _takes_two(subscription.callback)
        for _ in range(MESSAGES_AT_ONCE):
            taken = take(subscription)
            if taken is None:
                return
            subscription.callback(*taken[:2 if wants_info else 1])


def _takes_two(callback: Callable[..., None]) -> bool:
    """Return whether a callback takes more than the message, by the rule of rclpy."""
    try:
        inspect.signature(callback).bind(None)
    except TypeError:
        return True
    return False


class StopSignals:
    """SIGINT and SIGTERM, waited for by a thread of their own.

    rclpy's handlers end the context at once, and with it the last word that a node must say to
    its drives. Python's handlers run only when the wait set returns. Blocked in every thread and
    waited for in one, the signals are noticed at once, and nothing is torn down behind the
    node's back. To be made before rclpy starts threads, which inherit what is blocked.
    """

    def __init__(self) -> None:
        self._executor: StoppableExecutor | None = None
        self._wanted = False
        signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
        threading.Thread(target=self._wait, daemon=True).start()

    def stop(self, executor: StoppableExecutor) -> None:
        """Stop an executor at the first signal, or now where one has come already."""
        self._executor = executor
        if self._wanted:
            executor.stop()

    def _wait(self) -> None:
        signal.sigwait(STOP_SIGNALS)
        self._wanted = True
        if self._executor is not None:
            self._executor.stop()
        # A terminal and a launcher may both pass on one Ctrl-C; who asks again later is not to be
        # kept waiting by a node that hangs.
        time.sleep(PATIENCE)
        while signal.sigtimedwait(STOP_SIGNALS, 0) is not None:
            pass
        signal.sigwait(STOP_SIGNALS)
        os._exit(1)
