# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How the force of a single axis changes with its numbers."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.inference.regression.arm_sensitivities import ArmSensitivities


class AxisSensitivities(ArmSensitivities):
    """Columns of a single axis: no bodies but one, no passive joints, and a zero anywhere.

    Parameters
    ----------
    model : AxisModel
    given : ForceModel
    """

    def _at(self, model: Any, state: Any) -> Any:
        return model.mechanism(state)

    def of_homing(self, state: Any, reference: Any) -> None:
        """Return nothing: no force depends on where an axis is."""
