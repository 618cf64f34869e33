# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Weighted least squares of all columns at once, read by relative deviations, as FIGAROH's.

Robot identification keeps a parameter whose relative standard deviation is small and drops the
worst one by one (essential parameters): W. Khalil, E. Dombre, Modeling, Identification and Control
of Robots (2002), 12.4; T. D. V. Nguyen et al., FIGAROH, 2023. One shape of each effect takes part,
that of the best single fit.
"""

from __future__ import annotations

import numpy as np

from benchmarks.naming.entrants.equations import Equations
from benchmarks.naming.problems import Answer, Problem

RELATIVE = 0.1  # relative standard deviation, to which a parameter counts as identified


def relative_deviations(problem: Problem, limit: float = RELATIVE) -> Answer:
    """Return the columns that remain after all of larger relative deviation, worst first."""
    equations = Equations(problem)
    single = set(equations.best_single())
    chosen = [group for group in equations.groups if set(group.columns) <= single]
    while chosen:
        columns = [k for group in chosen for k in group.columns]
        found, inverse, rest = equations.fit(columns)
        noise = rest / max(len(equations.y) - len(columns), 1)
        relative = (np.sqrt(np.maximum(noise * np.diag(inverse), 0))
                    / np.maximum(np.abs(found), 1e-12))
        worst, at = -1.0, 0
        out = chosen[0]
        for group in chosen:
            least = float(relative[at:at + len(group.columns)].min())
            at += len(group.columns)
            if least > worst:
                worst, out = least, group
        if worst <= limit:
            break
        chosen = [group for group in chosen if group is not out]
    return equations.answered(chosen)
