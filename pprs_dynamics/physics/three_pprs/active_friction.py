# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in the six drives: Eq. (1), (2), (15) and (16) of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.mechanism.state import MechanismState

SixFloats = tuple[float, float, float, float, float, float]


def drive_friction(c: Any, mu: Any, q_dot: Any, load: Any, sgn: Any) -> Any:
    """Return the friction of drives [N]: viscous, and dry in proportion to the guide's load."""
    return c * q_dot + mu * load * sgn                                         # Eq. (15), (16)


@dataclass(frozen=True)
class ActiveFriction(Effect):
    """Viscous and load-dependent Coulomb friction of the prismatic drives.

    Parameters
    ----------
    viscous : 6 floats
        c_i [N s/m].
    coulomb : 6 floats
        mu [1], times the guide load of the frictionless model.
    """

    name: ClassVar[str] = 'active_friction'
    viscous: SixFloats
    coulomb: SixFloats

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^m, (N, 6) [N]."""
        Q_m: Array = drive_friction(np.asarray(self.viscous), np.asarray(self.coulomb),
                                    state.velocity, state.friction_load, state.direction)
        return Q_m

    def dry(self, friction_load: Array) -> Array:
        """Return the dry friction in full motion [N], for loads of the guides (N, 6) [N]."""
        return np.asarray(self.coulomb) * friction_load
