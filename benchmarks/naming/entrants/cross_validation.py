# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forward selection whose length cross-validation over blocks of time chooses.

The shortest set within one standard error of the best; T. Hastie, R. Tibshirani, J. Friedman, The
Elements of Statistical Learning (2009), 7.10.
"""

from __future__ import annotations

import numpy as np

from benchmarks.naming.entrants.equations import Equations
from benchmarks.naming.problems import Answer, Problem


def block_cross_validation(problem: Problem, errors: float = 1.0) -> Answer:
    """Return the set that cross-validation chooses; `errors` counts standard errors."""
    equations = Equations(problem)
    order = equations.forward()
    columns = [[k for group in order[:size] for k in group.columns]
               for size in range(len(order) + 1)]
    folds = np.unique(equations.blocks)
    held = np.zeros((len(columns), len(folds)))
    for f, fold in enumerate(folds):
        out = equations.blocks == fold
        gram = equations.gram - equations.X[out].T @ equations.X[out]
        right = equations.right - equations.X[out].T @ equations.y[out]
        for size, at in enumerate(columns):
            rest = equations.y[out]
            if at:
                part = gram[np.ix_(at, at)]
                rest = rest - equations.X[out][:, at] @ np.linalg.solve(
                    part + 1e-9 * np.trace(part) * np.eye(len(at)), right[at])
            held[size, f] = np.mean(np.square(rest))
    mean, error = held.mean(axis=1), held.std(axis=1, ddof=1) / np.sqrt(len(folds))
    best = int(np.argmin(mean))
    size = int(np.argmax(mean <= mean[best] + errors * error[best]))
    return equations.answered(order[:size])
