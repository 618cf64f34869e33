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
    added: Array = EXPONENTS * np.log(np.maximum(size / usual, LEAST_SHARE)) * column
    return added
