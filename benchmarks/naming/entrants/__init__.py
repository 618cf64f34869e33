# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The entrants by name. A method of one's own joins by a line here, or by files (README.md)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from benchmarks.naming.entrants.averaging import model_averaging
from benchmarks.naming.entrants.controls import random, silent
from benchmarks.naming.entrants.cross_validation import block_cross_validation
from benchmarks.naming.entrants.least_squares import relative_deviations
from benchmarks.naming.entrants.penalised import adaptive_group_lasso, lasso
from benchmarks.naming.entrants.pprs import pprs
from benchmarks.naming.entrants.sindy import sindy
from benchmarks.naming.entrants.split_test import split_test
from benchmarks.naming.entrants.stepwise import stepwise
from benchmarks.naming.problems import Answer, Problem

ENTRANTS: dict[str, Callable[[Problem], Answer]] = {
    'pprs diagnose': pprs,
    'stepwise BIC, white': partial(stepwise, whiten=False),
    'stepwise BIC, AR': partial(stepwise, whiten=True),
    'block cross-validation': block_cross_validation,
    'LASSO': lasso,
    'adaptive group LASSO': adaptive_group_lasso,
    'PySINDy STLSQ': partial(sindy, optimiser='STLSQ'),
    'PySINDy SR3': partial(sindy, optimiser='SR3'),
    'PySINDy FROLS': partial(sindy, optimiser='FROLS'),
    'Bayesian averaging, AR': model_averaging,
    'held-out F-test (LISDD)': split_test,
    'least squares (FIGAROH)': relative_deviations,
    'silent': silent,
    'random': random,
}
