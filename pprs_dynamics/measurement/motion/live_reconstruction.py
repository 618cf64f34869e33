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
UNEVEN = 0.001
# Samples in a row that may be missing, as transport loses them: the polynomial goes through those
# that are there. More are a standstill of the sender.
BRIDGED = 2
MOST_MISSING = 0.25  # share of the window, beyond which the stream has another rate


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
    that with samples at equal steps, which came late. Where one or two samples are missing it is
    that of the others.

    Parameters
    ----------
    polynomial : LocalPolynomial
        With the step at which samples are expected.
    """

    def __init__(self, polynomial: LocalPolynomial) -> None:
        self.polynomial = polynomial
        self.gaps = self.bridged = 0
        half = polynomial.half
        self._even: Array = np.arange(-half, half + 1, dtype=float) * polynomial.step
        # None: a sample that is missing.
        self._window: deque[tuple[float, Array, Array] | None] = deque(maxlen=polynomial.window)
        self._is_start = True

    def push(self, time: float, position: ArrayLike, effort: ArrayLike) -> LiveSample | None:
        """Take a sample, and return the middle of the window once that is full.

        A stamp that is not later than the last, or later by more than 3.5 steps, is a gap: the
        window starts again, as where more than a quarter of it is missing. What is missing has no
        answer of its own.
        """
        q, F = np.array(position, dtype=float), np.array(effort, dtype=float)
        if self._window and (last := self._window[-1]) is not None:
            self._go_on((time - last[0]) / self.polynomial.step)
        self._window.append((time, q, F))
        middle = (self._window[self.polynomial.half]
                  if len(self._window) == self.polynomial.window else None)
        if middle is None:
            return None
        there = [sample for sample in self._window if sample is not None]
        # About the middle, as large constants would cost digits.
        around = np.stack([sample[1] for sample in there]) - middle[1]
        offsets = np.array([sample[0] for sample in there]) - middle[0]
        even = self._even
        if len(there) < len(self._window):
            even = even[[sample is not None for sample in self._window]]
        if len(even) < len(self._even) or (
                np.abs(offsets - even).max() > UNEVEN * self.polynomial.step):
            q_smooth, q_dot, q_ddot = self._smoother(offsets, even, around)
        else:
            q_smooth, q_dot, q_ddot = self.polynomial.coefficients @ around
        sample = LiveSample(middle[0], middle[1] + q_smooth, q_dot, q_ddot, middle[2],
                            self._is_start)
        self._is_start = False
        return sample

    def _go_on(self, steps: float) -> None:
        """Note what is missing since the last sample, so many steps ago, or begin again."""
        missing = round(steps) - 1 if steps > LOST_STEPS else 0
        holes = sum(sample is None for sample in self._window)
        if steps > 0 and missing <= BRIDGED and (
                not missing or holes + missing <= MOST_MISSING * self.polynomial.window):
            self.bridged += missing
            self._window.extend([None] * missing)
            return
        self.gaps += 1
        self._window.clear()
        self._is_start = True

    def _smoother(self, offsets: Array, even: Array, around: Array) -> Array:
        """Return value and derivatives where stamps are uneven, or samples missing, (3, D)."""
        ways = [self.polynomial.fitted(times, around) for times in (offsets, even)]
        return min(ways, key=lambda way: way[1])[0]
