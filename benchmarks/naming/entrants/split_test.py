# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A held-out F-test with control of the false discovery rate, after LISDD.

"Where Is My Physics Wrong? Localized and Identifiable Discovery of Model Discrepancy" (LISDD)
fits the physics robustly where it is right, and chooses a sparse term by exhaustive holdout. An
F-test on a split of the sample that chose nothing tests it, over regions with Benjamini-Hochberg.
Here the regions are the drives: on each, of all sets of one or two groups the one of least error
on the second third of the time is tested on the last. Its code is not public; this is our reading.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.stats import f as f_distribution

from benchmarks.naming.entrants.equations import Equations, Group
from benchmarks.naming.problems import Answer, Problem

DISCOVERIES = 0.05
PAIRED = 12  # best groups of which pairs are tried


def split_test(problem: Problem, discoveries: float = DISCOVERIES, whiten: bool = False) -> Answer:
    """Return the terms that a held-out F-test confirms."""
    equations = Equations(problem, whiten)
    part = np.digitize(equations.blocks, (4, 7))  # fit, choose, test
    tested: list[tuple[float, tuple[Group, ...]]] = []
    for d, drive in enumerate(problem.drives):
        here = equations.drive == d
        fit, choose, test = (np.flatnonzero(here & (part == k)) for k in range(3))
        groups = [group for group in equations.groups if group.drive in (drive, None)]
        scored = sorted(((_left(equations, (group,), fit, choose), k)
                         for k, group in enumerate(groups)))
        best = [((groups[k],), value) for value, k in scored[:1]]
        for a, b in combinations([groups[k] for _, k in scored[:PAIRED]], 2):
            if (a.effect, a.drive) != (b.effect, b.drive):
                best.append(((a, b), _left(equations, (a, b), fit, choose)))
        chosen = min(best, key=lambda scored: scored[1])[0]
        columns = [k for group in chosen for k in group.columns]
        X, y = equations.X[np.ix_(test, columns)], equations.y[test]
        rest = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
        free = max(len(y) - len(columns), 1)
        ratio = ((y @ y - rest @ rest) / len(columns)) / max(rest @ rest / free, 1e-12)
        tested.append((float(f_distribution.sf(ratio, len(columns), free)), chosen))
    tested.sort(key=lambda scored: scored[0])
    passed = max((k + 1 for k, (p, _) in enumerate(tested)
                  if p <= discoveries * (k + 1) / len(tested)), default=0)
    found = {(g.effect, g.drive): g for _, chosen in tested[:passed] for g in chosen}
    return equations.answered(list(found.values()))


def _left(equations: Equations, groups: tuple[Group, ...], fit: np.ndarray,
          choose: np.ndarray) -> float:
    columns = [k for group in groups for k in group.columns]
    X = equations.X[np.ix_(fit, columns)]
    gram = X.T @ X
    found = np.linalg.solve(gram + 1e-6 * max(np.trace(gram), 1e-9) * np.eye(len(columns)),
                            X.T @ equations.y[fit])
    return float(np.mean(np.square(
        equations.y[choose] - equations.X[np.ix_(choose, columns)] @ found)))
