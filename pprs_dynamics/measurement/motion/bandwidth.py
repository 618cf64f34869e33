# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How fast drives move, by the spectrum of their accelerations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.motion.differentiation import Smoothing, Stretch

SHARE = 0.9  # of the power, below the bandwidth


def motion_bandwidth(stretches: Sequence[Stretch], smoothing: Smoothing) -> float:
    """Return the frequency below which most of the accelerations' power lies, over drives [Hz].

    Every drive counts alike, however far it moves; infinite where none moves.
    """
    bandwidth = 0.0
    for position, step, _ in stretches:
        filter_ = smoothing.polynomial(step)
        if len(position) < 2 * filter_.window:
            continue
        acceleration = filter_.filtered(position, 2)
        window = np.hanning(len(acceleration))[:, None]
        power = np.abs(np.fft.rfft((acceleration - acceleration.mean(axis=0)) * window,
                                   axis=0)) ** 2
        total = power.sum(axis=0)
        if np.any(total > 0):
            shares: Array = np.cumsum((power[:, total > 0] / total[total > 0]).mean(axis=1))
            at = int(np.searchsorted(shares, SHARE))
            bandwidth = max(bandwidth, at / (len(acceleration) * step))
    return bandwidth or float('inf')
