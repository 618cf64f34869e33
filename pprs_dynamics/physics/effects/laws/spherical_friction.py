# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in the spherical joints A_i beyond the model's, alike in all three chains."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.added_joint_friction import (
    AddedJointFriction,
    friction_parameters,
)
from pprs_dynamics.physics.effects.effect import Card
from pprs_dynamics.physics.effects.laws.passive_friction import Resistances, spherical_speed
from pprs_dynamics.physics.three_pprs.state import MechanismState


class SphericalFriction(AddedJointFriction):
    """Viscous and dry friction in the spherical joints A_i."""

    name: ClassVar[str] = 'spherical_friction'
    linear = friction_parameters('s')
    card = Card(
        'moment (c_s+ |s| + M_s+) against the motion in A_i, s = omega_n,i',
        'errors that turn over where the platform turns back against a rod, not where a drive '
        'reverses, on all six drives at once; still there when the platform turns with its '
        'middle at rest',
        'dry, dirty or preloaded ball joints under the platform, stiff boots',
        'uncouple a rod from the platform and turn its ball by hand; grease the joint and '
        'repeat',
        'Itul, Pisla, 2007, Eq. (9) and (12)')

    @classmethod
    def speed(cls, state: MechanismState) -> Array:
        """Return the angular speed in the joints [rad/s], (N, 3)."""
        return spherical_speed(state)

    @classmethod
    def resistances(cls, k: Array) -> Resistances:
        """Return `k` in the spherical joints."""
        return Resistances(np.zeros_like(k), k)
