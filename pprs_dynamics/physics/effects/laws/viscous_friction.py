# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Viscous friction of a drive beyond the model's: c q_dot."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples, other_exponent
from pprs_dynamics.physics.effects.effect import Parameter

DIRECTIONS = 0.1  # share by which real viscous friction differs by direction


class ViscousFriction(DriveEffect):
    """Force in proportion to velocity: lubricant, motor damping, a current loop's back-EMF.

    Equation
    --------
    c q_dot

    Symptom
    -------
    A straight line through zero over velocity, the same forwards and backwards. Nothing at low
    speed.

    Causes
    ------
    Stiff or cold grease, too much grease, seals, eddy currents and back-EMF of the motor, a
    damper or cable chain that drags.

    Confirmation
    ------------
    Run the drive at several constant speeds, both ways: the force must rise in proportion.
    Repeat warm, or with other grease: the slope must change.

    References
    ----------
    Armstrong-Helouvry, Dupont, Canudas de Wit, A survey of models, analysis tools and
    compensation methods for the control of machines with friction, Automatica 30, 1994.
    """

    name = 'viscous_friction'
    is_friction = True
    linear = (Parameter('coefficient', 'c', 'N s/m', 'force per velocity', -1e6, 1e6, scale=5.0),)

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q_dot,)."""
        return (drive.velocity,)

    @classmethod
    def deviations(cls, drive: DriveSamples, **shape: float) -> tuple[tuple[Array, ...], ...]:
        """Return the changes by a difference in direction, and by thinning with speed."""
        return ((DIRECTIONS * np.abs(drive.velocity),),
                (other_exponent(drive.velocity, drive.velocity),))
