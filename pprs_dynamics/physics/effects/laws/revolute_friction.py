# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in the revolute joints C_i beyond the model's, alike in all three chains.

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
)
from pprs_dynamics.physics.effects.structure_effect import PassiveJointEffect
from pprs_dynamics.physics.three_pprs.state import MechanismState


class RevoluteFriction(PassiveJointEffect):
    """Viscous friction, and dry friction that no load changes: seals, preloaded bearings.

    It goes to the drives by virtual power of the whole mechanism, whatever friction.approach is.
    """

    name: ClassVar[str] = 'revolute_friction'
    is_friction: ClassVar[bool] = True
    linear = (
        Parameter('viscous', 'c_r+', 'N m s/rad', 'moment per angular velocity of the joint',
                  -1e4, 1e4, scale=0.01),
        Parameter('torque', 'M_r+', 'N m', 'dry friction moment, whatever the load', -1e4, 1e4,
                  0.0, scale=0.01))
    variants = (('viscous',), ('torque',), ('viscous', 'torque'))
    unphysical_below: ClassVar[dict[str, float]] = {'viscous': 0.0, 'torque': 0.0}
    card = Card(
        'moment (c_r+ |s| + M_r+) against the motion in C_i, s = u_dot_i',
        'errors that turn over where a rod reverses its swing, not where a drive reverses, on all '
        'six drives at once',
        'dry, dirty or overtightened bearings at the feet of the rods, stiff seals, cold grease',
        'uncouple a rod from the platform and swing it by hand; grease the joint and repeat; run '
        'the robot warm and compare',
        'Itul, Pisla, 2007, Eq. (9) and (12)')

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the effect's drive forces [N], (N, 6)."""
        speed = np.abs(state.chains.u_dot)
        k = resistance(self.values['viscous'], self.values['torque'], speed, state.reversal.rate)
        return resistance_forces(state, Resistances(k, np.zeros_like(k)))
