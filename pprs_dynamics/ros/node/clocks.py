# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Timers and the command watchdog on the steady clock; check for a missing /clock."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.timer import Timer

from pprs_dynamics.ros.messages.conversions import NANOSECONDS

IDLE = 3600.0  # [s] period of a timer that is cancelled
LOOKS = 4  # within a timeout, at whether ROS time still advances
SHORTEST_LOOK = 1_000_000  # [ns]
# [ns] of steady time without an advance of /clock: simulators may publish it at 2 Hz, and a busy
# machine delays it by some tenths of a second.
CLOCK_STANDS = 1_000_000_000
MISSING_CLOCK = ('use_sim_time is true and nothing has come on /clock: stamps count from 0, and '
                 'timers of the simulation do not run')


def steady_clock() -> Clock:
    """Return a clock that goes on whatever happens to the time of day or of a simulation."""
    return Clock(clock_type=ClockType.STEADY_TIME)


def steady_timer(node: Node, period: float, callback: Callable[[], None]) -> Timer:
    """Create a timer on the steady clock, with a period [s]."""
    return node.create_timer(period, callback, clock=steady_clock())


def clock_is_missing(node: Node) -> bool:
    """Return whether the node goes by a simulation's clock that has not come yet."""
    return bool(node.get_parameter('use_sim_time').value and not node.get_clock().now().nanoseconds)


class CommandWatchdog:
    """Calls back once when the command of the last trajectory has gone stale.

    It is stale when ROS time has passed the end of the trajectory by the timeout. It is also stale
    when ROS time has not advanced for a second of steady time, or for the timeout if that is
    longer, as where a simulation stops or its clock never comes. Time that is set back counts as
    no advance.

    Parameters
    ----------
    node : Node
    timeout : callable
        Returns how long commands stay fresh after a trajectory's end [s]; 0: for ever.
    stale : callable
        Called once, until `feed` is called again, with whether ROS time stands still.
    """

    def __init__(
        self, node: Node, timeout: Callable[[], float], stale: Callable[[bool], None],
    ) -> None:
        self._node, self._timeout, self._stale = node, timeout, stale
        self._steady = steady_clock()
        self.fresh = False  # whether a command is in force that has not gone stale
        self._left = self._seen = self._advanced = 0  # [ns], the last on the steady clock
        self._timer = node.create_timer(IDLE, self._look, clock=self._steady)
        self._timer.cancel()

    @property
    def left(self) -> int:
        """ROS time until the end of the last trajectory [ns]; 0 where it has passed."""
        self._note_time()
        return max(0, self._left)

    def feed(self, ahead: int) -> None:
        """Take note of a trajectory that ends that much ROS time from now [ns]."""
        self._note_time()
        self._left, self._advanced = max(ahead, 0), self._steady.now().nanoseconds
        if not self.fresh:
            self.fresh = True
            self.rearm()

    def rearm(self) -> None:
        """Take a changed timeout into account."""
        timeout = round(self._timeout() * NANOSECONDS)
        if not self.fresh or not timeout:
            self._timer.cancel()
            return
        # A trajectory that comes before the next look can go stale only after it.
        self._timer.timer_period_ns = max(
            min(self._left + timeout, timeout // LOOKS), SHORTEST_LOOK)
        self._timer.reset()

    def stop(self) -> None:
        """Expect nothing more."""
        self.fresh = False
        self._timer.cancel()

    def destroy(self) -> None:
        """Give the timer back."""
        self._node.destroy_timer(self._timer)

    def _note_time(self) -> None:
        now = self._node.get_clock().now().nanoseconds
        if now > self._seen:
            self._left -= now - self._seen
            self._advanced = self._steady.now().nanoseconds
        self._seen = now

    def _look(self) -> None:
        self._note_time()
        timeout = round(self._timeout() * NANOSECONDS)
        stands = (self._steady.now().nanoseconds - self._advanced >= max(timeout, CLOCK_STANDS))
        if timeout and self.fresh and (stands or self._left + timeout <= 0):
            self.stop()
            self._stale(stands)
        else:
            self.rearm()
