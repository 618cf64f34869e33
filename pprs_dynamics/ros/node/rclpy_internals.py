# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Private names of rclpy that the nodes use; no other file does.

They may change with any release. A name that is missing or behaves in another way ends in
InternalsChangedError, and the executor then spins as rclpy's own, which costs latency.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.timer import Timer

try:
    from rclpy.impl import implementation_singleton

    rclpy_implementation: Any = implementation_singleton.rclpy_implementation
except (ImportError, AttributeError):
    rclpy_implementation = None

FOR_EVER = -1  # [ns]
# RuntimeError is the public base of rclpy's own errors.
_CHANGED = (AttributeError, TypeError, RuntimeError)


class InternalsChangedError(Exception):
    """A name of rclpy's that is not public behaves in another way than it did."""


class WaitSet:
    """Waits for any of some entities; made anew only where their numbers change.

    Parameters
    ----------
    context : Context
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._wait_set: Any = None
        self._sizes: tuple[int, ...] = ()

    def wait(
        self, subscriptions: Sequence[Any], timers: Sequence[Any] = (),
        guards: Sequence[Any] = (), clients: Sequence[Any] = (), services: Sequence[Any] = (),
        timeout: int = FOR_EVER,
    ) -> None:
        """Return when one of them is ready, or after a time [ns]."""
        sizes = (len(subscriptions), len(guards), len(timers), len(clients), len(services), 0)
        try:
            if sizes != self._sizes:
                self._wait_set = rclpy_implementation.WaitSet(*sizes, self._context.handle)
                self._sizes = sizes
            wait_set = self._wait_set
            wait_set.clear_entities()
            for add, entities in ((wait_set.add_subscription, subscriptions),
                                  (wait_set.add_timer, timers),
                                  (wait_set.add_guard_condition, guards),
                                  (wait_set.add_client, clients),
                                  (wait_set.add_service, services)):
                for entity in entities:
                    add(entity.handle)
            wait_set.wait(timeout)
        except _CHANGED as error:
            raise InternalsChangedError(f'WaitSet: {error}') from error

    def ready(self, kind: str, entities: Sequence[Any]) -> list[Any]:
        """Return the ready entities of a kind, e.g. 'subscription'."""
        if not entities:
            return []
        try:
            pointers = self._wait_set.get_ready_entities(kind)
            return [entity for entity in entities if entity.handle.pointer in pointers]
        except _CHANGED as error:
            raise InternalsChangedError(f'WaitSet: {error}') from error


def take(subscription: Subscription) -> tuple[Any, Any] | None:
    """Return the next message, or its bytes, with its transport information; None without one."""
    try:
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        return None if taken is None else (taken[0], taken[1])
    except InvalidHandle:
        return None  # destroyed by what was served before
    except (*_CHANGED, IndexError) as error:
        raise InternalsChangedError(f'Subscription: {error}') from error


def call_if_due(timer: Timer) -> bool:
    """Return whether a timer is due, and note that it was called; False where it is destroyed."""
    try:
        with timer.handle:
            due = timer.handle.is_timer_ready()
            if due:
                timer.handle.call_timer()
    except InvalidHandle:
        return False
    except _CHANGED as error:
        raise InternalsChangedError(f'Timer: {error}') from error
    return bool(due)


def destroy_state_machine(node: LifecycleNode) -> None:
    """Destroy the state machine of a destroyed managed node.

    Its state machine holds the node, and with it the DDS participant, until Python's garbage
    collection finds the circle; of frozen objects it never does.
    """
    machine: Any = getattr(node, '_state_machine', None)
    if hasattr(machine, 'destroy_when_not_in_use'):
        machine.destroy_when_not_in_use()


def parameter_overrides(node: Node) -> dict[str, Any]:
    """Return the parameters of files and of the command line, None for an empty list."""
    return {name: parameter.value for name, parameter in node._parameter_overrides.items()}
