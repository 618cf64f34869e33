# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction and constant force of drives that carry no load in guides: an axis, an arm's joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.mechanism.state import MechanismState


@dataclass(frozen=True)
class AxisFriction(Effect):
    """Viscous friction and dry friction that no load changes: F_v q_dot + F_c sgn(q_dot).

    Parameters
    ----------
    viscous : float or (D,) tuple
        F_v, of all drives or of each [N s/m, N m s/rad].
    coulomb : float or (D,) tuple
        F_c [N, N m].
    """

    name = 'active_friction'
    viscous: float | tuple[float, ...]
    coulomb: float | tuple[float, ...]

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the drives' forces, (N, D) [N, N m]."""
        viscous, coulomb = self._rows
        return viscous * state.velocity + coulomb * state.direction

    @cached_property
    def _rows(self) -> tuple[Array, Array]:
        return np.asarray(self.viscous), np.asarray(self.coulomb)

    def dry(self, friction_load: Array) -> Array:
        """Return the dry friction in full motion [N], in the shape of the guide's load."""
        return np.full_like(friction_load, np.asarray(self.coulomb))


@dataclass(frozen=True)
class AxisOffset(Effect):
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
        force: Array = 0.0 * state.velocity + self._row
        return force

    @cached_property
    def _row(self) -> Array:
        return np.asarray(self.value)
