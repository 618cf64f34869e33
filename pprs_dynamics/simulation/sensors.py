# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Sensors of the simulated robot: quantised positions, differentiated velocities, noisy efforts.

All randomness comes from one generator, so that a seed repeats a recording bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import COUNT

# Correlation times of the slow processes that add up to 1/f noise [samples], a factor 4 apart:
# the sum follows 1/f within 10 % from 1/200 of the sampling rate down to 1/400 000 of it.
PINK_TIMES = 2.0 * 4.0 ** np.arange(9)


@dataclass(frozen=True)
class SensorSettings:
    """Quality of the sensors.

    Parameters
    ----------
    quantisation : float
        Of the encoders [m]; 0 for none.
    true_velocity : bool
        True: tachometers. False: differentiated positions, smoothed.
    velocity_bandwidth : float
        Of that smoothing, a first-order low-pass [Hz].
    white_noise, coloured_noise, pink_noise : float
        Standard deviations of the noise of the efforts [N].
    noise_correlation : float
        Of the coloured noise, from sample to sample; AR(1).
    pink_exponent : float
        a of the pink noise's spectrum 1/f^a, 0 < a < 2.
    """

    quantisation: float = 1e-6
    true_velocity: bool = False
    velocity_bandwidth: float = 80.0
    white_noise: float = 0.064
    coloured_noise: float = 0.048
    noise_correlation: float = 0.9
    pink_noise: float = 0.0
    pink_exponent: float = 1.0

    @classmethod
    def with_effort_noise(cls, noise: float, quantisation: float = 1e-6) -> SensorSettings:
        """Return settings whose efforts carry noise of a standard deviation [N].

        Of its variance 64 % is white and 36 % correlated, AR(1) with 0.9 from sample to sample.
        """
        return cls(quantisation, white_noise=0.8 * noise, coloured_noise=0.6 * noise)

    def quantised(self, position: Array) -> Array:
        """Return positions [m] as the encoders count them."""
        grain = self.quantisation
        return np.round(position / grain) * grain if grain > 0 else position


class ButterworthFilter:
    """Low-pass filters of second order, one for each of D signals.

    Parameters
    ----------
    time_constant : (D,) array
        Mean delay of each, sqrt(2) / (2 pi f_c) [s]; 0 for none.
    step : float
        Between samples [s].
    """

    def __init__(self, time_constant: Array, step: float) -> None:
        from scipy.signal import butter

        self._filters = {}
        for d in np.flatnonzero(time_constant > 0).tolist():
            highest = 0.9 / (2 * step)  # of what is faster no samples tell
            cutoff = min(np.sqrt(2) / (2 * np.pi * time_constant[d]), highest)
            self._filters[d] = butter(2, cutoff, fs=1 / step)

    def samples(self, values: Array) -> Array:
        """Return signals filtered from rest at their first values, (N, D)."""
        from scipy.signal import lfilter, lfilter_zi

        filtered = values.copy()
        for d, (b, a) in self._filters.items():
            filtered[:, d], _ = lfilter(b, a, values[:, d], zi=lfilter_zi(b, a) * values[0, d])
        return filtered


class EffortNoise:
    """White, AR(1) and 1/f noise of the drives' efforts, one sample at a time.

    Parameters
    ----------
    settings : SensorSettings
    rng : numpy.random.Generator
    drives : int

    Notes
    -----
    1/f^a noise is a sum of AR(1) processes whose correlation times lie evenly on a logarithmic
    scale and whose variances go with time^(a - 1).
    """

    def __init__(self, settings: SensorSettings, rng: np.random.Generator, drives: int = COUNT,
                 ) -> None:
        self._rng = rng
        weights = PINK_TIMES ** (settings.pink_exponent - 1)
        self._sizes = np.concatenate((
            [settings.coloured_noise],
            settings.pink_noise * np.sqrt(weights / weights.sum())))
        self._keep = np.concatenate(([settings.noise_correlation], np.exp(-1 / PINK_TIMES)))
        self._add = np.sqrt(1 - self._keep ** 2)
        self._white = settings.white_noise
        self._states = rng.standard_normal((len(self._keep), drives))

    def sample(self) -> Array:
        """Return the next sample [N], (D,)."""
        news = self._rng.standard_normal((len(self._keep) + 1, self._states.shape[1]))
        self._states = self._keep[:, None] * self._states + self._add[:, None] * news[1:]
        return self._white * news[0] + self._sizes @ self._states

    def samples(self, count: int) -> Array:
        """Return the next samples [N], (count, D): those that `sample` would give."""
        from scipy.signal import lfilter

        news = self._rng.standard_normal((count, len(self._keep) + 1, self._states.shape[1]))
        noise: Array = self._white * news[:, 0]
        for i, (keep, add, size) in enumerate(zip(self._keep, self._add, self._sizes,
                                                  strict=True)):
            states, last = lfilter([add], [1.0, -keep], news[:, i + 1], axis=0,
                                   zi=keep * self._states[None, i])
            self._states[i] = last[0] / keep if keep else states[-1]
            noise += size * states
        return noise

    def autocovariance(self, lags: Array) -> Array:
        """Return the autocovariance of one effort's noise at whole lags [samples], (L,) [N^2]."""
        steps = np.abs(np.asarray(lags, dtype=float))
        slow: Array = (self._sizes ** 2) @ self._keep[:, None] ** steps
        return slow + self._white ** 2 * (steps == 0)


@dataclass(frozen=True)
class Measurement:
    """Readings of the sensors at one moment: `time` [s] and (D,) arrays in drive order."""

    time: float
    position: Array
    velocity: Array
    effort: Array


class Sensors:
    """Encoders and effort sensors of the drives.

    Parameters
    ----------
    settings : SensorSettings
    step : float
        Time between readings of the encoders [s].
    rng : numpy.random.Generator
    scale : (D,) array
        Units in which the settings give the noise of the efforts.

    Attributes
    ----------
    position, velocity : (D,) arrays
        As measured.
    smoothing : float
        Share of a change that `velocity` shows after one reading; 1 with tachometers.
    """

    def __init__(self, settings: SensorSettings, step: float, rng: np.random.Generator,
                 scale: Array) -> None:
        self.settings, self._step, self._scale = settings, step, scale
        self._noise = EffortNoise(settings, rng, len(scale))
        self.position, self.velocity = np.zeros((2, len(scale)))
        self.smoothing = 1.0 if settings.true_velocity else 1 - float(
            np.exp(-2 * np.pi * settings.velocity_bandwidth * step))

    def start(self, position: Array, velocity: Array) -> None:
        """Forget the past: the robot is at (D,) [m] and moves with (D,) [m/s]."""
        self.position, self.velocity = self.settings.quantised(position), np.array(velocity)

    def read_encoders(self, position: Array, velocity: Array) -> None:
        """Take the true positions and velocities, (D,)."""
        measured = self.settings.quantised(position)
        if self.settings.true_velocity:
            self.velocity = np.array(velocity)
        else:
            change = (measured - self.position) / self._step
            self.velocity = self.velocity + self.smoothing * (change - self.velocity)
        self.position = measured

    def measure(self, time: float, effort: Array) -> Measurement:
        """Return the readings to publish now, of efforts (D,) with noise."""
        return Measurement(time, self.position.copy(), self.velocity.copy(),
                           effort + self._scale * self._noise.sample())
