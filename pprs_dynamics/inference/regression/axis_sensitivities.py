# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How the force of a single axis changes with its numbers."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.arm_sensitivities import ArmSensitivities
from pprs_dynamics.inference.regression.sensitivities import following


class AxisSensitivities(ArmSensitivities):
    """Columns of a single axis: no bodies but one, no passive joints, and a zero anywhere.

    Parameters
    ----------
    model : AxisModel
    given : ForceModel
    """

    def _efforts(self, model: Any, state: Any) -> Array:
        total: Array = model.mass * (state.acceleration - model.gravity) + sum(
            effect.force(state) for effect in following(model))
        return total

    def _at(self, model: Any, state: Any) -> Any:
        return state

    def of_homing(self, state: Any, reference: Array) -> None:
        """Return nothing: no force depends on where an axis is."""
