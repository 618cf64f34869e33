# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Elementary functions for the equations, alike for floats and for arrays of samples.

An equation is stated once, componentwise, and runs in three ways: on floats, on arrays with one
element per sample, and compiled. See `evaluation`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def sqrt(x: Any) -> Any:
    """Return the square root, NaN below 0."""
    if isinstance(x, float):
        return math.sqrt(x) if x >= 0.0 else math.nan
    return np.sqrt(x)


def tanh(x: Any) -> Any:
    """Return the hyperbolic tangent."""
    # math.tanh rounds otherwise: one sample would not equal the same sample among others.
    return float(np.tanh(x)) if isinstance(x, float) else np.tanh(x)


def larger(x: Any, y: Any) -> Any:
    """Return the larger of two numbers, element by element; NaN where x is."""
    if isinstance(x, float):
        return y if x < y else x
    return np.maximum(x, y)


def everywhere(condition: Any) -> bool:
    """Return whether a condition holds, of arrays in all elements."""
    return bool(np.all(condition))


# Compiled code calls these in their place.
def compiled_sqrt(x: Any) -> Any:
    """Return the square root, NaN below 0."""
    return math.sqrt(x)


def compiled_tanh(x: Any) -> Any:
    """Return the hyperbolic tangent."""
    return math.tanh(x)


def compiled_larger(x: Any, y: Any) -> Any:
    """Return the larger of two numbers; NaN where x is."""
    return y if x < y else x


def compiled_everywhere(condition: Any) -> bool:
    """Return whether a condition holds."""
    return condition  # type: ignore[no-any-return]
