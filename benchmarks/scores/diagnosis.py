# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How often `diagnose` is right about physics hidden in recordings.

    python -m benchmarks.scores.diagnosis --quick
    python -m benchmarks.scores.diagnosis --table benchmarks/results/diagnosis.md

Every case's outcome is appended to FILE at once, and cases that are there are not run again: the
run can be stopped and continued, and `--seeds` raised later. The table is made from that file.
`--workers` and `--scheduler` say where cases run, as for `pprs survey`.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
import zlib
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import OUTPUT
from benchmarks.hidden.off_forms import CAN_BE_OFF
from benchmarks.hidden.recordings import IN_CATALOGUE, PINK, Case, load_case, make_case, save_case
from benchmarks.results import write_results
from benchmarks.scores.cases import Each, engine, read_outcomes, run_missing, scoring_parser
from benchmarks.scores.diagnosis_table import judge, make_table
from benchmarks.scores.oracle import consult
from pprs_dynamics.simulation.injection import NOT_IN_CATALOGUE

SNRS = (0.25, 0.5, 1.0, 3.0)
NOISES: tuple[float | str, ...] = (0.0, 0.9, 0.98, 0.997, 0.999, PINK)
SLOW_NOISES = (0.98, 0.997)
WIDTHS = (0.2, 0.5, 2.0, 5.0)
SETS_PER_SEED = 3  # pairs, and triples
SNR_OF_FORMS = 10.0  # so little noise that forms that are 5 to 15 % off are seen
ROWS = ('effects', 'nothing', 'width', 'pairs', 'unknown', 'vibration', 'slow', 'forms')
VIBRATIONS_PER_SEED = 5
# Of what a diagnosis says, this many candidates are kept.
CANDIDATES = 6

Diagnose = Callable[..., Any]


def cases(rows: Iterable[str], seeds: int, nothing: int, snrs: Iterable[float],
          first: int = 0) -> list[Case]:
    """Return the cases of rows of the table from a first seed on, those of one seed together."""
    levels = tuple(snrs)
    drawn, empty = range(first, first + seeds), range(first, first + nothing)
    found: list[Case] = []
    for row in rows:
        if row == 'nothing':
            found += [Case(row, (), s, noise=n) for s in empty for n in NOISES]
        elif row == 'width':
            found += [Case(row, (), s, width=WIDTHS[s % len(WIDTHS)]) for s in empty]
        elif row == 'pairs':
            found += [Case(row, names, s, 0.0) for s in drawn for names in _sets(s)]
        elif row == 'vibration':
            found += [Case(row, ('vibration',), VIBRATIONS_PER_SEED * s + k, snr)
                      for s in drawn for k in range(VIBRATIONS_PER_SEED) for snr in levels
                      if snr >= 1]
        elif row == 'forms':
            found += [Case(row, (name,), s, SNR_OF_FORMS) for s in drawn for name in CAN_BE_OFF]
        elif row == 'slow':
            found += [Case(row, (name,), s, snr, noise) for s in drawn
                      for name in IN_CATALOGUE for snr in levels if snr == 1
                      for noise in SLOW_NOISES]
        else:
            names = IN_CATALOGUE if row == 'effects' else NOT_IN_CATALOGUE
            found += [Case(row, (name,), s, snr) for s in drawn for name in names
                      for snr in levels if row == 'effects' or snr >= 1]
    return sorted(found, key=lambda case: (case.seed, case.width))


def quick_cases() -> list[Case]:
    """Return a few cases of most kinds, for work on the diagnosis."""
    return (cases(('effects', 'unknown'), 1, 0, (1.0,))
            + [Case('nothing', (), s, noise=n) for s, n in enumerate(NOISES[:5])])


def development_cases() -> list[Case]:
    """Return more of them."""
    return (cases(('effects', 'unknown'), 3, 0, (1.0, 3.0))
            + cases(('nothing',), 2, 2, ()))


def diagnose_case(case: Case, diagnose: Diagnose, recordings: Path | None) -> dict[str, Any]:
    """Return a case's outcome: truth, what was said, and how right that is."""
    try:
        content = load_case(save_case(recordings, case)) if recordings else make_case(case)
        model, recording, truth = content
        start = time.perf_counter()
        diagnosis = diagnose(model, [recording])
        seconds = time.perf_counter() - start
        said = diagnosis.to_dict()
        left = {drive: float(error) for drive, error in zip(
            model.drives, np.sqrt(np.nanmean(np.square(diagnosis.remaining), axis=0)),
            strict=True)}
        selection = getattr(diagnosis, 'selection', None)
        oracle = consult(selection, truth) if selection else {}
    except Exception:  # the table counts it, and the run goes on
        return {'name': case.name, 'row': case.row, 'failed': traceback.format_exc()}
    said = {**said, 'candidates': said.get('candidates', [])[:CANDIDATES]}
    outcome = {'name': case.name, 'row': case.row, 'truth': truth, 'said': said,
               'seconds': seconds, 'left': left, 'oracle': oracle}
    return {**outcome, 'judged': judge(outcome)}


