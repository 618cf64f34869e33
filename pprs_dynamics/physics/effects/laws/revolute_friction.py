# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in the revolute joints C_i beyond the model's, alike in all three chains."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.added_joint_friction import (
    AddedJointFriction,
    friction_parameters,
)
from pprs_dynamics.physics.effects.effect import Card
from pprs_dynamics.physics.effects.laws.passive_friction import Resistances
from pprs_dynamics.physics.three_pprs.state import MechanismState


class RevoluteFriction(AddedJointFriction):
    """Viscous and dry friction in the revolute joints C_i."""

    name: ClassVar[str] = 'revolute_friction'
    linear = friction_parameters('r')
    card = Card(
        'moment (c_r+ |s| + M_r+) against the motion in C_i, s = u_dot_i',
        'errors that turn over where a rod reverses its swing, not where a drive reverses, on all '
        'six drives at once',
        'dry, dirty or overtightened bearings at the feet of the rods, stiff seals, cold grease',
        'uncouple a rod from the platform and swing it by hand; grease the joint and repeat; run '
        'the robot warm and compare',
        'Itul, Pisla, 2007, Eq. (9) and (12)')

    @classmethod
    def speed(cls, state: MechanismState) -> Array:
        """Return the angular speed in the joints [rad/s], (N, 3)."""
        return np.abs(state.chains.u_dot)

    @classmethod
    def resistances(cls, k: Array) -> Resistances:
        """Return `k` in the revolute joints."""
        return Resistances(k, np.zeros_like(k))
