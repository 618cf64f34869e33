# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The same smoothing sample by sample: what came in half a window ago, known from both sides."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.stamps import LOST_STEPS
from pprs_dynamics.measurement.motion.differentiation import LocalPolynomial

# Stamps that are off by less, in steps, count as equal steps.
UNEVEN = 0.02


class LiveSample(NamedTuple):
    """The middle of the window; drives (D,).

    Parameters
    ----------
    time : float
        [s].
    position, velocity, acceleration : (D,) arrays
        Smoothed [m, m/s, m/s^2].
    effort : (D,) array
        As measured then [N]; NaN where it was not.
    is_start : bool
        True after a gap or at the beginning: unfinished blocks and memories start afresh.
    """

    time: float
    position: Array
    velocity: Array
    acceleration: Array
    effort: Array
    is_start: bool


class LiveReconstruction:
    """A window that follows the samples; its answers come `polynomial.half` samples late.

    Answers equal those of `reconstruct` with the same window for samples at equal steps. Where
    stamps are uneven, the motion is the smoother one of that with samples at their stamps and
    that with samples at equal steps, which came late. The platform's motion then follows by
    `solve_forward_motion`, seeded with the last pose.

    Parameters
    ----------
    polynomial : LocalPolynomial
        With the step at which samples are expected.
    """

    def __init__(self, polynomial: LocalPolynomial) -> None:
        self.polynomial = polynomial
        self.gaps = 0
        half = polynomial.half
        self._even: Array = np.arange(-half, half + 1, dtype=float) * polynomial.step
        self._window: deque[tuple[float, Array, Array]] = deque(maxlen=polynomial.window)
        self._is_start = True

    def push(self, time: float, position: ArrayLike, effort: ArrayLike) -> LiveSample | None:
        """Take a sample, and return the middle of the window once that is full.

        A stamp that is not later than the last, or later by more than 1.5 steps, is a gap: the
        window starts again. A sample with a position that is not finite is left out, which
        makes a gap of its own.
        """
        q, F = np.array(position, dtype=float), np.array(effort, dtype=float)
        if not np.isfinite(time) or not np.all(np.isfinite(q)):
            return None
        if self._window:
            passed = time - self._window[-1][0]
            if not 0 < passed <= LOST_STEPS * self.polynomial.step:
                self.gaps += 1
                self._window.clear()
                self._is_start = True
        self._window.append((time, q, F))
        if len(self._window) < self.polynomial.window:
            return None
        middle = self._window[self.polynomial.half]
        # About the middle, as large constants would cost digits.
        around = np.stack([sample[1] for sample in self._window]) - middle[1]
        offsets = np.array([sample[0] for sample in self._window]) - middle[0]
        if np.abs(offsets - self._even).max() > UNEVEN * self.polynomial.step:
            q_smooth, q_dot, q_ddot = self._smoother(offsets, around)
        else:
            q_smooth, q_dot, q_ddot = self.polynomial.coefficients @ around
        sample = LiveSample(middle[0], middle[1] + q_smooth, q_dot, q_ddot, middle[2],
                            self._is_start)
        self._is_start = False
        return sample

    def _smoother(self, offsets: Array, around: Array) -> Array:
        """Return value and derivatives where stamps are uneven, (3, D)."""
        ways = [self.polynomial.fitted(times, around) for times in (offsets, self._even)]
        return min(ways, key=lambda way: way[1])[0]
