# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""LASSO and adaptive group LASSO, by scikit-learn and skglm.

R. Tibshirani, J. R. Stat. Soc. B 58 (1996) 267; H. Wang, C. Leng, Comput. Stat. Data Anal. 52
(2008) 5277. The first takes its weight from cross-validation over blocks, the second from BIC.
"""

from __future__ import annotations

import warnings

import numpy as np

from benchmarks.naming.entrants.equations import Equations, Group
from benchmarks.naming.problems import Answer, Problem

LARGEST = 60  # columns of a set that is still looked at
WEIGHTS = np.geomspace(1.0, 1e-3, 25)  # over that at which nothing is chosen
LEAST_OF_LASSO = 0.01  # of these: below, some hundred columns take part
FOLDS = (0, 2, 4, 6, 8)  # blocks of time that are held out


def lasso(problem: Problem, errors: float = 0.0) -> Answer:
    """Return the groups with a coefficient that LASSO keeps; `errors` as the one-error rule."""
    from sklearn.linear_model import lasso_path

    equations = Equations(problem)
    highest = float(np.abs(equations.right).max()) / len(equations.y)
    strengths = highest * WEIGHTS[WEIGHTS >= LEAST_OF_LASSO]

    def path(without: np.ndarray | None = None) -> np.ndarray:
        rows, seen = equations.compressed(without)
        # scikit-learn's penalty is per row.
        count = len(equations.y) - (0 if without is None else np.count_nonzero(without))
        scale = np.sqrt(len(rows) / count)
        return np.asarray(lasso_path(scale * rows, scale * seen, alphas=strengths, max_iter=300,
                                     tol=1e-3)[1])

    left = np.zeros((len(FOLDS), len(strengths)))
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        for k, fold in enumerate(FOLDS):
            out = equations.blocks == fold
            rest = equations.y[out][:, None] - equations.X[out] @ path(out)
            left[k] = np.mean(np.square(rest), axis=0)
        mean, error = left.mean(axis=0), left.std(axis=0, ddof=1) / np.sqrt(len(FOLDS))
        best = int(np.argmin(mean))
        chosen = int(np.argmax(mean <= mean[best] + errors * error[best]))
        return equations.answered(best_shapes(equations, path()[:, chosen]))


def adaptive_group_lasso(problem: Problem, power: float = 1.0, weight: float = 1.0) -> Answer:
    """Return the groups that the adaptive group LASSO of least BIC keeps, its penalty weighted."""
    from skglm import GroupLasso

    equations = Equations(problem)
    rows, seen = equations.compressed()
    n = len(equations.y)
    ridge = np.linalg.solve(equations.gram + 1e-3 * n * np.eye(len(equations.gram)),
                            equations.right)
    scale = np.sqrt(len(rows) / n)
    rows, seen = np.asfortranarray(scale * rows), scale * seen
    groups = [list(group.columns) for group in equations.groups]
    sizes = np.array([np.linalg.norm(ridge[group]) / np.sqrt(len(group)) for group in groups])
    weights = np.sqrt([len(group) for group in groups]) / np.maximum(sizes, 1e-6) ** power
    top = max(np.linalg.norm(equations.right[group]) / n / own
              for group, own in zip(groups, weights, strict=True))
    best = n * np.log(equations.total / n)
    chosen: list[Group] = []
    solver = GroupLasso(groups, weights=weights, fit_intercept=False, warm_start=True, tol=1e-4,
                        max_epochs=2000)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        for strength in WEIGHTS:
            solver.alpha = strength * top
            found = best_shapes(equations, solver.fit(rows, seen).coef_)
            columns = [k for group in found for k in group.columns]
            if len(columns) > LARGEST:
                break
            cost = (n * np.log(max(equations.fit(columns)[2], 1e-12) / n)
                    + weight * len(columns) * np.log(n))
            if cost < best:
                best, chosen = cost, found
    return equations.answered(chosen)


def best_shapes(equations: Equations, coefficients: np.ndarray) -> list[Group]:
    """Return the groups that have coefficients, of each effect at a place the strongest shape."""
    best: dict[tuple[str, str | None], tuple[float, Group]] = {}
    for group in equations.groups:
        size = float(np.linalg.norm(coefficients[list(group.columns)]))
        key = group.effect, group.drive
        if size > 0 and size > best.get(key, (0.0, group))[0]:
            best[key] = size, group
    return [group for _, group in best.values()]
