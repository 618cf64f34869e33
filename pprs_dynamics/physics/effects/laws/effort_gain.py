# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A measured effort that is scaled: (1 + g) F."""

from __future__ import annotations

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveSamples, MeasurementEffect
from pprs_dynamics.physics.effects.effect import Parameter


class EffortGain(MeasurementEffect):
    """A drive constant (force per current) that is not what the amplifier thinks.

    Equation
    --------
    measured effort = (1 + g) F

    Symptom
    -------
    An error that looks like the effort itself: the same share of weight, inertia and friction
    alike.

    Causes
    ------
    A force constant from a data sheet, a weakened magnet, the pitch or efficiency of a screw
    entered wrongly.

    Confirmation
    ------------
    Hang a known mass on the drive, or load it against a load cell, and compare.

    References
    ----------
    Gautier and Briot, Global identification of joint drive gains and dynamic parameters of
    robots, 2014.
    """

    name = 'effort_gain'
    idealised = False
    nonlinear = True
    # Makers state torque constants within some 10 %, as a limit. A factor of more than 1.5 is
    # another unit or motor, which belongs into the model.
    linear = (Parameter('gain', 'g', '1', 'relative error of the measured effort', -1 / 3, 0.5,
                        scale=0.05, expected=(0.04, 0.04)),)

    @classmethod
    def sense(cls, effort: Array, drive: DriveSamples, **parameters: float) -> Array:
        """Return (1 + g) F."""
        return (1 + parameters['gain']) * effort
