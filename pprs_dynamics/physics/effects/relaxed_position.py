# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Springs k (q - q_0), which are linear in k and the force at q = 0, -k q_0, not in q_0."""

from __future__ import annotations

import math

FARTHEST = 1000.0  # [m, rad], of the relaxed position: from there a spring is a constant force


def relaxed_position(k: float, force: float) -> tuple[float, float]:
    """Return k and q_0 = -force / k.

    A force with next to no stiffness becomes the softest spring that reaches it from the farthest
    position allowed.
    """
    k = math.copysign(max(abs(k), abs(force) / FARTHEST), k)
    position = 0.0 - force / k if k else 0.0
    return k, max(-FARTHEST, min(FARTHEST, position))
