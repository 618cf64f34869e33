# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Make problems, enter them, score answers, reveal the truth.

    python -m benchmarks.naming.run make FOLDER --seed 1 --problems 72
    python -m benchmarks.naming.run enter FOLDER [--entrant NAME …] [--minutes 4]
    python -m benchmarks.naming.run score FOLDER [--page benchmarks/results/naming.md]
    python -m benchmarks.naming.run reveal FOLDER PROBLEM

`enter` runs what is missing, or was answered by other code or settings, and can be stopped. An
entrant of one's own puts its answers into FOLDER/answers/NAME/PROBLEM.json and is scored with the
others.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
import traceback
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.naming.entrants import ENTRANTS, PART, Entrant
from benchmarks.naming.generate import Draw, draws, make
from benchmarks.naming.page import write_page
from benchmarks.naming.problems import Answer, Problem, Truth
from benchmarks.naming.scoring import Judged, figures, judge, seconds

PROBLEMS, TRUTH, ANSWERS = 'problems', 'truth', 'answers'
FILES = ('recording.csv', 'model.yaml', 'columns.npz', 'columns.json')  # an answer depends on them


def make_all(folder: Path, seed: int, count: int, workers: int) -> int:
    """Make the problems of a seed that are not there yet; return how many could not be made."""
    (folder / PROBLEMS).mkdir(parents=True, exist_ok=True)
    (folder / TRUTH).mkdir(exist_ok=True)
    todo = [draw for draw in draws(seed, count)
            if not (folder / TRUTH / f'{draw.name}.json').exists()]
    failed = 0
    with ProcessPoolExecutor(workers) as pool:
        jobs = {pool.submit(_make, draw, folder): draw for draw in todo}
        for k, job in enumerate(as_completed(jobs), 1):
            error = job.result()
            failed += bool(error)
            print(f'{k}/{len(todo)} {jobs[job].name} {error or ""}'.rstrip(), flush=True)
    return failed


def _make(draw: Draw, folder: Path) -> str:
    try:
        truth = make(draw, folder / PROBLEMS)
    except Exception:  # counted, and the others are made
        return traceback.format_exc().strip().splitlines()[-1]
    (folder / TRUTH / f'{draw.name}.json').write_text(json.dumps(truth.to_dict(), indent=1))
    return ''


def enter_all(folder: Path, entrants: Mapping[str, Entrant], workers: int,
              minutes: float = np.inf, part: tuple[int, int] = (1, 1)) -> int:
    """Let entrants answer what they have not answered yet as they are now, or a part of it.

    Returns
    -------
    int
        How many answers are still missing: where the time is up no more are begun.
    """
    until = time.monotonic() + 60 * minutes
    keys = {name: entrant.key() for name, entrant in entrants.items()}
    todo = []
    # In an order that mixes robots: what is there when it is stopped is a sample of all.
    files = sorted((folder / TRUTH).glob('*.json'), key=lambda file: file.stem[::-1])
    for file in files[part[0] - 1::part[1]]:
        keys_here = {name: f'{key} {_key_of_problem(folder, file.stem)}'
                     for name, key in keys.items()}
        missing = {name: key for name, key in keys_here.items()
                   if _key_of_answer(_answer_file(folder, name, file.stem)) != key}
        if missing:
            todo.append((file.stem, missing))
    left = sum(len(missing) for _, missing in todo)
    with ProcessPoolExecutor(workers) as pool:
        for job in as_completed([pool.submit(_enter, folder, entrants, problem, missing, until)
                                 for problem, missing in todo]):
            for line in job.result():
                left -= 1
                print(f'{left} left: {line}', flush=True)
    return left


def _enter(folder: Path, entrants: Mapping[str, Entrant], problem: str, missing: Mapping[str, str],
           until: float) -> list[str]:
    asked, said = None, []
    for name, key in missing.items():
        if time.monotonic() > until:
            break
        asked = asked or Problem.read(folder / PROBLEMS / problem)
        start = time.process_time()
        try:
            answer = entrants[name](asked)
        except Exception:  # an entrant that fails has answered nothing, and that counts against it
            answer = Answer('none', error=traceback.format_exc().strip().splitlines()[-1])
        answer = replace(answer, seconds=time.process_time() - start)
        file = _answer_file(folder, name, problem)
        file.parent.mkdir(parents=True, exist_ok=True)
        whole = {**answer.to_dict(), 'key': key}
        partial = file.with_suffix('.part')
        partial.write_text(json.dumps(whole, indent=1))
        partial.rename(file)
        said.append(f'{problem} {name}: {answer.verdict} {answer.error}'.rstrip())
    return said


