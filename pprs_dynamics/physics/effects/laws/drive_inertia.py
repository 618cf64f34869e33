# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Mass that only the drive feels: m q_ddot, with the rotation of its motor and screw."""

from __future__ import annotations

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.effect import Card, Parameter


class DriveInertia(DriveEffect):
    """Force in proportion to acceleration: rotor, coupling and screw, reflected to the slide."""

    name = 'drive_inertia'
    idealised = False
    linear = (Parameter('mass', 'm', 'kg', 'reflected inertia', -1e4, 1e4, scale=0.1),)
    is_positive = True
    card = Card(
        'm q_ddot',
        "a straight line over the drive's own acceleration, and no part in its weight; largest "
        'where the drive turns back',
        'inertia of rotor, coupling, pulley and screw that the mass of the slide does not '
        'contain: J (2 pi / lead)^2 for a screw',
        'add up J (2 pi / lead)^2 from the data sheets; repeat the motion twice as fast: the '
        'force must grow fourfold; a payload would act on all drives and at rest, this does not',
        'Khalil and Dombre, Modeling, Identification and Control of Robots, Hermes Penton, 2002, '
        'on the inertia of rotors')
    mechanism_card = Card(
        'm q_ddot',
        'an error that follows the acceleration of this joint alone',
        'the rotor: its inertia times the square of the gear ratio acts at the joint, often more '
        'than that of the links; robot.armature holds it',
        'take it from the data sheet of the motor; move this joint alone, fast: the error must '
        'grow with the square of the frequency',
        'Khalil, Dombre, Modeling, Identification and Control of Robots, 2002')

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q_ddot,)."""
        return (drive.acceleration,)
