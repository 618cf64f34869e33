# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Steady (monotonic) clock of timers; detection of a missing /clock."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.timer import Timer

MISSING_CLOCK = ('use_sim_time is true and nothing has come on /clock: stamps count from 0, and '
                 'what goes by the time of the simulation stands still')


def steady_clock() -> Clock:
    """Return a clock that goes on whatever happens to the time of day or of a simulation."""
    return Clock(clock_type=ClockType.STEADY_TIME)


def steady_timer(node: Node, period: float, callback: Callable[[], None]) -> Timer:
    """Create a timer on the steady clock, with a period [s]."""
    return node.create_timer(period, callback, clock=steady_clock())


def clock_is_missing(node: Node) -> bool:
    """Return whether the node goes by a simulation's clock that has not come yet."""
    return bool(node.get_parameter('use_sim_time').value
                and not node.get_clock().now().nanoseconds)
