# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction that grows with the square of velocity: c q_dot |q_dot|."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter


class QuadraticFriction(DriveEffect):
    """Force in proportion to velocity squared: churning lubricant, air in a closed housing.

    Equation
    --------
    c q_dot |q_dot|

    Symptom
    -------
    Over velocity, a parabola that curves away from the line of viscous friction, turned over
    for the other direction. Shows at the top speeds only.

    Causes
    ------
    Air or oil pressed through narrow gaps: a bellows or closed housing with a small vent,
    recirculating balls churning in oil, a fan wheel.

    Confirmation
    ------------
    Run the drive at constant speeds up to its top speed: doubling the speed must make the
    extra force four times as large. Open the housing or vent and repeat.

    References
    ----------
    White, Fluid Mechanics, McGraw-Hill, on drag and orifices at high Reynolds numbers.
    """

    name = 'quadratic_friction'
    is_friction = True
    linear = (Parameter('coefficient', 'c', 'N s^2/m^2', 'force per squared velocity', -1e6, 1e6,
                        scale=20.0),)

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q_dot |q_dot|,)."""
        return (drive.velocity * np.abs(drive.velocity),)
