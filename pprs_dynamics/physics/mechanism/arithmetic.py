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

from pprs_dynamics.arrays import Value


def sqrt(x: Value) -> Value:
    """Return the square root, NaN below 0."""
    if isinstance(x, float):
        return math.sqrt(x) if x >= 0.0 else math.nan
    return np.sqrt(x)


def tanh(x: Value) -> Value:
    """Return the hyperbolic tangent."""
    # math.tanh rounds otherwise: one sample would not equal the same sample among others.
    return float(np.tanh(x)) if isinstance(x, float) else np.tanh(x)


def larger(x: Value, y: Value) -> Value:
    """Return the larger of two numbers, element by element; NaN where x is."""
    if isinstance(x, float):
        return y if x < y else x
    return np.maximum(x, y)


def everywhere(condition: Any) -> bool:
    """Return whether a condition holds, of arrays in all elements."""
    return bool(np.all(condition))


def sin(x: Value) -> Value:
    """Return the sine [rad]."""
    return np.sin(x)


def cos(x: Value) -> Value:
    """Return the cosine [rad]."""
    return np.cos(x)


def largest(x: Any) -> int:
    """Return the next whole number above all elements, at least 1."""
    return max(1, math.ceil(float(np.max(x, initial=0.0))))


def solve(A: Any, B: Any, size: int, columns: int) -> Any:
    """Solve A X = B in place of B, and return the determinant of A, which is destroyed.

    Parameters
    ----------
    A : (size, size, N) array
    B : (size, columns or more, N) array
    """
    a = np.moveaxis(A[:size, :size], -1, 0)
    b = np.moveaxis(B[:size, :columns], -1, 0)
    determinant = np.linalg.det(a)
    try:
        found = np.linalg.solve(a, b)
    except np.linalg.LinAlgError:  # one sample suffices: those that can be solved, one by one
        found = np.full_like(b, np.nan)
        for s in np.flatnonzero(determinant):
            found[s] = np.linalg.solve(a[s], b[s])
    B[:size, :columns] = np.moveaxis(found, 0, -1)
    return determinant


# Compiled code calls these in their place, and those of `math` for the others.
def compiled_larger(x: Any, y: Any) -> Any:
    """Return the larger of two numbers; NaN where x is."""
    return y if x < y else x


def compiled_everywhere(condition: Any) -> bool:
    """Return whether a condition holds."""
    return condition  # type: ignore[no-any-return]


def compiled_largest(x: Any) -> int:
    """Return the next whole number above, at least 1."""
    whole: int = math.ceil(x)
    return max(1, whole)


def compiled_solve(A: Any, B: Any, size: int, columns: int) -> Any:
    """Solve A X = B in place of B by elimination with pivoting; return the determinant of A."""
    determinant = 1.0
    for k in range(size):
        pivot = k
        for r in range(k + 1, size):
            if abs(A[r, k]) > abs(A[pivot, k]):
                pivot = r
        if pivot != k:
            determinant = -determinant
            for c in range(k, size):
                A[k, c], A[pivot, c] = A[pivot, c], A[k, c]
            for c in range(columns):
                B[k, c], B[pivot, c] = B[pivot, c], B[k, c]
        determinant *= A[k, k]
        scale = 1.0 / A[k, k]
        for r in range(k + 1, size):
            share = A[r, k] * scale
            if share != 0.0:
                for c in range(k + 1, size):
                    A[r, c] -= share * A[k, c]
                for c in range(columns):
                    B[r, c] -= share * B[k, c]
    for k in range(size - 1, -1, -1):
        for c in range(columns):
            x = B[k, c]
            for r in range(k + 1, size):
                x -= A[k, r] * B[r, c]
            B[k, c] = x / A[k, k]
    return determinant
