# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The setting of each peer that is right most often on public problems.

    python -m benchmarks.naming.tune FOLDER

Entrants get one sensible tuning each, on the seed that is public; `entrants.TUNED` holds what came.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from benchmarks.naming.entrants.averaging import model_averaging
from benchmarks.naming.entrants.cross_validation import block_cross_validation
from benchmarks.naming.entrants.least_squares import relative_deviations
from benchmarks.naming.entrants.penalised import adaptive_group_lasso, lasso
from benchmarks.naming.entrants.sindy import sindy
from benchmarks.naming.entrants.split_test import split_test
from benchmarks.naming.entrants.stepwise import stepwise
from benchmarks.naming.page import is_right
from benchmarks.naming.problems import Answer, Problem, Truth
from benchmarks.naming.scoring import Rate, judge

SETTINGS: Mapping[str, tuple[Callable[..., Answer], str, tuple[float, ...]]] = {
    'stepwise BIC, white': (partial(stepwise, whiten=False), 'weight', (1, 3, 10, 30, 100)),
    'stepwise BIC, AR': (partial(stepwise, whiten=True), 'weight', (1, 2, 4, 8, 16)),
    'block cross-validation': (block_cross_validation, 'errors', (0, 1, 2, 4)),
    'LASSO': (lasso, 'errors', (0, 1, 2, 4)),
    'adaptive group LASSO': (adaptive_group_lasso, 'power', (0.5, 1, 2)),
    'PySINDy STLSQ': (partial(sindy, optimiser='STLSQ'), 'threshold', (0.05, 0.1, 0.2, 0.4, 0.8)),
    'PySINDy SR3': (partial(sindy, optimiser='SR3'), 'threshold', (0.05, 0.1, 0.2, 0.4, 0.8)),
    'Bayesian averaging, AR': (model_averaging, 'window', (1.001, 20, 150)),
    'held-out F-test (LISDD)': (partial(split_test, whiten=True), 'discoveries',
                                (5e-2, 1e-3, 1e-6, 1e-12)),
    'least squares (FIGAROH)': (relative_deviations, 'limit', (0.3, 0.1, 0.03, 0.01)),
}


def main() -> None:
    """Print, for each entrant, how often each setting is right."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('folder', type=Path)
    folder = parser.parse_args().folder
    truths = [Truth.from_dict(json.loads(file.read_text()))
              for file in sorted((folder / 'truth').glob('*.json'))]
    problems = {truth.problem: Problem.read(folder / 'problems' / truth.problem)
                for truth in truths}
    for entrant, (method, name, values) in SETTINGS.items():
        for value in values:
            right = Rate.of(is_right(judge(truth, method(problems[truth.problem], **{name: value})))
                            for truth in truths)
            print(f'{entrant}: {name} {value:g}: {right}', flush=True)


if __name__ == '__main__':
    main()
