# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Noise of measured efforts, of any colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import COUNT

# Correlation times of the slow processes that add up to 1/f noise [samples], a factor 4 apart:
# the sum follows 1/f within 10 % from 1/200 of the sampling rate down to 1/400 000 of it.
PINK_TIMES = 2.0 * 4.0 ** np.arange(9)


@dataclass(frozen=True)
class NoiseSettings:
    """Standard deviations of noise [N], and how it is correlated.

    Parameters
    ----------
    white, coloured, pink : float
    correlation : float
        Of the coloured noise, from sample to sample; AR(1).
    pink_exponent : float
        a of the pink noise's spectrum 1/f^a, 0 < a < 2.
    """

    white: float = 0.064
    coloured: float = 0.048
    correlation: float = 0.9
    pink: float = 0.0
    pink_exponent: float = 1.0


class EffortNoise:
    """White, AR(1) and 1/f noise of the drives' efforts.

    Parameters
    ----------
    settings : NoiseSettings
    rng : numpy.random.Generator
    drives : int

    Notes
    -----
    1/f^a noise is a sum of AR(1) processes whose correlation times lie evenly on a logarithmic
    scale and whose variances go with time^(a - 1).
    """

    def __init__(self, settings: NoiseSettings, rng: np.random.Generator, drives: int = COUNT,
                 ) -> None:
        self._rng = rng
        weights = PINK_TIMES ** (settings.pink_exponent - 1)
        self._sizes = np.concatenate((
            [settings.coloured],
            settings.pink * np.sqrt(weights / weights.sum())))
        self._keep = np.concatenate(([settings.correlation], np.exp(-1 / PINK_TIMES)))
        self._add = np.sqrt(1 - self._keep ** 2)
        self._white = settings.white
        self._states = rng.standard_normal((len(self._keep), drives))

    def samples(self, count: int) -> Array:
        """Return samples [N], (count, D)."""
        news = self._rng.standard_normal((count, len(self._keep) + 1, self._states.shape[1]))
        noise: Array = self._white * news[:, 0]
        for i, (keep, add, size) in enumerate(zip(self._keep, self._add, self._sizes,
                                                  strict=True)):
            states, _ = lfilter([add], [1.0, -keep], news[:, i + 1], axis=0,
                                zi=keep * self._states[None, i])
            noise += size * states
        return noise

    def autocovariance(self, lags: Array) -> Array:
        """Return the autocovariance of one effort's noise at whole lags [samples], (L,) [N^2]."""
        steps = np.abs(np.asarray(lags, dtype=float))
        slow: Array = (self._sizes ** 2) @ self._keep[:, None] ** steps
        return slow + self._white ** 2 * (steps == 0)
