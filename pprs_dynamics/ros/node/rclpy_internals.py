# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Private names of rclpy that the nodes use; no other file does.

They may change with any release. `missing` tells which of them an rclpy lacks, and each has rclpy's
public way beside it: the executor then spins as rclpy's own, which costs latency, and parameters
are asked for one by one. A name that is there but behaves in another way ends in
InternalsChangedError.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription
from rclpy.timer import Timer

try:
    from rclpy.impl import implementation_singleton

    rclpy_implementation: Any = implementation_singleton.rclpy_implementation
except (ImportError, AttributeError):
    rclpy_implementation = None

FOR_EVER = -1  # [ns]
TRIALS, TRIAL = 20, 50_000_000  # waits for a timer that is due at once; each at most so long [ns]
# What handles must offer for messages and timers to be served without rclpy's executor.
NAMES = {
    'WaitSet': ('clear_entities', 'add_subscription', 'add_timer', 'add_guard_condition',
                'add_client', 'add_service', 'wait', 'get_ready_entities'),
    'Subscription': ('take_message', 'pointer'),
    'Timer': ('is_timer_ready', 'call_timer'),
    'GuardCondition': ('pointer',),
}
OVERRIDES = '_parameter_overrides'
STATE_MACHINE = '_state_machine'
# RuntimeError is the public base of rclpy's own errors.
_CHANGED = (AttributeError, TypeError, RuntimeError)


class InternalsChangedError(Exception):
    """A name of rclpy's that is not public behaves in another way than it did."""


def missing() -> list[str]:
    """Return the names that this rclpy lacks for `WaitSet`, `take` and `call_if_due`."""
    absent = []
    for kind, names in NAMES.items():
        offered = getattr(rclpy_implementation, kind, None)
        if offered is None:
            absent.append(kind)
        else:
            absent += [f'{kind}.{name}' for name in names if not hasattr(offered, name)]
    return absent


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
        """Return those entities of a kind that were ready, e.g. a 'subscription'."""
        if not entities:
            return []
        try:
            pointers = self._wait_set.get_ready_entities(kind)
            return [entity for entity in entities if entity.handle.pointer in pointers]
        except _CHANGED as error:
            raise InternalsChangedError(f'WaitSet: {error}') from error


def take(subscription: Subscription) -> tuple[Any, Any] | None:
    """Return the next message, or its bytes, and what is known of its way; None where none is."""
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


def works(node: Node) -> bool:
    """Return whether a timer of a node is served, as `WaitSet` and `call_if_due` would.

    Raises
    ------
    InternalsChangedError
    """
    timer = node.create_timer(0.0001, lambda: None, clock=Clock(clock_type=ClockType.STEADY_TIME))
    try:
        wait_set = WaitSet(node.context)
        for _ in range(TRIALS):
            wait_set.wait((), [timer], timeout=TRIAL)
            if wait_set.ready('timer', [timer]) and call_if_due(timer):
                return True
        return False
    finally:
        node.destroy_timer(timer)


def destroy_state_machine(node: LifecycleNode) -> None:
    """Let go of what rclpy leaves of a destroyed managed node.

    Its state machine holds the node, and with it the DDS participant, until Python's garbage
    collection finds the circle; of frozen objects it never does.
    """
    machine: Any = getattr(node, STATE_MACHINE, None)
    if hasattr(machine, 'destroy_when_not_in_use'):
        machine.destroy_when_not_in_use()


def parameter_overrides(
    node: Node, candidates: Callable[[], Iterable[str]],
) -> dict[str, Any]:
    """Return what was given in files and on the command line, None for an empty list.

    Parameters
    ----------
    node : Node
    candidates : callable
        Returns the names to ask for where rclpy does not show which were given; others go unseen
        then, and empty lists are left out.
    """
    given = getattr(node, OVERRIDES, None)
    if given is not None:
        return {name: parameter.value for name, parameter in given.items()}
    found = {}
    for name in candidates():
        if node.has_parameter(name):
            continue  # of rclpy's own
        # A parameter that is declared without a value has the one that was given.
        parameter = node.declare_parameter(name, descriptor=ParameterDescriptor(
            dynamic_typing=True))
        if parameter.type_ != Parameter.Type.NOT_SET:
            found[name] = parameter.value
        node.undeclare_parameter(name)
    return found
