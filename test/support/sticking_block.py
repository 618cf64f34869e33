# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A block on a spring that sticks and slips over friction that falls."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array

STEP = 0.01  # [s]
TIME = np.arange(0, 30, STEP)


def dragged(asked: Array, stiffness: float = 40.0, static: float = 1.2, sliding: float = 0.6,
            mass: float = 0.02) -> tuple[Array, Array]:
    """Return position and effort of a block dragged by a spring over friction that falls.

    Integrated in steps of 0.1 ms: it stands while the spring pulls less than `static`.
    """
    h, substeps = STEP / 100, 100
    q, v, found = asked[0], 0.0, np.empty((len(asked), 2))
    target = np.interp(np.arange(len(asked) * substeps) / substeps, np.arange(len(asked)), asked)
    for k in range(len(asked)):
        for goal in target[k * substeps:(k + 1) * substeps]:
            pull = stiffness * (goal - q) - 0.4 * v
            if v == 0.0 and abs(pull) <= static:
                continue
            way = np.sign(v) if v else np.sign(pull)
            after = v + h * (pull - sliding * way) / mass
            v = 0.0 if v * after < 0 else after
            q += h * v
        found[k] = q, stiffness * (asked[k] - q)
    return found[:, 0], found[:, 1]


def slow(speed: float = 0.06) -> Array:
    """Return a slow way there and back."""
    return np.where(TIME < 15, speed * TIME, speed * (30 - TIME))
