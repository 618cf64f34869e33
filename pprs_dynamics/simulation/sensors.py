# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Sensors of the simulated robot: quantised positions, differentiated velocities, noisy efforts.

All randomness comes from one generator, so that a seed repeats a recording bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array

CORRELATED, CORRELATION = 0.36, 0.9  # share of the noise's variance, and from sample to sample


@dataclass(frozen=True)
class SensorSettings:
    """Quality of the sensors.

    Parameters
    ----------
    quantisation : float
        Of the encoders [m]; 0 for none.
    effort_noise : float
        Standard deviation of the noise of the efforts [N], a part of it correlated.
    velocity_bandwidth : float
        Of the first-order low-pass behind the differentiated positions [Hz].
    """

    quantisation: float = 1e-6
    effort_noise: float = 0.08
    velocity_bandwidth: float = 80.0

    def quantised(self, position: Array) -> Array:
        """Return positions [m] as the encoders count them."""
        grain = self.quantisation
        return np.round(position / grain) * grain if grain > 0 else position


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
        Share of a change that `velocity` shows after one reading.
    """

    def __init__(self, settings: SensorSettings, step: float, rng: np.random.Generator,
                 scale: Array) -> None:
        self.settings, self._step, self._rng = settings, step, rng
        self._noise = settings.effort_noise * scale
        self._correlated = rng.standard_normal(len(scale))
        self.position, self.velocity = np.zeros((2, len(scale)))
        self.smoothing = 1 - float(np.exp(-2 * np.pi * settings.velocity_bandwidth * step))

    def start(self, position: Array, velocity: Array) -> None:
        """Forget the past: the robot is at (D,) [m] and moves with (D,) [m/s]."""
        self.position, self.velocity = self.settings.quantised(position), np.array(velocity)

    def read_encoders(self, position: Array) -> None:
        """Take the true positions, (D,)."""
        measured = self.settings.quantised(position)
        change = (measured - self.position) / self._step
        self.velocity = self.velocity + self.smoothing * (change - self.velocity)
        self.position = measured

    def measure(self, time: float, effort: Array) -> Measurement:
        """Return the readings to publish now, of efforts (D,) with noise."""
        white, new = self._rng.standard_normal((2, len(effort)))
        self._correlated = (CORRELATION * self._correlated
                            + np.sqrt(1 - CORRELATION ** 2) * new)
        noise = np.sqrt(1 - CORRELATED) * white + np.sqrt(CORRELATED) * self._correlated
        return Measurement(time, self.position.copy(), self.velocity.copy(),
                           effort + self._noise * noise)
