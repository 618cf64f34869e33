# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction that follows a measured temperature: F_T (T - T_0) sgn(q_dot) + c_T w q_dot.

w = T_d (1 - exp(-(T - T_0) / T_d)) is T - T_0 near the reference, and saturates as oils thin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import (
    DriveEffect,
    DriveRange,
    DriveSamples,
    other_exponent,
)
from pprs_dynamics.physics.effects.effect import Parameter

TEMPERATURE = 'temperature'
# Lubricants lose a factor e of their viscosity in 15 to 40 K: what is tried of it.
THINNING = (15.0, 30.0)
# References that are tried, in ranges of temperature from the middle.
REFERENCES = (-2.0, -0.5, 0.0, 0.5, 2.0)


class FrictionTemperature(DriveEffect):
    """Dry and viscous friction that change with the temperature of the drive.

    Without a measured temperature it is not there: the model's friction is that at the reference.

    Equation
    --------
    F_T (T - T_0) sgn(q_dot) + c_T T_d (1 - exp(-(T - T_0) / T_d)) q_dot, T the measured
    temperature of the drive

    Symptom
    -------
    The step at each reversal, or the slope over velocity, shrinks or grows with the
    temperature of the drive, up and down. Friction_drift follows the clock, or the work of the
    drive itself.

    Causes
    ------
    Oil and grease thin as they warm: viscous friction falls to a half in 15 to 30 K. Seals and
    preload change the dry part, either way.

    Confirmation
    ------------
    Warm the drive by work, let it cool, and run the same slow and fast strokes on the way:
    friction must follow the temperature, not with the time of the day.

    References
    ----------
    Bittencourt and Gunnarsson, Static friction in a robot joint: modeling and identification
    of load and temperature effects, ASME J. Dynamic Systems, Measurement, and Control 134,
    2012.
    """

    name = 'friction_temperature'
    is_friction = True
    unphysical_below: ClassVar[Mapping[str, float]] = {}  # warmer oil makes it negative
    linear = (Parameter('coulomb', 'F_T', 'N/K', 'dry friction per kelvin', -1e6, 1e6, 0.0,
                        scale=0.02),
              Parameter('viscous', 'c_T', 'N s/m/K', 'viscous friction per kelvin, at '
                        'the reference', -1e6, 1e6, 0.0, scale=0.2))
    shape = (Parameter('reference', 'T_0', 'degC', 'temperature at which friction is the '
                       "model's", -1e4, 1e4, scale=10.0),
             Parameter('thinning', 'T_d', 'K', 'difference of temperature in which oil loses a '
                       'factor e of its viscosity', 5.0, 1e4, 25.0, scale=10.0))
    variants = (('coulomb',), ('viscous',), ('coulomb', 'viscous'))

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return ((T - T_0) sgn q_dot, w q_dot); nothing where T was not measured."""
        warmer = warmer_than(drive, shape['reference'])
        thinned = -shape['thinning'] * np.expm1(-warmer / shape['thinning'])
        return (warmer * drive.direction, thinned * drive.velocity)

    @classmethod
    def deviations(cls, drive: DriveSamples, **shape: float) -> tuple[tuple[Array, ...], ...]:
        """Return a quadratic term of dry friction, and another exponent of the speed."""
        dry, viscous = cls.columns(drive, **shape)
        bend = warmer_than(drive, shape['reference']) / (2 * THINNING[-1])
        return ((bend * dry, np.zeros_like(dry)),
                (np.zeros_like(dry), other_exponent(drive.velocity, viscous)))

    @classmethod
    def may_show(cls, covered: DriveRange) -> bool:
        """Return whether a temperature was measured and changed."""
        return middle_temperature(covered)[1] > 0

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[dict[str, float]]:
        """Return references within the temperatures and beyond."""
        middle, span = middle_temperature(covered)
        references = {middle + share * span: None for share in REFERENCES}
        return [{'reference': reference, 'thinning': thinning}
                for reference in references for thinning in THINNING]


def warmer_than(drive: DriveSamples, reference: float) -> Array:
    """Return T - T_0 [K], (N,), 0 where T was not measured."""
    temperature = drive.channels.get(TEMPERATURE)
    if temperature is None:
        return np.zeros_like(drive.velocity)
    return np.where(np.isfinite(temperature), temperature - reference, 0.0)


def middle_temperature(covered: DriveRange) -> tuple[float, float]:
    """Return the middle of the temperatures that were measured [degC], and their range [K]."""
    lowest, highest = covered.channels.get(TEMPERATURE, (0.0, 0.0))
    return (lowest + highest) / 2, highest - lowest
