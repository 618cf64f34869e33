# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction that differs by direction, in its dry or in its viscous part.

The force is p (F_f + c_f q_dot) + (1 - p) (-F_b + c_b q_dot), with p = (1 + sgn q_dot) / 2.
Positive forces and coefficients oppose the motion in their direction. Dry friction alone equals
coulomb_friction (F_f + F_b) / 2 plus effort_offset (F_f - F_b) / 2, which is also its force at
rest.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples, other_exponent
from pprs_dynamics.physics.effects.effect import Parameter

FORCES = ('force_forward', 'force_backward')
VISCOUS = ('viscous_forward', 'viscous_backward')


class AsymmetricFriction(DriveEffect):
    """Friction that differs by direction: wipers, worm and screw drives, check valves.

    Equation
    --------
    F_f + c_f q_dot while q_dot > 0; -F_b + c_b q_dot while q_dot < 0

    Symptom
    -------
    Over velocity, a branch that is higher or steeper on one side of zero than on the other.

    Causes
    ------
    A lip seal or wiper that digs in one way, a screw or belt lifting against a preload, a
    pneumatic counterbalance with a throttled port, a guide that tilts under the push.

    Confirmation
    ------------
    Run the drive at several constant speeds, both ways, and draw force over speed. The two
    branches must differ. A dry part alone is also a coulomb_friction and an effort_offset, so
    check for a constant force at rest (cable, counterbalance) first.

    References
    ----------
    Armstrong-Helouvry, Control of Machines with Friction, Kluwer, 1991.
    """

    name = 'asymmetric_friction'
    is_friction = True
    at_one_load = 'gear_efficiency'
    symmetric: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(FORCES, 'coulomb_friction'),
        **dict.fromkeys(VISCOUS, 'viscous_friction')}
    linear = (
        Parameter('force_forward', 'F_f', 'N', 'dry friction forwards', -1e6, 1e6, 0.0, 0.5),
        Parameter('force_backward', 'F_b', 'N', 'dry friction backwards', -1e6, 1e6, 0.0, 0.5),
        Parameter('viscous_forward', 'c_f', 'N s/m', 'viscous coefficient forwards', -1e6, 1e6,
                  0.0, 5.0),
        Parameter('viscous_backward', 'c_b', 'N s/m', 'viscous coefficient backwards', -1e6, 1e6,
                  0.0, 5.0))
    variants = (*((name,) for name in VISCOUS + FORCES), FORCES, VISCOUS, FORCES + VISCOUS)

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (p, p - 1, p q_dot, (1 - p) q_dot), with p = (1 + sgn q_dot) / 2."""
        forward = (1 + drive.direction) / 2
        backward = (1 - drive.direction) / 2
        return (forward, -backward, forward * drive.velocity, backward * drive.velocity)

    @classmethod
    def hypotheses(cls, names: tuple[str, ...]) -> frozenset[Hashable]:
        """Return the parts that are present: dry and viscous friction are two hypotheses."""
        parts = {'dry': FORCES, 'viscous': VISCOUS}
        return frozenset(part for part, those in parts.items() if set(names) & set(those))

    @classmethod
    def deviations(cls, drive: DriveSamples, **shape: float) -> tuple[tuple[Array, ...], ...]:
        """Return the change of viscous friction by thinning with speed."""
        none = np.zeros_like(drive.velocity)
        *_, forward, backward = cls.columns(drive)
        return ((none, none, other_exponent(drive.velocity, forward),
                 other_exponent(drive.velocity, backward)),)
