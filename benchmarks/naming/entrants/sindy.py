# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""PySINDy's optimisers on the columns: STLSQ, SR3, FROLS and EvidenceGreedy.

S. Brunton, J. Proctor, J. N. Kutz, PNAS 113 (2016) 3932; P. Zheng et al., IEEE Access 7 (2019)
1404; S. Billings, Nonlinear System Identification (2013). EvidenceGreedy drops terms as long as the
Bayesian evidence grows, and keeps one at least; PySINDy has it after 2.1.0. The error of the drives
stands where PySINDy has derivatives, as in its use for model discrepancy (K. Kaheman et al., 2019).
"""

from __future__ import annotations

import warnings
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from scipy.linalg import qr

from benchmarks.naming.entrants.equations import Equations
from benchmarks.naming.entrants.penalised import best_shapes
from benchmarks.naming.problems import Answer, Problem

STEPS = 10  # of FROLS, by its default
SCREENED = 20  # groups by forward selection that EvidenceGreedy begins with
ALIKE = 1e-3  # share of a column that others leave, below which FROLS does not get it


def has_evidence_greedy() -> bool:
    """Return whether the PySINDy that is installed has it, without importing it."""
    found = find_spec('pysindy')
    return found is not None and found.origin is not None and (
        Path(found.origin).parent / 'optimizers' / 'evidence_greedy.py').exists()


def sindy(problem: Problem, optimiser: str = 'STLSQ', threshold: float = 0.1,
          steps: int = STEPS, precision: float = 1.0) -> Answer:
    """Return what an optimiser of PySINDy keeps.

    Parameters
    ----------
    problem : Problem
    optimiser : {'STLSQ', 'SR3', 'FROLS', 'EvidenceGreedy'}
    threshold : float
        On coefficients of columns of unit rms; the error is in units of its noise. Of the first
        two.
    steps : int
        Terms of FROLS at the most.
    precision : float
        Of the prior on coefficients, of EvidenceGreedy.
    """
    import pysindy

    equations = Equations(problem)
    made = {'STLSQ': lambda: pysindy.STLSQ(threshold=threshold),
            'SR3': lambda: pysindy.SR3(reg_weight_lam=threshold ** 2 / 2, max_iter=300),
            'FROLS': lambda: pysindy.FROLS(max_iter=int(steps)),
            # The error is in units of its noise: a variance of 1.
            'EvidenceGreedy': lambda: pysindy.optimizers.EvidenceGreedy(
                alpha=precision, _sigma2=1.0, normalize_columns=False)}[optimiser]()
    rows, seen = equations.compressed()
    columns = at = list(range(equations.X.shape[1]))
    if optimiser == 'FROLS':  # divides by what is left of a column beside others
        columns = at = unlike(rows, equations.best_single())
    elif optimiser == 'EvidenceGreedy':  # its time grows with the fourth power of their number
        columns = [k for group in equations.forward(SCREENED) for k in group.columns]
        # As many rows again as columns are left.
        short = np.linalg.qr(np.column_stack((rows[:, columns], seen)), mode='r')
        rows, seen, at = short[:, :-1], short[:, -1], list(range(len(columns)))
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        made.fit(rows[:, at], seen[:, None])
    coefficients = np.zeros(equations.X.shape[1])
    coefficients[columns] = np.ravel(made.coef_)
    return equations.answered(best_shapes(equations, coefficients))


def unlike(rows: np.ndarray, columns: list[int]) -> list[int]:
    """Return the columns that others, or the model's own numbers, do not make up nearly."""
    size, order = qr(rows[:, columns], mode='r', pivoting=True)
    left = np.abs(np.diag(size))
    return sorted(columns[k] for k in order[:np.count_nonzero(left > ALIKE * left[0])])
