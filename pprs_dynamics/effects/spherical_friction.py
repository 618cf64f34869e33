# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Friction in the spherical joints A_i beyond the model's, alike in all three chains.

References
----------
T. Itul, D. Pisla, 2007, Eq. (9) and (12): how it comes to the drives.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.effects.effect import Card, Parameter
from pprs_dynamics.effects.passive_friction import (
    Resistances,
    resistance,
    resistance_forces,
    spherical_speed,
)
from pprs_dynamics.effects.structure_effect import PassiveJointEffect
from pprs_dynamics.mechanism.state import MechanismState


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
