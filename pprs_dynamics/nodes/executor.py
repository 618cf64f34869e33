"""An executor that serves subscriptions without detours, and can be stopped by a signal."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.timer import Timer

STOP_SIGNALS = frozenset({signal.SIGINT, signal.SIGTERM})
PATIENCE = 1.0  # [s] in which a node ends by itself
# Messages taken at once; services and timers wait for no more than these.
MESSAGES_AT_ONCE = 10
REST_PERIOD = 1.0  # [s] between looks at what nobody waits for


class PromptExecutor(SingleThreadedExecutor):
    """Serves messages and timers straight from the wait set; everything else goes rclpy's way.

    rclpy builds a task, a coroutine and a new wait set of every entity and every event handler
    for each message, which costs more than the model. Here messages and timers are served at
    once, and only services and guard conditions go that way. Event handlers, which tell of QoS
    that does not fit, are looked at once a second.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._stopped = False
        self._wait_set: Any = None
        self._sizes: tuple[int, ...] = ()

    def stop(self) -> None:
        """End `spin` after the present callback; from any thread."""
        self._stopped = True
        self.wake()

    def spin(self) -> None:
        """Execute callbacks until `stop` or shutdown."""
        rest_due = 0.0
        while not self._stopped and self._context.ok() and not self._is_shutdown:
            nodes = self.get_nodes()
            subscriptions = [each for node in nodes for each in node.subscriptions]
            timers = [each for node in nodes for each in node.timers]
            others = self._wait(nodes, subscriptions, timers)
            messages = self._wait_set.get_ready_entities('subscription')
            for subscription in subscriptions:
                if subscription.handle.pointer in messages:
                    self._take(subscription)
            for timer in timers:
                self._fire(timer)
            if others or time.monotonic() > rest_due:
                rest_due = time.monotonic() + REST_PERIOD
                self.spin_once(timeout_sec=0)

    def _wait(
        self, nodes: list[Node], subscriptions: list[Subscription], timers: list[Timer],
    ) -> bool:
        """Wait for anything, and return whether it is neither a message nor a timer."""
        # Woken where entities come or go, or by `stop`: nothing to serve in either case.
        wakers = [each.handle for each in (self._guard, self._sigint_gc) if each is not None]
        guards = [each.handle for node in nodes for each in node.guards]
        clients = [each.handle for node in nodes for each in node.clients]
        services = [each.handle for node in nodes for each in node.services]
        sizes = (len(subscriptions), len(wakers) + len(guards), len(timers), len(clients),
                 len(services), 0)
        if sizes != self._sizes:
            self._wait_set = rclpy_implementation.WaitSet(*sizes, self._context.handle)
            self._sizes = sizes
        wait_set = self._wait_set
        wait_set.clear_entities()
        for subscription in subscriptions:
            wait_set.add_subscription(subscription.handle)
        for timer in timers:
            wait_set.add_timer(timer.handle)
        for add, handles in ((wait_set.add_guard_condition, wakers),
                             (wait_set.add_guard_condition, guards),
                             (wait_set.add_client, clients), (wait_set.add_service, services)):
            for handle in handles:
                add(handle)
        wait_set.wait(-1)
        if not self._context.ok():
            raise ExternalShutdownException
        if services and wait_set.get_ready_entities('service'):
            return True
        if clients and wait_set.get_ready_entities('client'):
            return True
        ready = wait_set.get_ready_entities('guard_condition') if guards else ()
        return any(handle.pointer in ready for handle in guards)

    def _take(self, subscription: Subscription) -> None:
        wants_info = subscription._callback_type is Subscription.CallbackType.WithMessageInfo
        for _ in range(MESSAGES_AT_ONCE):
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                return
            subscription.callback(*taken[:2 if wants_info else 1])

    def _fire(self, timer: Timer) -> None:
        try:
            with timer.handle:
                if not timer.handle.is_timer_ready():
                    return
                timer.handle.call_timer()
        except InvalidHandle:
            return  # destroyed by what was served before
        timer.callback()


class StopSignals:
    """SIGINT and SIGTERM, waited for by a thread of their own.

    rclpy's handlers end the context at once, and with it the last word that a node must say to
    its drives. Python's handlers run only when the wait set returns. Blocked in every thread and
    waited for in one, the signals are noticed at once, and nothing is torn down behind the
    node's back. To be made before rclpy starts threads, which inherit what is blocked.
    """

    def __init__(self, stop: Callable[[], None]) -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
        threading.Thread(target=self._wait, args=(stop,), daemon=True).start()

    @staticmethod
    def _wait(stop: Callable[[], None]) -> None:
        signal.sigwait(STOP_SIGNALS)
        stop()
        # A terminal and a launcher may both pass on one Ctrl-C; who asks again later is not to be
        # kept waiting by a node that hangs.
        time.sleep(PATIENCE)
        while signal.sigtimedwait(STOP_SIGNALS, 0) is not None:
            pass
        signal.sigwait(STOP_SIGNALS)
        os._exit(1)
