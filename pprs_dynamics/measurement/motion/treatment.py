# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The one operation that measured effort and modelled forces both get: means of blocks.

Samples of effort are noisy and correlated; means of 0.01 s keep all that moves below some 20 Hz
and a fifth of the samples. The mean is linear and the same for both sides of a comparison. Were
only one of them filtered, each reversal of a drive would leave a difference that looks like
friction.

Arms move ten times as slowly as a parallel robot, and their currents hold the ripple of motor and
gear: blocks follow the motion there, as the model says.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.motion.differentiation import Smoothing, Stretch

BLOCK_DURATION, LONGEST_BLOCK = 0.01, 0.05  # [s]
SHARE = 0.9  # of the power, below the bandwidth


def motion_bandwidth(stretches: Sequence[Stretch], smoothing: Smoothing) -> float:
    """Return the frequency below which most of the accelerations' power lies, over drives [Hz].

    Every drive counts alike, however far it moves; infinite where none moves.
    """
    highest = 0.0
    for position, step, _ in stretches:
        filter_ = smoothing.polynomial(step)
        if len(position) >= 2 * filter_.window:
            highest = max(highest, bandwidth(filter_.filtered(position, 2)) / step)
    return highest or float('inf')


def bandwidth(acceleration: Array) -> float:
    """Return the bandwidth of accelerations (N, D) [1 / sample]; 0 where no drive moves."""
    window = np.hanning(len(acceleration))[:, None]
    power = np.abs(np.fft.rfft((acceleration - acceleration.mean(axis=0)) * window, axis=0)) ** 2
    total = power.sum(axis=0)
    if not np.any(total > 0):
        return 0.0
    shares: Array = np.cumsum((power[:, total > 0] / total[total > 0]).mean(axis=1))
    return int(np.searchsorted(shares, SHARE)) / len(acceleration)


def block_duration(bandwidth: float, blocks_per_period: float) -> float:
    """Return how long blocks are [s].

    Parameters
    ----------
    bandwidth : float
        Of the motion [Hz].
    blocks_per_period : float
        Of a motion at that frequency; 0 where blocks are of `BLOCK_DURATION` whatever moves.
    """
    if not blocks_per_period:
        return BLOCK_DURATION
    return min(max(1 / (blocks_per_period * bandwidth), BLOCK_DURATION), LONGEST_BLOCK)


def block_length(step: float, duration: float = BLOCK_DURATION) -> int:
    """Return how many samples, `step` apart [s], make a block of a duration [s]."""
    return max(1, round(duration / step))


class Treatment:
    """Means over blocks of consecutive samples.

    Parameters
    ----------
    starts : (M,) int array
        First sample of every block; a block ends where the next begins.
    samples : int
        N, all of which lie in blocks.
    """

    def __init__(self, starts: np.ndarray, samples: int) -> None:
        self.starts, self.samples = starts, samples
        self._counts = np.diff(np.append(starts, samples))

    def __len__(self) -> int:
        return len(self.starts)

    def __call__(self, values: Array) -> Array:
        """Return the block means of values (N, ...), (M, ...).

        A block with a NaN has none: a measurement that is missing is not made up.
        """
        values = np.asarray(values, dtype=float)
        sums = np.add.reduceat(values, self.starts, axis=0)
        return sums / self._counts.reshape((-1,) + (1,) * (values.ndim - 1))

    @cached_property
    def matrix(self) -> Any:
        """The same as a sparse matrix, (M, N)."""
        from scipy.sparse import csr_array

        edges = np.append(self.starts, self.samples)
        return csr_array((np.repeat(1 / self._counts, self._counts), np.arange(self.samples),
                          edges), shape=(len(self), self.samples))

    def blocks(self, first: int, last: int) -> Treatment:
        """Return the treatment of blocks first..last-1 alone, for their samples alone."""
        end = self.starts[last] if last < len(self) else self.samples
        start = self.starts[first]
        return Treatment(self.starts[first:last] - start, int(end - start))
