# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How the efforts of an arm's joints change with its numbers and with effects on its bodies."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.sensitivities import RELATIVE_STEP, Number, Sensitivities
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction
from pprs_dynamics.physics.mechanism.mechanism import LinkageState
from pprs_dynamics.physics.model.arm_model import ArmModel
from pprs_dynamics.physics.model.keys import is_gain
from pprs_dynamics.system.parallel import each

HOMING_STEP = 1e-4  # [rad, m]
PER_DRIVE = ('friction.viscous', 'friction.coulomb', 'friction.offset')


class ArmSensitivities(Sensitivities):
    """Columns of an arm.

    Parameters
    ----------
    model : ArmModel
    given : ForceModel
    """

    model: ArmModel
    each = staticmethod(each)

    def dry(self, state: Any) -> Array:
        """Return the size of the drives' dry friction in full motion, (N, D) [N, N m]."""
        return sum((effect.dry(state.guide_load) for effect in self.model.effects
                    if isinstance(effect, AxisFriction)), np.zeros_like(state.guide_load))

    def drives_of(self, number: Number) -> list[int] | None:
        """Return the drive that a number of its own friction, or its gain, acts on."""
        is_alone = number.key in PER_DRIVE or is_gain(number.key)
        return [number.element] if is_alone and number.element is not None else None

    def _change(self, number: Number, forces: Any, reference: Array) -> Array:
        if not is_gain(number.key):
            return super()._change(number, forces, reference)
        # The more torque an ampere gives, the fewer amperes the model's torque takes.
        given = np.asarray(self.given.values[number.key])
        change: Array = -forces.total * RELATIVE_STEP * given / self.model.gain
        return change

    def of_homing(self, state: LinkageState, reference: Array) -> Array | None:
        """Return the change per radian, or metre, that each joint is measured too far."""
        def column(k: int) -> Array:
            position = state.position.copy()
            position[:, k] -= HOMING_STEP
            moved = replace(state, position=position)
            return (self._efforts(self.model, moved) - reference) / HOMING_STEP

        return np.stack(self.each(column, range(len(self.model.drives))))
