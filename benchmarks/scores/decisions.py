# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the score of `diagnose` owes to each number that was chosen: halved, and doubled.

    python -m benchmarks.scores.decisions --workers 2

A result that one number makes or breaks would be tuned, not found. Outcomes are appended to a
file as they come, and cases that are there are not run again.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import OUTPUT
from benchmarks.hidden.recordings import PINK, Case
from benchmarks.scores.cases import Outcome, outcomes_of, scoring_parser
from benchmarks.scores.diagnosis import cases, diagnose_case, one_line
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions

FACTORS = (0.5, 2.0)
AS_IT_IS = ('', 1.0)
# Recordings on which a number can matter: weak effects, sets, forms that are off, slow noise.
WEAK = (0.25, 0.5)
SLOWEST = (0.999, PINK)
SETS = 2  # of two and three effects, of a seed's
EVERY = 3  # of the effects of the catalogue, every third
ROWS = {'effects': 'good', 'pairs': 'good', 'forms': 'exact', 'unknown': 'good', 'nothing': 'good'}
# What changes words and warnings only.
TOLD = ('suspect_margin', 'statement_share', 'noise_accuracy', 'good', 'poor', 'sure', 'edge_share',
        'short', 'few_samples', 'unexcited', 'one_way', 'filtered')
NUMBERS = tuple(field.name for field in fields(Decisions) if field.name not in TOLD)
# A case, the number that is changed, and by what.
Changed = tuple[Case, str, float]


def changes() -> list[tuple[str, float]]:
    """Return each number with each factor, and nothing changed."""
    return [AS_IT_IS, *((name, factor) for name in NUMBERS for factor in FACTORS)]


def chosen_cases(first: int, seeds: int) -> list[Case]:
    """Return cases of most kinds, few enough to be run with every change."""
    found = [case for case in cases(('nothing',), seeds, seeds, (), first) if case.noise in SLOWEST]
    for seed in range(first, first + seeds):
        found += cases(('effects',), 1, 0, WEAK, seed)[seed % EVERY::2 * EVERY]
        found += cases(('pairs',), 1, 0, (), seed)[::EVERY][:SETS]
        found += cases(('forms',), 1, 0, (), seed)[seed % EVERY::EVERY]
        found += cases(('unknown',), 1, 0, (1.0,), seed)[seed % 2::2]
    return found


def run_changed(changed: Changed, recordings: Path) -> Outcome:
    """Return the outcome of a case with one number changed."""
    case, number, factor = changed
    decisions = DECISIONS if not number else replace(
        DECISIONS, **{number: factor * getattr(DECISIONS, number)})
    outcome = diagnose_case(case, partial(diagnose, decisions=decisions), recordings)
    return {**outcome, 'number': number, 'factor': factor}


def make_table(outcomes: Iterable[dict[str, Any]]) -> str:
    """Return, for each number, the right answers with it halved, unchanged and doubled."""
    groups: dict[tuple[str, float], list[dict[str, Any]]] = {}
    for outcome in outcomes:
        if 'failed' not in outcome:
            groups.setdefault((outcome['number'], outcome['factor']), []).append(outcome)
    lines = ['| number | value | halved | doubled |', '|---|---|---|---|',
             f'| as they are | | {_counts(groups.get(AS_IT_IS, []))} | |']
    lines += [f'| {name.replace("_", " ")} | {getattr(DECISIONS, name):g} | '
              + ' | '.join(_counts(groups.get((name, factor), [])) for factor in FACTORS)
              + ' |' for name in NUMBERS]
    return '\n'.join(lines) + '\n'


def _counts(outcomes: Sequence[dict[str, Any]]) -> str:
    shares = []
    for row, right in ROWS.items():
        own = [outcome for outcome in outcomes if outcome['row'] == row]
        shares.append(f'{sum(bool(outcome["judged"][right]) for outcome in own)}/{len(own)}')
    return ', '.join(shares)


def main() -> int:
    """Run what is missing, and print the table."""
    parser = scoring_parser(__doc__, 'decisions.jsonl')
    parser.add_argument('--seeds', type=int, default=1)
    parser.add_argument('--first', type=int, default=60)
    parser.add_argument('--recordings', type=Path, default=OUTPUT / 'recordings')
    options = parser.parse_args()
    todo = {f'{case.name} {number} {factor}': (case, number, factor)
            for case in chosen_cases(options.first, options.seeds)
            for number, factor in changes()}
    found = outcomes_of(options, partial(run_changed, recordings=options.recordings), todo,
                        lambda o: f'{o["name"]} {o["number"]} {o["factor"]}',
                        lambda o: f'{o["number"]} x {o["factor"]:g}: {one_line(o)}')
    print('Right of weak effects, of sets of two and three, exactly right of forms that are off, '
          'right of what is in no catalogue, and of nothing missing:\n')
    print(make_table(found))
    return 0


if __name__ == '__main__':
    sys.exit(main())
