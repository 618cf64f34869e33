# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in the spherical joints A_i beyond the model's, alike in all three chains.

References
----------
T. Itul, D. Pisla, 2007, Eq. (9) and (12): how it comes to the drives.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import Card, Parameter
from pprs_dynamics.physics.effects.laws.passive_friction import (
    Resistances,
    resistance,
    resistance_forces,
    spherical_speed,
)
from pprs_dynamics.physics.effects.structure_effect import PassiveJointEffect
from pprs_dynamics.physics.three_pprs.state import MechanismState


class SphericalFriction(PassiveJointEffect):
    """Viscous friction, and dry friction that no load changes: seals, preloaded bearings.

    It goes to the drives by virtual power of the whole mechanism, whatever friction.approach is.
    """

    name: ClassVar[str] = 'spherical_friction'
    is_friction: ClassVar[bool] = True
    linear = (
        Parameter('viscous', 'c_s+', 'N m s/rad', 'moment per angular velocity of the joint',
                  -1e4, 1e4, scale=0.01),
        Parameter('torque', 'M_s+', 'N m', 'dry friction moment, whatever the load', -1e4, 1e4,
                  0.0, scale=0.01))
    variants = (('viscous',), ('torque',), ('viscous', 'torque'))
    unphysical_below: ClassVar[dict[str, float]] = {'viscous': 0.0, 'torque': 0.0}
    card = Card(
        'moment (c_s+ |s| + M_s+) against the motion in A_i, s = omega_n,i',
        'errors that turn over where the platform turns back against a rod, not where a drive '
        'reverses, on all six drives at once; still there when the platform turns with its '
        'middle at rest',
        'dry, dirty or preloaded ball joints under the platform, stiff boots',
        'uncouple a rod from the platform and turn its ball by hand; grease the joint and '
        'repeat',
        'Itul, Pisla, 2007, Eq. (9) and (12)')

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the effect's drive forces [N], (N, 6)."""
        speed = spherical_speed(state)
        k = resistance(self.values['viscous'], self.values['torque'], speed, state.reversal.rate)
        return resistance_forces(state, Resistances(np.zeros_like(k), k))
