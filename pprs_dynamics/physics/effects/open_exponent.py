# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction whose exponent of a load or a speed is not quite 1: an open form of several effects."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array

EXPONENTS = 1 / 3  # standard deviation of real exponents from 1
LEAST_SHARE = 1e-3  # of the usual size, below which the logarithm goes no further


def other_exponent(quantity: Array, column: Array) -> Array:
    """Return what an exponent by `EXPONENTS` above 1 adds to a column, to first order.

    Parameters
    ----------
    quantity : (N,) array
        Load or speed, of any sign, to which the column is in proportion.
    column : (N,) array
    """
    size = np.abs(quantity)
    usual = np.sqrt(np.mean(size ** 2)) or 1.0
    return EXPONENTS * np.log(np.maximum(size / usual, LEAST_SHARE)) * column
