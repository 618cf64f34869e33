# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in passive joints beyond the model's: viscous, and dry friction that no load changes.

References
----------
T. Itul, D. Pisla, 2007, Eq. (9) and (12): how it comes to the drives.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.laws.passive_friction import (
    Resistances,
    resistance,
    resistance_forces,
)
from pprs_dynamics.physics.effects.structure_effect import PassiveJointEffect
from pprs_dynamics.physics.three_pprs.state import MechanismState


def friction_parameters(index: str) -> tuple[Parameter, ...]:
    """Return the parameters; their symbols have the index."""
    return (
        Parameter('viscous', f'c_{index}+', 'N m s/rad', 'moment per angular velocity of the joint',
                  -1e4, 1e4, scale=0.01),
        Parameter('torque', f'M_{index}+', 'N m', 'dry friction moment, whatever the load',
                  -1e4, 1e4, 0.0, scale=0.01))


class AddedJointFriction(PassiveJointEffect):
    """Friction of one kind of joint, alike in all three chains: seals, preloaded bearings.

    It goes to the drives by virtual power of the whole mechanism, whatever friction.approach is.
    """

    is_friction: ClassVar[bool] = True
    variants = (('viscous',), ('torque',), ('viscous', 'torque'))
    unphysical_below: ClassVar[dict[str, float]] = {'viscous': 0.0, 'torque': 0.0}

    @classmethod
    @abstractmethod
    def speed(cls, state: MechanismState) -> Array:
        """Return the angular speed in the joints [rad/s], (N, 3)."""

    @classmethod
    @abstractmethod
    def resistances(cls, k: Array) -> Resistances:
        """Return the joints' moment per angular speed [N m s/rad], `k` in those with the effect."""

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the effect's drive forces [N], (N, 6)."""
        k = resistance(self.values['viscous'], self.values['torque'], self.speed(state),
                       state.reversal.rate)
        return resistance_forces(state, self.resistances(k))
