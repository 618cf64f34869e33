# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Bayesian model averaging by BIC weights over the sets that a random walk visits.

A. Raftery, Sociol. Methodol. 25 (1995) 111; D. Madigan, J. York, Int. Stat. Rev. 63 (1995) 215
(MC3). Sets within a factor of 20 of the likeliest are reported (Occam's window).
"""

from __future__ import annotations

import numpy as np

from benchmarks.naming.entrants.equations import Equations, Group
from benchmarks.naming.problems import Answer, Problem

STEPS = 3000
WINDOW = 20.0  # odds


def model_averaging(problem: Problem, window: float = WINDOW, whiten: bool = True) -> Answer:
    """Return the sets of effects that have posterior weight."""
    equations = Equations(problem, whiten)
    n, rng = len(equations.y), np.random.default_rng(0)
    places = sorted({(group.effect, group.drive or '') for group in equations.groups})
    shapes = {place: [group for group in equations.groups
                      if (group.effect, group.drive or '') == place] for place in places}
    prior = 2 * np.log(len(places))
    costs: dict[tuple[int, ...], float] = {}
    at = {id(group): k for k, group in enumerate(equations.groups)}

    def cost(groups: list[Group]) -> float:
        key = tuple(sorted(at[id(group)] for group in groups))
        if key not in costs:
            columns = [k for group in groups for k in group.columns]
            costs[key] = float(n * np.log(max(equations.fit(columns)[2], 1e-12) / n)
                               + len(columns) * np.log(n) + prior * len(groups))
        return costs[key]

    current: list[Group] = []
    gains = equations.gains([], equations.groups)
    weights = np.array([max(gains[at[id(group)]] for group in shapes[place]) for place in places])
    weights = np.sqrt(np.maximum(weights, 1e-12))
    weights /= weights.sum()
    for _ in range(STEPS):
        place = places[int(rng.choice(len(places), p=weights))]
        present = [group for group in current if (group.effect, group.drive or '') == place]
        moved = [group for group in current if group not in present]
        if not present or rng.random() < 0.3:
            moved = [*moved, shapes[place][int(rng.integers(len(shapes[place])))]]
        if len(moved) <= 15 and np.log(rng.random()) < (cost(current) - cost(moved)) / 2:
            current = moved
    # What is said is about names and drives: shapes of one set are one set.
    said: dict[tuple[tuple[str, str], ...], tuple[float, tuple[int, ...]]] = {}
    for key, value in costs.items():
        named = tuple(sorted((equations.groups[k].effect, equations.groups[k].drive or '')
                             for k in key))
        if named not in said or value < said[named][0]:
            said[named] = value, key
    ranked = sorted(said.values())
    near = [key for value, key in ranked if value < ranked[0][0] + 2 * np.log(window)]
    answers = [equations.answered([equations.groups[k] for k in key]) for key in near[:10]]
    if answers[0].verdict == 'none' or len(answers) == 1:
        return answers[0]
    return Answer('ambiguous', tuple(answer.sets[0] for answer in answers if answer.sets))
