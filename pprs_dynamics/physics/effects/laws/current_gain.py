# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A torque constant that goes with temperature or position: (1 + kappa (T - T_0) + ...) F."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveRange, DriveSamples, MeasurementEffect
from pprs_dynamics.physics.effects.effect import Parameter, Wave
from pprs_dynamics.physics.effects.laws.friction_temperature import middle_temperature, warmer_than

# Waves of the constant in a turn of the motor: excentric, of two phases against each other, of
# pole pairs.
WAVES = (1, 2, 3, 4, 5, 6)


class CurrentGain(MeasurementEffect):
    """Torque per current that falls as magnets warm, or ripples as the motor turns.

    Efforts are currents times one constant; what the motor gives per current is another one.

    Equation
    --------
    measured effort = (1 + kappa (T - T_0) + a sin(2 pi q / p + phi)) F

    Symptom
    -------
    An error in proportion to the effort itself, weight, inertia and friction alike, that grows
    with the temperature of the drive. Or a wave over its position that is higher the larger
    the effort is, and is gone where the effort is 0 (that of force_ripple stays).

    Causes
    ------
    Magnets lose 0.1 to 0.2 % of their flux per kelvin. Windings and poles that differ, offsets
    and gains of current sensors that differ by phase make torque ripple with the current.

    Confirmation
    ------------
    Hold a known load, cold and warm, and read the current. Creep to and fro with and without
    the load: the wave must grow with it (if it does not: force_ripple).

    References
    ----------
    Gautier and Briot, Global identification of joint drive gains and dynamic parameters of
    robots, 2014.
    """

    name = 'current_gain'
    idealised = False
    nonlinear = True
    linear = (Parameter('temperature', 'kappa', '1/K', 'relative error of the measured effort per '
                        'kelvin', -0.1, 0.1, 0.0, scale=0.001, expected=(0.002, 0.002)),
              Parameter('ripple', 'a', '1', 'height of the wave over the effort', 0.0, 0.9, 0.0,
                        scale=0.02, expected=(0.03, 0.03)),
              Parameter('phase', 'phi', 'rad', 'phase of the wave at position 0', -2 * math.pi,
                        2 * math.pi, 0.0, scale=0.5))
    shape = (Parameter('reference', 'T_0', 'degC', 'temperature at which the constant is the '
                       "model's", -1e4, 1e4, 25.0, scale=10.0),
             Parameter('pitch', 'p', 'm', 'distance between two waves', 1e-6, 10.0,
                       scale=0.005, turning=(1e-6, 100.0), default=1.0))
    variants = (('temperature',), ('sine', 'cosine'))
    waves = (Wave('ripple', 'phase'),)

    @classmethod
    def sense(cls, effort: Array, drive: DriveSamples, **parameters: float) -> Array:
        """Return (1 + kappa (T - T_0) + a sin(2 pi q / p + phi)) F."""
        turn = 2 * math.pi * drive.position / parameters['pitch']
        by_temperature = parameters['temperature'] * warmer_than(drive, parameters['reference'])
        ripple = parameters['ripple'] * np.sin(turn + parameters['phase'])
        return effort * (1 + by_temperature + ripple)

    @classmethod
    def may_show(cls, covered: DriveRange) -> bool:
        """Return whether a temperature changed, or waves of a motor are known to pass."""
        return bool(middle_temperature(covered)[1]) or covered.gear_ratio > 1

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return temperatures about those measured, and waves of the motor."""
        middle, span = middle_temperature(covered)
        turn = 2 * math.pi / covered.gear_ratio
        pitches = ([turn / waves for waves in WAVES] if covered.gear_ratio > 1 else [1.0])
        return [*({'reference': middle + share * span, 'pitch': pitches[0]}
                  for share in ((-1.0, 0.0, 1.0) if span else (0.0,))),
                *({'reference': middle, 'pitch': pitch} for pitch in pitches[1:])]
