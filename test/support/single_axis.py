# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A single axis of any numbers."""

from __future__ import annotations

from typing import Any

from pprs_dynamics import DriveModel

AXIS = 'axis'  # its drive


def axis_values(mass: float, viscous: float, coulomb: float, offset: float = 0.0,
                gravity: float = 0.0, width: float = 0.001) -> dict[str, Any]:
    """Return the values of a model file."""
    return {**DriveModel.load('config/single_axis.yaml').values,
            'links.mass': (mass,), 'friction.viscous': (viscous,), 'friction.coulomb': (coulomb,),
            'friction.offset': (offset,), 'robot.gravity': (0.0, 0.0, gravity),
            'friction.reversal_velocity': width}
