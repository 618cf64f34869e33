# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Arrays of numbers: the types that all modules share, and what they need everywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int_]

# A number, or one a sample.
Value = float | Array


def as_numbers(values: ArrayLike) -> Array:
    """Return a copy as floats: what is missing (None, NA of pandas) is NaN, dates are seconds.

    Raises
    ------
    ValueError, TypeError
        For what is no number.
    """
    if hasattr(values, 'to_numpy'):
        values = values.to_numpy()  # columns of pandas and of its kind, with NA as an object
    array = np.asarray(values)
    if array.dtype.kind in 'mM':
        origin = np.zeros(1, f'{array.dtype.kind}8[ns]')
        return np.asarray((array - origin) / np.timedelta64(1, 's'), dtype=float)
    if array.dtype == object:
        return np.array([np.nan if _is_missing(x) else float(x) for x in array.flat],
                        dtype=float).reshape(array.shape)
    return np.array(array, dtype=float)


def _is_missing(value: object) -> bool:
    # Nothing but NA of pandas is neither equal to itself nor not; pandas need not be there.
    return value is None or type(value).__name__ in ('NAType', 'NaTType')


def root_mean_square(values: ArrayLike) -> float:
    """Return the root mean square of the values that are not NaN; NaN without any."""
    numbers = np.asarray(values)
    known = numbers[~np.isnan(numbers)]
    return float(np.sqrt(np.mean(known ** 2))) if known.size else np.nan
