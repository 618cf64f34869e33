# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Arrays of numbers: the types that all modules share, and what they need everywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# In kernels, which are run on one sample or on many: a number or one a sample, and which sample.
Value = float | Array
Sample = int | slice


def root_mean_square(values: ArrayLike) -> float:
    """Return the root of the mean square of what is known; NaN where nothing is."""
    numbers = np.asarray(values)
    known = numbers[~np.isnan(numbers)]
    return float(np.sqrt(np.mean(known ** 2))) if known.size else np.nan
