# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Temperatures of simulated drives, and what their thermometers say of them.

Drives are warmed by the work that friction does and cool towards a hall that is aired now and then.
Thermal masses are those of a small test bench: what takes a real drive an hour takes a minute.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array

HALL = (18.0, 30.0)  # [degC]
WAVE, PERIOD = (5.0, 10.0), (20.0, 45.0)  # of the hall [K, s]
RISE, COOLING = (10.0, 30.0), (6.0, 20.0)  # by steady work at the usual speed [K], and back [s]
REFERENCE = (20.0, 45.0)  # at which numbers of a model were measured [degC]
STEP, RATE = 0.1, 10.0  # of a thermometer [K, Hz]
VOGEL_B, VOGEL_C = 900.0, 95.0  # of mineral oils [K]
LAG = 0.2  # by which it is late [s]


def draw_temperatures(rng: np.random.Generator, time: Array, velocity: Array) -> Array:
    """Return random temperatures of drives along a motion, (N, D) [degC].

    They begin at the temperature of the hall, and rise by a `RISE` at their mean speed.

    Parameters
    ----------
    rng : numpy.random.Generator
    time : (N,) array
        [s]
    velocity : (N, D) array
    """
    mean, wave, period, phase = (float(rng.uniform(*one)) for one in (
        HALL, WAVE, PERIOD, (0, 2 * np.pi)))
    rise, cooling = (rng.uniform(*each, velocity.shape[1]) for each in (RISE, COOLING))
    speed = np.abs(velocity)
    work = speed / np.maximum(speed.mean(axis=0), 1e-12)
    hall = mean + wave * np.sin(2 * np.pi * time / period + phase)
    found = np.full_like(velocity, mean + wave * np.sin(phase))
    for k, step in enumerate(np.diff(time)):
        found[k + 1] = found[k] + step * (hall[k] + rise * work[k] - found[k]) / cooling
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
