# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The friction and the constant efforts that a model file states for its drives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.mechanism.state import MechanismState


@dataclass(frozen=True)
class DriveFriction(Effect):
    """Friction of the drives: F_v q_dot + (F_c + mu N) sgn(q_dot), N the load of the guide.

    Parameters
    ----------
    viscous : float or (D,) tuple
        F_v, of all drives or of each [N s/m, N m s/rad].
    coulomb : float or (D,) tuple
        F_c [N, N m].
    coefficient : float or (D,) tuple
        mu [1], times the guide load of the frictionless model.
    """

    name = 'active_friction'
    viscous: float | tuple[float, ...]
    coulomb: float | tuple[float, ...]
    coefficient: float | tuple[float, ...] = 0.0

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the drives' forces, (N, D) [N, N m]."""
        viscous, coulomb, coefficient = self._rows
        dry = self.dry(state.friction_load) if coefficient.any() else coulomb
        return viscous * state.velocity + dry * state.direction

    @cached_property
    def _rows(self) -> tuple[Array, Array, Array]:
        return np.asarray(self.viscous), np.asarray(self.coulomb), np.asarray(self.coefficient)

    def dry(self, friction_load: Array) -> Array:
        """Return the dry friction in full motion [N, N m], for loads of the guides."""
        _, coulomb, coefficient = self._rows
        return coulomb + coefficient * friction_load


@dataclass(frozen=True)
class DriveOffset(Effect):
    """A constant force: preload, cable chain, or what the amplifier adds.

    Parameters
    ----------
    value : float or (D,) tuple
        [N, N m]
    """

    name = 'offset'
    value: float | tuple[float, ...]

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the drives' forces, (N, D) [N, N m]."""
        return 0.0 * state.velocity + self._row

    @cached_property
    def _row(self) -> Array:
        return np.asarray(self.value)
