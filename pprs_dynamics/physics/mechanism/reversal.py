# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Smoothed sign function of a velocity, tanh(v / v_rev), for dry friction.

A hard sign costs up to 0.9 N of spurious force at a reversal of the paper's robot, and it is
undefined at rest. The paper takes "the modulus of the relative velocity" into account without
a formula; here sgn(v) = tanh(v / v_rev), which is 0 at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tanh
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array


@dataclass(frozen=True)
class Reversal:
    """Widths in which friction turns over when a motion reverses.

    Parameters
    ----------
    velocity : float or sequence of 6 floats
        Of all drives, or of each [m/s].
    rate : float
        Of the passive joints that turn [rad/s].
    slide : float
        Of passive slides [m/s].
    """

    velocity: float | tuple[float, ...] = 0.001
    rate: float = 0.001
    slide: float = 0.001

    def widths(self, drives: int) -> Array:
        """Return the width of each drive [m/s], (D,)."""
        return np.broadcast_to(np.asarray(self.velocity, dtype=float), (drives,))


def smooth_sign(velocity: Any, reversal_velocity: Any) -> Any:
    """Return sgn(v) as tanh(v / v_rev); a width per column of (N, D) velocities is allowed."""
    return np.tanh(velocity / reversal_velocity)


def sign_over_speed(speed: Any, reversal_velocity: Any) -> Any:
    """Return tanh(s / v_rev) / s for a number s >= 0, with its limit 1 / v_rev at rest."""
    # Below 1e-8 the quotient equals its limit to rounding; dividing there would give 0 / 0.
    smallest = 1e-8 * reversal_velocity
    safe = smallest if speed < smallest else speed
    return tanh(safe / reversal_velocity) / safe