def _key_of_problem(folder: Path, problem: str) -> str:
    found = hashlib.sha256()
    for name in FILES:
        file = folder / PROBLEMS / problem / name
        found.update(file.read_bytes() if file.exists() else b'')
    return found.hexdigest()[:16]


def _key_of_answer(file: Path) -> str:
    return str(json.loads(file.read_text()).get('key', '')) if file.exists() else ''


def _answer_file(folder: Path, name: str, problem: str) -> Path:
    return folder / ANSWERS / name / f'{problem}.json'


def score_all(folder: Path, answered: bool = False,
              ) -> dict[str, list[tuple[Truth, Answer, Judged]]]:
    """Return every entrant's answers with what is right about them; none counts as silence.

    `answered`: of a run that was stopped, of each entrant what it has answered.
    """
    truths = [Truth.from_dict(json.loads(file.read_text()))
              for file in sorted((folder / TRUTH).glob('*.json'))]
    found: dict[str, list[tuple[Truth, Answer, Judged]]] = {}
    for entrant in sorted(path.name for path in (folder / ANSWERS).glob('*')):
        found[entrant] = []
        for truth in truths:
            file = _answer_file(folder, entrant, truth.problem)
            if file.exists() or not answered:
                answer = (Answer.from_dict(json.loads(file.read_text())) if file.exists()
                          else Answer('none'))
                found[entrant].append((truth, answer, judge(truth, answer)))
    return found


def reveal(folder: Path, problem: str) -> int:
    """Print what was hidden in a problem and what each entrant said of it."""
    file = folder / TRUTH / f'{problem}.json'
    if not file.exists():
        print(f'naming: {file} does not exist; `make` writes it', file=sys.stderr)
        return 2
    print(file.read_text())
    for path in sorted((folder / ANSWERS).glob(f'*/{problem}.json')):
        answer = Answer.from_dict(json.loads(path.read_text()))
        sets = ' | '.join(', '.join(
            e.name + (f'({" ".join(e.drives)})' if e.drives else '') for e in found)
            for found in answer.sets)
        print(f'{path.parent.name}: {answer.verdict} {sets}')
    return 0


def _part(text: str) -> tuple[int, int]:
    number, count = (int(part) for part in text.split('/'))
    if not 1 <= number <= count:
        raise ValueError(text)
    return number, count


def main() -> int:
    """Run a step."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('step', choices=('make', 'enter', 'score', 'reveal'))
    parser.add_argument('folder', type=Path)
    parser.add_argument('problem', nargs='?', help='to reveal')
    parser.add_argument('--seed', type=int, default=1, help='of the problems (default 1, public)')
    parser.add_argument('--problems', type=int, default=72, metavar='N')
    parser.add_argument('--entrant', action='append', choices=sorted(ENTRANTS))
    parser.add_argument('--workers', type=int, default=2)
    parser.add_argument('--minutes', type=float, default=np.inf,
                        help='after which no more answers are begun')
    parser.add_argument('--whole', action='store_true',
                        help='leave out this package without its parts')
    parser.add_argument('--page', type=Path, help='write the table and its picture')
    parser.add_argument('--part', type=_part, default=(1, 1), metavar='K/N',
                        help='of N parts of the problems the K-th, for machines that share them')
    parser.add_argument('--answered', action='store_true',
                        help='score each entrant by what it answered, of a run that was stopped')
    parser.add_argument('--real', type=Path, metavar='FOLDER', help='of real machines, see real.py')
    options = parser.parse_args()
    if options.step == 'make':
        return min(make_all(options.folder, options.seed, options.problems, options.workers), 1)
    if options.step == 'enter':
        chosen = {name: ENTRANTS[name] for name in options.entrant or ENTRANTS
                  if not options.whole or ENTRANTS[name].sort != PART}
        return min(enter_all(options.folder, chosen, options.workers, options.minutes,
                             options.part), 1)
    if options.step == 'reveal':
        return reveal(options.folder, options.problem or '')
    scored = score_all(options.folder, options.answered)
    if options.page:
        there = options.real is not None and options.real.exists()
        real = score_all(options.real, options.answered) if there else {}
        write_page(scored, real, options.page)
    for entrant, answers in scored.items():
        print(entrant, *(f'{name} {rate}' for name, rate in figures(answers).items()),
              f'{seconds(answers):.1f} s', sep='; ')
    return 0


if __name__ == '__main__':
    sys.exit(main())
