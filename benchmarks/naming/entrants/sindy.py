# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""PySINDy's optimisers on the columns: STLSQ, SR3 and FROLS.

S. Brunton, J. Proctor, J. N. Kutz, PNAS 113 (2016) 3932; P. Zheng et al., IEEE Access 7 (2019)
1404; S. Billings, Nonlinear System Identification (2013). The error of the drives stands where
PySINDy has derivatives, as in its use for model discrepancy (K. Kaheman et al., 2019).
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy.linalg import qr

from benchmarks.naming.entrants.equations import Equations
from benchmarks.naming.entrants.penalised import best_shapes
from benchmarks.naming.problems import Answer, Problem

STEPS = 10  # of FROLS, by its default
ALIKE = 1e-3  # share of a column that others leave, below which FROLS does not get it


def sindy(problem: Problem, optimiser: str = 'STLSQ', threshold: float = 0.1,
          steps: int = STEPS) -> Answer:
    """Return what an optimiser of PySINDy keeps.

    Parameters
    ----------
    problem : Problem
    optimiser : {'STLSQ', 'SR3', 'FROLS'}
    threshold : float
        On coefficients of columns of unit rms; the error is in units of its noise. Not of FROLS.
    steps : int
        Terms of FROLS at the most.
    """
    import pysindy

    equations = Equations(problem)
    made = {'STLSQ': lambda: pysindy.STLSQ(threshold=threshold),
            'SR3': lambda: pysindy.SR3(reg_weight_lam=threshold ** 2 / 2, max_iter=300),
            'FROLS': lambda: pysindy.FROLS(max_iter=int(steps))}[optimiser]()
    rows, seen = equations.compressed()
    # FROLS divides by what is left of a column beside others.
    columns = (unlike(rows, equations.best_single()) if optimiser == 'FROLS'
               else list(range(equations.X.shape[1])))
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        made.fit(rows[:, columns], seen[:, None])
    coefficients = np.zeros(equations.X.shape[1])
    coefficients[columns] = np.ravel(made.coef_)
    return equations.answered(best_shapes(equations, coefficients))


def unlike(rows: np.ndarray, columns: list[int]) -> list[int]:
    """Return the columns that others, or the model's own numbers, do not make up nearly."""
    size, order = qr(rows[:, columns], mode='r', pivoting=True)
    left = np.abs(np.diag(size))
    return sorted(columns[k] for k in order[:np.count_nonzero(left > ALIKE * left[0])])
