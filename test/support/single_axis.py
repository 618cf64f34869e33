# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motions of a single axis for tests: sums of sines."""

from __future__ import annotations

import numpy as np

from pprs_dynamics import JointMotion
from pprs_dynamics.arrays import Array

SINES = ((0.2, 0.1), (0.5, 0.05), (1.3, 0.01))  # [Hz, m]


def axis_motion(time: Array) -> JointMotion:
    """Return the sum of `SINES` with its rates."""
    w, size = np.array([(2 * np.pi * rate, size) for rate, size in SINES]).T
    phase = time[:, None] * w
    q, v, a = (np.sum(values, axis=1, keepdims=True) for values in (
        size * np.sin(phase), size * w * np.cos(phase), -size * w ** 2 * np.sin(phase)))
    return JointMotion(q, v, a, time)
