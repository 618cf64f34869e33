# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stamped setpoints on their way to the simulated robot's drives."""

from __future__ import annotations

from collections import deque

from pprs_dynamics.simulation.drive_control import DriveControl, Setpoint

# Trajectories longer than this are for a trajectory controller, not for a queue of setpoints.
CAPACITY = 10_000


class SetpointQueue:
    """Gives the drives each setpoint at its own time, and the one after it to interpolate to.

    Parameters
    ----------
    control : DriveControl
    """

    def __init__(self, control: DriveControl) -> None:
        self._control = control
        self._waiting: deque[tuple[float, Setpoint]] = deque(maxlen=CAPACITY)
        self._present: tuple[float, Setpoint] | None = None
        self._told: tuple[object, object] = (None, None)

    def add(self, time: float, setpoint: Setpoint) -> None:
        """Store a setpoint for a time [s]; setpoints of the same or a later time are replaced."""
        while self._waiting and self._waiting[-1][0] >= time:
            self._waiting.pop()
        self._waiting.append((time, setpoint))

    def clear(self) -> None:
        """Forget all setpoints."""
        self._waiting.clear()
        self._present = None

    def advance(self, now: float, lag: float = 0.0) -> bool:
        """Pass the present setpoint to the drives; return False where they refuse it.

        Parameters
        ----------
        now : float
            On the clock of the setpoints' times [s].
        lag : float
            How far the drives' clock is behind that one [s].
        """
        while self._waiting and self._waiting[0][0] <= now:
            self._present = self._waiting.popleft()
        if self._present is None:
            return True
        following = self._waiting[0] if self._waiting else None
        if self._told == (self._present, following):
            return True
        self._told = (self._present, following)
        time, setpoint = self._present
        if following is None:
            return self._control.command(time - lag, setpoint, taken=now - lag)
        return self._control.command(time - lag, setpoint, following[1], following[0] - time,
                                     taken=now - lag)
