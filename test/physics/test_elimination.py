# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Elimination in an order that was found once, against LAPACK; pivots that vanish included."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pprs_dynamics.physics.mechanism.arithmetic import compiled_solve
from pprs_dynamics.physics.mechanism.closures import elimination_order

SIZE, COLUMNS = 14, 3


def a_platform_on_legs(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a matrix of four legs of 3 rows and 2 joints of their own, a platform, and a pair."""
    pattern = np.zeros((SIZE, SIZE), dtype=bool)
    for leg in range(4):
        pattern[3 * leg:3 * leg + 3, 2 * leg:2 * leg + 2] = True
        pattern[3 * leg:3 * leg + 3, 8:12] = True
    pattern[12:, 12:] = True
    shuffled = pattern[random.permutation(SIZE)][:, random.permutation(SIZE)]
    return random.normal(size=shuffled.shape) * shuffled, shuffled


def in_order(A: np.ndarray, pattern: np.ndarray) -> tuple[SimpleNamespace, np.ndarray, np.ndarray]:
    """Return the lists as compiled code takes them, and the order of rows and columns."""
    order = elimination_order(A, pattern)
    lists = order.swap, order.below, order.right
    starts = np.column_stack([np.cumsum([0, *map(len, one)]) for one in lists])
    swap, below, right = ([place for row in one for place in row] for one in lists)
    return (SimpleNamespace(starts=starts, swap=swap, below=below, right=right), order.rows,
            order.columns)


@pytest.mark.parametrize('seed', range(3))
def test_it_solves_what_lapack_solves_at_home_and_elsewhere(seed: int) -> None:
    random = np.random.default_rng(seed)
    home, pattern = a_platform_on_legs(random)
    lists, rows, columns = in_order(home, pattern)
    for k in range(12):
        A = (home if k == 0 else random.normal(size=home.shape) * pattern)[np.ix_(rows, columns)]
        if 4 < k < 10:  # pivots that were large at home are next to nothing here
            A[k, k] = A[0, 0] = 1e-13 * random.normal()
        elif k > 9:
            A[:3, :2] *= 1e-9
        B = random.normal(size=(SIZE, COLUMNS))
        left, right = A.copy(), B.copy()
        determinant = compiled_solve(left, right, lists)
        assert determinant == pytest.approx(np.linalg.det(A), rel=1e-8)
        expected = np.linalg.solve(A, B)
        scale = np.linalg.cond(A) * np.abs(expected).max()
        assert np.abs(right - expected).max() < 1e-13 * scale
