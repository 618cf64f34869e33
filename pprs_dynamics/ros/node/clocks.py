# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What goes by the steady (monotonic) clock: timers, stale commands; whether /clock is missing."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.timer import Timer

from pprs_dynamics.ros.messages.conversions import NANOSECONDS

IDLE = 3600.0  # [s] period of a timer that is cancelled
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


class CommandWatchdog:
    """Calls back once when nothing has been commanded for a while after the last trajectory.

    Runs on the steady clock: a simulation that stands still, or whose clock never comes, must not
    keep a command in force.

    Parameters
    ----------
    node : Node
    timeout : callable
        Returns how long commands stay fresh after a trajectory's end [s]; 0: for ever.
    stale : callable
        Called once, until `feed` is called again.
    """

    def __init__(
        self, node: Node, timeout: Callable[[], float], stale: Callable[[], None],
    ) -> None:
        self._node, self._timeout, self._stale = node, timeout, stale
        self._clock = steady_clock()
        self._end: int | None = None
        self._end_looked_at = 0
        self._timer = node.create_timer(IDLE, self._look, clock=self._clock)
        self._timer.cancel()

    @property
    def fresh(self) -> bool:
        """Whether a command is in force that has not gone stale."""
        return self._end is not None

    @property
    def left(self) -> int:
        """Until the end of the last trajectory [ns]; 0 where it has passed."""
        return 0 if self._end is None else max(0, self._end - self._clock.now().nanoseconds)

    def feed(self, ahead: int) -> None:
        """Tell of a trajectory that ends that much from now [ns]; one in the past ends now."""
        end = self._clock.now().nanoseconds + max(ahead, 0)
        # A timer that runs finds a later end by itself; one a cycle need not be set.
        earlier = self._end is None or end < self._end_looked_at
        self._end = end
        if earlier:
            self.rearm()

    def rearm(self) -> None:
        """Take a changed timeout into account."""
        timeout = self._timeout()
        if self._end is None or not timeout:
            self._timer.cancel()
            return
        self._end_looked_at = self._end
        left = self._end + round(timeout * NANOSECONDS) - self._clock.now().nanoseconds
        self._timer.timer_period_ns = max(left, 1)
        self._timer.reset()

    def stop(self) -> None:
        """Expect nothing more."""
        self._end = None
        self._timer.cancel()

    def destroy(self) -> None:
        """Give the timer back."""
        self._node.destroy_timer(self._timer)

    def _look(self) -> None:
        if self._end is None:
            self._timer.cancel()
            return
        due = self._end + round(self._timeout() * NANOSECONDS)
        if self._clock.now().nanoseconds < due:
            # The next look is when the present trajectory would go stale, and not before.
            self.rearm()
            return
        self.stop()
        self._stale()
