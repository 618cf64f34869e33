# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How the force of a single axis changes with its numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.sensitivities import (
    NUMBERS,
    OF_DRIVES,
    RELATIVE_STEP,
    Number,
    Sensitivities,
    reversal_columns,
)
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.model.axis_model import AxisForces, AxisModel, AxisMotion
from pprs_dynamics.physics.model.model_file import build_model


class AxisSensitivities(Sensitivities):
    """Columns of a single axis.

    Parameters
    ----------
    model : AxisModel
    """

    model: AxisModel

    def columns(self, forces: AxisForces) -> dict[str, Array]:
        """Return columns of numbers and of widths of turning over, (K, N, 1) each."""
        state = forces.mechanism
        numbers = np.zeros((len(self.numbers), *state.velocity.shape))
        for row, number in enumerate(self.numbers):
            numbers[row] = self.sensed(self._of_number(number, state), state)
        dry = sum((effect.dry(state.guide_load) for effect in self.model.effects
                   if isinstance(effect, AxisFriction)), np.zeros_like(state.guide_load))
        width = np.asarray(self.model.reversal.velocity)
        widths = np.stack([self.sensed(column, state) for column in reversal_columns(
            dry, state.velocity, state.direction, width)])
        return {NUMBERS: numbers, OF_DRIVES: widths}

    def _of_number(self, number: Number, motion: AxisMotion) -> Array:
        """Return the change per standard deviation of a number, (N, 1) [N]."""
        now = self.model.values[number.key]
        moved = build_model({**self.model.values, number.key: now + RELATIVE_STEP * number.value})
        assert isinstance(moved, AxisModel)
        change = self._own_force(moved, motion) - self._own_force(self.model, motion)
        scaled: Array = change * number.deviation / (RELATIVE_STEP * abs(number.value))
        return scaled

    @staticmethod
    def _own_force(model: AxisModel, motion: AxisMotion) -> Array:
        """Return the force without added effects, whose memories the chunk has advanced."""
        own = tuple(e for e in model.effects if isinstance(e, (AxisFriction, AxisOffset)))
        return replace(model, effects=own).drive_forces(motion).total
