# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How fast drives move, by the spectrum of their accelerations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.differentiation import Smoothing, Stretch

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
