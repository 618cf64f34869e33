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

"""Where drives stand: their efforts are whatever static friction leaves, and tell nothing."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from pprs_dynamics.arrays import Array

SHORTEST_REST = 0.5  # [s]; reversals of a motion are over sooner


def find_rests(position: Array, step: float, speed: float) -> np.typing.NDArray[np.bool_]:
    """Return where each drive stands, (N, D).

    Parameters
    ----------
    position : (N, D) array
        Of one segment [rad, m].
    step : float
        Between samples [s].
    speed : float
        A drive stands that moves less than this, in the mean over `SHORTEST_REST` [rad/s, m/s].
    """
    window = max(2, round(SHORTEST_REST / step))
    if len(position) < window:
        return np.zeros(position.shape, dtype=bool)
    span = (maximum_filter1d(position, window, axis=0, mode='nearest')
            - minimum_filter1d(position, window, axis=0, mode='nearest'))
    # Every sample of such a window stands, not its middle alone.
    rests: np.typing.NDArray[np.bool_] = maximum_filter1d(
        span < speed * SHORTEST_REST, window, axis=0, mode='nearest')
    return rests
