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
    return condition if isinstance(condition, bool) else bool(np.all(condition))


def sin(x: Value) -> Value:
    """Return the sine [rad]."""
    return float(np.sin(x)) if isinstance(x, float) else np.sin(x)


def cos(x: Value) -> Value:
    """Return the cosine [rad]."""
    return float(np.cos(x)) if isinstance(x, float) else np.cos(x)


def largest(x: Any) -> int:
    """Return the next whole number above all elements, at least 1."""
    return max(1, math.ceil(float(np.max(x, initial=0.0))))


def solve(A: Any, B: Any, order: Any) -> Any:
    """Solve A X = B in place of B, and return the determinant of A, which is destroyed.

    Parameters
    ----------
    A : (n, n) or (n, n, N) array
    B : (n, K) or (n, K, N) array
    order : Model
        In which compiled code eliminates.
    """
    left, right = (np.asarray(each) for each in (A, B))
    if left.ndim == 2:
        determinant = float(np.linalg.det(left))
        right[:] = _solution(left, right)
        return determinant
    a, b = np.moveaxis(left, -1, 0), np.moveaxis(right, -1, 0)
    determinant = np.linalg.det(a)
    try:
        found = np.linalg.solve(a, b)
    except np.linalg.LinAlgError:  # one sample suffices: those that can be solved, one by one
        found = np.array([_solution(*one) for one in zip(a, b, strict=True)])
    right[:] = np.moveaxis(found, 0, -1)
    return determinant


def _solution(a: Any, b: Any) -> Any:
    """Return the solution of one system, not a number where there is none."""
    try:
        return np.linalg.solve(a, b)
    except np.linalg.LinAlgError:
        return np.full_like(b, np.nan)


def elements(named: Any) -> Any:
    """Return a named tuple of arrays whose elements are Python's numbers, which are faster."""
    return type(named)(*(array.data for array in named))


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


# A pivot smaller than this, of the largest number below it, is not taken: errors would grow by its
# inverse. Elimination then goes on with all rows and columns that are left.
STEADY = 0.05
SWAP, BELOW, RIGHT = 0, 1, 2  # columns of an order's `starts`


def compiled_solve(A: Any, B: Any, order: Any) -> Any:
    """Solve A X = B in place of B by elimination in an order; return the determinant of A."""
    swap, below, right, starts = order.swap, order.below, order.right, order.starts
    size, columns = len(A), B.shape[1]
    determinant, sparse = 1.0, size
    for k in range(size):
        pivot = k
        if sparse == size:
            for i in range(starts[k, SWAP], starts[k + 1, SWAP]):
                if abs(A[swap[i], k]) > abs(A[pivot, k]):
                    pivot = swap[i]
            for i in range(starts[k, BELOW], starts[k + 1, BELOW]):
                if STEADY * abs(A[below[i], k]) > abs(A[pivot, k]):
                    sparse = k
        if sparse < size:
            for r in range(k + 1, size):
                if abs(A[r, k]) > abs(A[pivot, k]):
                    pivot = r
        if pivot != k:
            determinant = -determinant
            for c in range(size):
                A[k, c], A[pivot, c] = A[pivot, c], A[k, c]
            for c in range(columns):
                B[k, c], B[pivot, c] = B[pivot, c], B[k, c]
        determinant *= A[k, k]
        scale = 1.0 / A[k, k]
        if sparse == size:
            for i in range(starts[k, BELOW], starts[k + 1, BELOW]):
                r = below[i]
                share = A[r, k] * scale
                for n in range(starts[k, RIGHT], starts[k + 1, RIGHT]):
                    A[r, right[n]] -= share * A[k, right[n]]
                for c in range(columns):
                    B[r, c] -= share * B[k, c]
        else:
            for r in range(k + 1, size):
                share = A[r, k] * scale
                for c in range(k + 1, size):
                    A[r, c] -= share * A[k, c]
                for c in range(columns):
                    B[r, c] -= share * B[k, c]
    for k in range(size - 1, -1, -1):
        scale = 1.0 / A[k, k]
        if k < sparse:
            for n in range(starts[k, RIGHT], starts[k + 1, RIGHT]):
                for c in range(columns):
                    B[k, c] -= A[k, right[n]] * B[right[n], c]
        else:
            for n in range(k + 1, size):
                for c in range(columns):
                    B[k, c] -= A[k, n] * B[n, c]
        for c in range(columns):
            B[k, c] *= scale
    return determinant


def compiled_elements(named: Any) -> Any:
    """Return a named tuple of arrays unchanged: compiled code reads them fast enough."""
    return named