def run(todo: Iterable[Case], diagnose: Diagnose, file: Path, each: Each,
        recordings: Path | None = None) -> None:
    """Diagnose cases that are not in a file of outcomes yet; append and print theirs."""
    # One seed's cases come together: they share their motion, which workers keep.
    run_missing(each, partial(diagnose_case, diagnose=diagnose, recordings=recordings),
                {case.name: case for case in todo}, file, lambda outcome: outcome['name'],
                one_line)


def one_line(outcome: dict[str, Any]) -> str:
    """Return a case's outcome for people."""
    if 'failed' in outcome:
        return f'FAILED {outcome["name"]}: {outcome["failed"].strip().splitlines()[-1]}'
    truth, said, judged = outcome['truth'], outcome['said'], outcome['judged']
    case = truth['case']
    hidden = '; '.join(_described(effect) for effect in truth['effects']) or 'nothing'
    named = '; '.join(_described(effect) for effect in said['effects']) or '-'
    sets = ' '.join('{' + ' '.join(names) + '}' for names in said['indistinguishable'])
    depends = ', '.join(f'{d["drive"]} {d["variable"]}' for d in said['depends_on'][:2])
    suspects = ', '.join(suspect['name'] for suspect in said['suspects'])
    parts = [f'{"ok " if judged["good"] else "BAD"} [{case["row"]} {case["seed"]} '
             f'snr {case["snr"]:g} noise {case["noise"]}] {hidden}', f'-> {said["verdict"]}: '
             f'{named}', sets, f'on {depends}' if depends else '',
             f'suspects {suspects}' if suspects else '', f'{outcome["seconds"]:.1f} s']
    return '  '.join(part for part in parts if part)


def _described(effect: dict[str, Any]) -> str:
    drives = effect.get('drives')
    return effect['name'] + (f'({",".join(drives)})' if drives else '')


def _sets(seed: int) -> Iterator[tuple[str, ...]]:
    """Yield pairs and triples of effects, drawn at random."""
    rng = np.random.default_rng((seed, zlib.crc32(b'sets')))
    for size in (2, 3):
        for _ in range(SETS_PER_SEED):
            yield tuple(str(name) for name in rng.choice(sorted(IN_CATALOGUE), size, replace=False))


def _arguments() -> argparse.Namespace:
    parser = scoring_parser(__doc__, 'score.jsonl')
    parser.add_argument('--quick', action='store_true',
                        help='one seed of every effect at SNR 1 and a few of nothing, afresh')
    parser.add_argument('--development', action='store_true',
                        help='three seeds at SNR 1 and 3, and 12 of nothing, afresh')
    parser.add_argument('--seeds', type=int, default=20, help='per effect and level (default 20)')
    parser.add_argument('--first', type=int, default=0, help='first seed (default 0); the first '
                        'three are those that the diagnosis was developed on')
    parser.add_argument('--nothing', type=int, default=200,
                        help='recordings per row with nothing missing (default 200)')
    parser.add_argument('--snr', type=float, nargs='+', default=SNRS)
    parser.add_argument('--only', choices=ROWS, nargs='+', default=ROWS)
    parser.add_argument('--effect', action='append', help='only cases with this one')
    parser.add_argument('--recordings', type=Path,
                        help='folder that keeps the recordings (default: of --quick and '
                        '--development output/recordings, else none)')
    parser.add_argument('--generate', action='store_true', help='make the recordings only')
    parser.add_argument('--table', type=Path, help='write the table of all outcomes in FILE')
    return parser.parse_args()


def main() -> int:
    """Run the cases that are asked for, and print or write their table."""
    options = _arguments()
    small = options.quick or options.development
    todo = (quick_cases() if options.quick else development_cases() if options.development
            else cases(options.only, options.seeds, options.nothing, options.snr, options.first))
    if options.effect:
        todo = [case for case in todo if set(case.effects) & set(options.effect)]
    recordings = options.recordings or (OUTPUT / 'recordings' if small else None)
    if options.generate:
        for case in todo:
            save_case(recordings or OUTPUT / 'recordings', case)
        return 0
    try:
        from pprs_dynamics.inference.diagnosis.diagnose import diagnose
    except ImportError as error:
        print(f'score: there is no diagnosis to judge: {error}', file=sys.stderr)
        return 2
    file = options.file
    if small:
        # Of a diagnosis that changes from run to run, old outcomes are worth nothing.
        file = OUTPUT / ('quick.jsonl' if options.quick else 'development.jsonl')
        file.unlink(missing_ok=True)
    with engine(options) as each:
        run(todo, diagnose, file, each, recordings)
    table = make_table(read_outcomes(file))
    print(table)
    if options.table:
        write_results(options.table, 'Hidden effects in the simulated 3-PPRS', 'make score', table)
    return 0


if __name__ == '__main__':
    sys.exit(main())
