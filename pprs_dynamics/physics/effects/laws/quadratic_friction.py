# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction that grows with the square of velocity: c q_dot |q_dot|."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.effect import Card, Parameter


class QuadraticFriction(DriveEffect):
    """Force in proportion to velocity squared: churning lubricant, air in a closed housing."""

    name = 'quadratic_friction'
    is_friction = True
    linear = (Parameter('coefficient', 'c', 'N s^2/m^2', 'force per squared velocity', -1e6, 1e6,
                        scale=20.0),)
    card = Card(
        'c q_dot |q_dot|',
        'over velocity, a parabola that bends away from the line of viscous friction, turned '
        'over for the other direction; shows at the top speeds only',
        'air or oil pressed through narrow gaps: a bellows or closed housing with a small vent, '
        'recirculating balls churning in oil, a fan wheel',
        'run the drive at constant speeds up to its top speed: doubling the speed must make the '
        'extra force four times as large; open the housing or vent and repeat',
        'White, Fluid Mechanics, McGraw-Hill, on drag and orifices at high Reynolds numbers')

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q_dot |q_dot|,)."""
        return (drive.velocity * np.abs(drive.velocity),)
