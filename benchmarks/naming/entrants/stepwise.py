# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stepwise selection by the Bayesian information criterion, with white or whitened noise.

What most people would write first: add the group that lowers BIC most, drop what raises it, until
nothing pays. G. Schwarz, Ann. Stat. 6 (1978) 461. The noise may be estimated again with the
chosen groups, and all chosen again, as D. Cochrane and G. Orcutt do (J. Am. Stat. Assoc. 44
(1949) 32).
"""

from __future__ import annotations

import numpy as np

from benchmarks.naming.entrants.equations import Equations, Group
from benchmarks.naming.problems import Answer, Problem


def stepwise(problem: Problem, whiten: bool, weight: float = 1.0, rounds: int = 1) -> Answer:
    """Return what stepwise selection finds; `weight` multiplies the penalty."""
    chosen: list[Group] = []
    for _ in range(rounds):
        equations = Equations(problem, whiten, chosen)
        before, chosen = chosen, _selected(equations, weight)
        if chosen == before:
            break
    return equations.answered(chosen)


def _selected(equations: Equations, weight: float) -> list[Group]:
    n = len(equations.y)
    chosen: list[Group] = []

    def cost(groups: list[Group]) -> float:
        columns = [k for group in groups for k in group.columns]
        return float(n * np.log(max(equations.fit(columns)[2], 1e-12) / n)
                     + weight * len(columns) * np.log(n))

    current = cost(chosen)
    while len(chosen) < 20:
        taken = {(group.effect, group.drive) for group in chosen}
        free = [group for group in equations.groups if (group.effect, group.drive) not in taken]
        if not free:
            break
        gains = equations.gains([k for group in chosen for k in group.columns], free)
        # Of each number of columns the best, as the penalty differs.
        sizes = np.array([len(group.columns) for group in free])
        best = min((cost([*chosen, free[int(k)]]), int(k)) for size in set(sizes)
                   for k in [np.flatnonzero(sizes == size)[np.argmax(gains[sizes == size])]])
        if best[0] >= current:
            break
        chosen, current = [*chosen, free[best[1]]], best[0]
        for removed in list(chosen):
            without = [other for other in chosen if other is not removed]
            if cost(without) < current:
                chosen, current = without, cost(without)
    return chosen
