# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Temperatures of simulated drives, and what their thermometers say of them.

Drives are warmed by the work that friction does and cool towards a hall that is aired now and then.
Thermal masses are those of a small test bench: what takes a real drive an hour takes a minute.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array

HALL = (18.0, 30.0)  # [degC]
WAVE, PERIOD = (5.0, 10.0), (20.0, 45.0)  # of the hall [K, s]
RISE, COOLING = (10.0, 30.0), (6.0, 20.0)  # by steady work at the usual speed [K], and back [s]
REFERENCE = (20.0, 45.0)  # at which numbers of a model were measured [degC]
STEP, RATE = 0.1, 10.0  # of a thermometer [K, Hz]
VOGEL_B, VOGEL_C = 900.0, 95.0  # of mineral oils [K]
LAG = 0.2  # by which it is late [s]


@dataclass(frozen=True)
class Climate:
    """Hall and drives.

    Parameters
    ----------
    hall, wave, period, phase : float
        Mean temperature of the hall [degC], and how it changes [K, s, rad].
    rise, cooling : (D,) arrays
        Of each drive [K, s].
    """

    hall: float
    wave: float
    period: float
    phase: float
    rise: Array
    cooling: Array

    @classmethod
    def draw(cls, rng: np.random.Generator, drives: int) -> Climate:
        """Return a hall and so many drives."""
        hall, wave, period, phase = (float(rng.uniform(*one)) for one in (
            HALL, WAVE, PERIOD, (0, 2 * np.pi)))
        return cls(hall, wave, period, phase, rng.uniform(*RISE, drives),
                   rng.uniform(*COOLING, drives))

    def along(self, time: Array, velocity: Array) -> Array:
        """Return the temperatures of drives along a motion, (N, D) [degC].

        They begin at the temperature of the hall, and rise by `rise` at their mean speed.

        Parameters
        ----------
        time : (N,) array
            [s]
        velocity : (N, D) array
        """
        speed = np.abs(velocity)
        work = speed / np.maximum(speed.mean(axis=0), 1e-12)
        hall = self.hall + self.wave * np.sin(2 * np.pi * time / self.period + self.phase)
        start = self.hall + self.wave * np.sin(self.phase)
        found = np.full_like(velocity, start)
        for k, step in enumerate(np.diff(time)):
            found[k + 1] = found[k] + step * (
                hall[k] + self.rise * work[k] - found[k]) / self.cooling
        return found


def thinner(temperature: Array, reference: Array | float) -> Array:
    """Return by which share oil is more viscous than at a reference, by Vogel's law [degC]."""
    exponent = VOGEL_B / (temperature + VOGEL_C) - VOGEL_B / (np.asarray(reference) + VOGEL_C)
    found: Array = np.expm1(exponent)
    return found


def read_thermometers(time: Array, temperature: Array) -> Array:
    """Return what thermometers of drives say, (N, D) [degC]; NaN between their readings."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    late, read = np.empty_like(temperature), np.full(temperature.shape, np.nan)
    late[0] = temperature[0]
    for k in range(1, len(late)):
        late[k] = late[k - 1] + min(step / LAG, 1.0) * (temperature[k] - late[k - 1])
    every = max(1, round(1 / (RATE * step)))
    read[::every] = STEP * np.round(late[::every] / STEP)
    return read
