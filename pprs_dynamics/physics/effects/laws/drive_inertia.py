# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Mass that only the drive feels: m q_ddot, with the rotation of its motor and screw."""

from __future__ import annotations

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter


class DriveInertia(DriveEffect):
    """Force in proportion to acceleration: rotor, coupling and screw, reflected to the slide.

    Equation
    --------
    m q_ddot

    Symptom
    -------
    A straight line over the drive's own acceleration, and no part in its weight. It is largest
    where the drive turns back.

    Causes
    ------
    Inertia of rotor, coupling, pulley and screw that the mass of the slide does not contain: J
    (2 pi / lead)^2 for a screw. Of a joint the inertia of the rotor times the square of the
    gear ratio, often more than that of the links: robot.armature contains it.

    Confirmation
    ------------
    Add up the inertias from the data sheets. Move this drive alone, twice as fast: the force
    must grow fourfold. A payload would act on all drives and at rest, this does not.

    References
    ----------
    Khalil and Dombre, Modeling, Identification and Control of Robots, Hermes Penton, 2002, on
    the inertia of rotors.
    """

    name = 'drive_inertia'
    idealised = False
    linear = (Parameter('mass', 'm', 'kg', 'reflected inertia', -1e4, 1e4, scale=0.1),)
    is_positive = True

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q_ddot,)."""
        return (drive.acceleration,)
