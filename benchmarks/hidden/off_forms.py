# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hidden forces in drives whose form is off by 5 to 15 %, as those of a machine are.

The force is multiplied by 1 + s g(q, v), with g two waves, over position and velocity, of rms 1.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.simulation.injected_forms import FORMS

OFF = (0.05, 0.15)  # s
WAVELENGTHS = (0.05, 0.3)  # [m]
WAVES_OF_VELOCITY = (0.05, 0.3)  # [m/s]
# But for a constant, what every axis has, and what came after the public problems were drawn.
CAN_BE_OFF = tuple(sorted({*FORMS} - {'effort_offset', 'gear_efficiency', 'counterbalance',
                                      'drive_inertia'}))


def off_form(motion: JointMotion, rng: np.random.Generator) -> Array:
    """Return by what injected forces are multiplied along a motion, (N, D)."""
    share = rng.uniform(*OFF)
    length, wave = np.exp(rng.uniform(*np.log((WAVELENGTHS, WAVES_OF_VELOCITY)).T))
    phases = rng.uniform(0, 2 * np.pi, 2)
    factor: Array = 1 + share * (np.cos(2 * np.pi * motion.position / length + phases[0])
                                 + np.cos(2 * np.pi * motion.velocity / wave + phases[1]))
    return factor
