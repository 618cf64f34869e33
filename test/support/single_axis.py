# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A single axis of any numbers, and its motions for tests: sums of sines."""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.arrays import Array

AXIS = 'axis'  # its drive
SINES = ((0.2, 0.1), (0.5, 0.05), (1.3, 0.01))  # [Hz, m]


def axis_motion(time: Array) -> JointMotion:
    """Return the sum of `SINES` with its rates."""
    w, size = np.array([(2 * np.pi * rate, size) for rate, size in SINES]).T
    phase = time[:, None] * w
    q, v, a = (np.sum(values, axis=1, keepdims=True) for values in (
        size * np.sin(phase), size * w * np.cos(phase), -size * w ** 2 * np.sin(phase)))
    return JointMotion(q, v, a, time)


def axis_values(mass: float, viscous: float, coulomb: float, offset: float = 0.0,
                gravity: float = 0.0, width: float = 0.001) -> dict[str, Any]:
    """Return the values of a model file."""
    return {**DriveModel.load('config/single_axis.yaml').values,
            'links.mass': (mass,), 'friction.viscous': (viscous,), 'friction.coulomb': (coulomb,),
            'friction.offset': (offset,), 'robot.gravity': (0.0, 0.0, gravity),
            'friction.reversal_velocity': width}
