# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The friction and the constant efforts that a model file states for its drives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.mechanism.state import MechanismState


class DriveFriction(Effect):
    """Friction of the drives: F_v q_dot + (F_c + mu N) sgn(q_dot), N the load of the guide.

    Parameters
    ----------
    viscous : float or (D,) array
        F_v, of all drives or of each [N s/m, N m s/rad].
    coulomb : float or (D,) array
        F_c [N, N m].
    coefficient : float or (D,) array
        mu [1], times the guide load of the frictionless model.
    """

    name = 'active_friction'

    def __init__(self, viscous: ArrayLike, coulomb: ArrayLike, coefficient: ArrayLike = 0.0,
                 ) -> None:
        self.viscous, self.coulomb, self.coefficient = np.array(
            np.broadcast_arrays(viscous, coulomb, coefficient), dtype=float)

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the drives' forces, (N, D) [N, N m]."""
        dry = self.dry(state.friction_load) if self.coefficient.any() else self.coulomb
        force: Array = self.viscous * state.velocity + dry * state.direction
        return force

    def dry(self, friction_load: Array) -> Array:
        """Return the dry friction in full motion [N, N m], for loads of the guides."""
        dry: Array = self.coulomb + self.coefficient * friction_load
        return dry


class DriveOffset(Effect):
    """A constant force: preload, cable chain, or what the amplifier adds.

    Parameters
    ----------
    value : float or (D,) array
        [N, N m]
    """

    name = 'offset'

    def __init__(self, value: ArrayLike) -> None:
        self.value: Array = np.array(value, dtype=float)

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the drives' forces, (N, D) [N, N m]."""
        force: Array = 0.0 * state.velocity + self.value
        return force
