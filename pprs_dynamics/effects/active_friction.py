"""Friction in the six drives: Eq. (1), (2), (15) and (16) of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.effects.effect import Effect
from pprs_dynamics.mechanism.robot import Array
from pprs_dynamics.mechanism.state import MechanismState

Six = tuple[float, float, float, float, float, float]


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
    viscous: Six
    coulomb: Six

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^m, (N, 6) [N]."""
        c, mu = np.asarray(self.viscous), np.asarray(self.coulomb)
        q_dot, sgn = state.velocity, state.direction
        Q_m: Array = c * q_dot + mu * state.guide_load * sgn                   # Eq. (15), (16)
        return Q_m
