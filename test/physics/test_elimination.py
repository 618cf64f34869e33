# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Elimination that passes over zeros, against LAPACK; pivots that vanish included."""

from __future__ import annotations

import numpy as np
import pytest

from pprs_dynamics.physics.mechanism.tree_equations import solve

SIZE, COLUMNS = 14, 3


def a_platform_on_legs(random: np.random.Generator) -> np.ndarray:
    """Return a matrix of four legs of 3 rows and 2 joints of their own, a platform, and a pair."""
    pattern = np.zeros((SIZE, SIZE), dtype=bool)
    for leg in range(4):
        pattern[3 * leg:3 * leg + 3, 2 * leg:2 * leg + 2] = True
        pattern[3 * leg:3 * leg + 3, 8:12] = True
    pattern[12:, 12:] = True
    shuffled = pattern[random.permutation(SIZE)][:, random.permutation(SIZE)]
    return random.normal(size=shuffled.shape) * shuffled


@pytest.mark.parametrize('seed', range(3))
def test_it_solves_what_lapack_solves(seed: int) -> None:
    random = np.random.default_rng(seed)
    for k in range(12):
        A = a_platform_on_legs(random)
        if 4 < k < 10:
            A[k, k] = A[0, 0] = 1e-13 * random.normal()
        elif k > 9:
            A[:3, :2] *= 1e-9
        B = random.normal(size=(SIZE, COLUMNS))
        left, right = A.copy(), B.copy()
        determinant = solve(left, right)
        assert determinant == pytest.approx(np.linalg.det(A), rel=1e-8)
        expected = np.linalg.solve(A, B)
        scale = np.linalg.cond(A) * np.abs(expected).max()
        assert np.abs(right - expected).max() < 1e-13 * scale
