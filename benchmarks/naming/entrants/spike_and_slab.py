# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Spike-and-slab selection of groups by Gibbs sampling, coefficients integrated out.

E. George, R. McCulloch, J. Am. Stat. Assoc. 88 (1993) 881; Stat. Sinica 7 (1997) 339. Each effect
at a place is absent (spike) or has one of its shapes with a g-prior (slab). PyMC and NumPyro sample
coefficients by gradients, which inclusion does not have; here it is summed out.
"""

from __future__ import annotations

import numpy as np

from benchmarks.naming.entrants.equations import Equations, Group
from benchmarks.naming.problems import Answer, Problem

SWEEPS, DISCARDED = 60, 20
ODDS = 0.01  # of an effect at a place, before the recording
INCLUDED = 0.5  # the median probability model, M. Barbieri, J. Berger, Ann. Stat. 32 (2004) 870
MOST = 15  # effects in a set


def spike_and_slab(problem: Problem, odds: float = ODDS) -> Answer:
    """Return the effects that are more probably there than not."""
    equations, rng = Equations(problem, whiten=True), np.random.default_rng(0)
    n = len(equations.y)
    places: dict[tuple[str, str | None], list[Group]] = {}
    for group in equations.groups:
        places.setdefault((group.effect, group.drive), []).append(group)
    current: dict[tuple[str, str | None], Group] = {}
    seen: dict[tuple[str, str | None], dict[Group, int]] = {place: {} for place in places}
    for sweep in range(SWEEPS):
        for place in rng.permutation(len(places)):
            key = list(places)[int(place)]
            current.pop(key, None)
            if len(current) >= MOST:
                continue
            columns = [k for group in current.values() for k in group.columns]
            rest = max(equations.fit(columns)[2], 1e-12)
            gains = np.minimum(equations.gains(columns, places[key]), 0.999999 * rest)
            sizes = np.array([len(group.columns) for group in places[key]])
            # ln of the marginal likelihood of each shape over that of none, with g = n.
            weight = (np.log(odds / len(places[key])) - sizes / 2 * np.log(1 + n)
                      - n / 2 * np.log1p(-gains / rest))
            chance = np.exp(np.append(weight, 0.0) - max(weight.max(), 0.0))
            drawn = int(rng.choice(len(chance), p=chance / chance.sum()))
            if drawn < len(places[key]):
                current[key] = places[key][drawn]
        for key, group in current.items() if sweep >= DISCARDED else ():
            seen[key][group] = seen[key].get(group, 0) + 1
    return equations.answered([max(found, key=lambda key: found[key]) for found in seen.values()
                               if sum(found.values()) > INCLUDED * (SWEEPS - DISCARDED)])
