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


def lasso(problem: Problem, errors: float = 0.0) -> Answer:
    """Return the groups with a coefficient that LASSO keeps; `errors` as the one-error rule."""
    from sklearn.linear_model import LassoCV

    equations = Equations(problem)
    folds = [(np.flatnonzero(equations.blocks != fold), np.flatnonzero(equations.blocks == fold))
             for fold in (0, 2, 4, 6, 8)]
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        found = LassoCV(alphas=25, cv=folds, fit_intercept=False, max_iter=2000, tol=1e-3,
                        precompute=True).fit(equations.X, equations.y)
        coefficients = found.coef_
        if errors:
            from sklearn.linear_model import Lasso

            mean = found.mse_path_.mean(axis=1)
            error = found.mse_path_.std(axis=1, ddof=1) / np.sqrt(len(folds))
            best = int(np.argmin(mean))
            weight = found.alphas_[int(np.argmax(mean <= mean[best] + errors * error[best]))]
            coefficients = Lasso(weight, fit_intercept=False, max_iter=2000, tol=1e-3,
                                 precompute=equations.gram).fit(equations.X, equations.y).coef_
    return equations.answered(best_shapes(equations, coefficients))


def adaptive_group_lasso(problem: Problem, power: float = 1.0) -> Answer:
    """Return the groups that the adaptive group LASSO of least BIC keeps."""
    from skglm import GroupLasso

    equations = Equations(problem)
    # As many rows as columns say the same as all samples.
    values, vectors = np.linalg.eigh(equations.gram)
    kept = values > 1e-9 * values.max()
    root = np.sqrt(values[kept])
    n = len(equations.y)
    scale = np.sqrt(np.count_nonzero(kept) / n)
    rows = np.asfortranarray(scale * root[:, None] * vectors[:, kept].T)
    seen = scale * (vectors[:, kept].T @ equations.right) / root
    ridge = (vectors[:, kept] / (root ** 2 + 1e-3 * n)) @ (vectors[:, kept].T @ equations.right)
    groups = [list(group.columns) for group in equations.groups]
    sizes = np.array([np.linalg.norm(ridge[group]) / np.sqrt(len(group)) for group in groups])
    weights = np.sqrt([len(group) for group in groups]) / np.maximum(sizes, 1e-6) ** power
    top = max(np.linalg.norm(equations.right[group]) / n / weight
              for group, weight in zip(groups, weights, strict=True))
    best = n * np.log(equations.total / n)
    chosen: list[Group] = []
    solver = GroupLasso(groups, weights=weights, fit_intercept=False, warm_start=True, tol=1e-4,
                        max_epochs=2000)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        for weight in WEIGHTS:
            solver.alpha = weight * top
            found = best_shapes(equations, solver.fit(rows, seen).coef_)
            columns = [k for group in found for k in group.columns]
            if len(columns) > LARGEST:
                break
            cost = n * np.log(max(equations.fit(columns)[2], 1e-12) / n) + len(columns) * np.log(n)
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
