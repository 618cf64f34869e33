# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Make problems, enter them, score answers, reveal the truth.

    python -m benchmarks.naming.run make FOLDER --seed 1 --problems 60
    python -m benchmarks.naming.run enter FOLDER [--entrant NAME …]
    python -m benchmarks.naming.run score FOLDER [--page docs/benchmark.md]
    python -m benchmarks.naming.run reveal FOLDER PROBLEM

`enter` runs what is missing and can be stopped. An entrant of one's own puts its answers into
FOLDER/answers/NAME/PROBLEM.json and is scored with the others.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from benchmarks.naming.entrants import ENTRANTS
from benchmarks.naming.generate import Draw, draws, make
from benchmarks.naming.page import write_page
from benchmarks.naming.problems import Answer, Problem, Truth
from benchmarks.naming.scoring import Judged, figures, judge, seconds

PROBLEMS, TRUTH, ANSWERS = 'problems', 'truth', 'answers'


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


def enter_all(folder: Path, names: list[str], workers: int) -> int:
    """Let entrants answer what they have not answered yet; return how often one failed."""
    todo = [(name, truth.stem) for truth in sorted((folder / TRUTH).glob('*.json'))
            for name in names if not _answer_file(folder, name, truth.stem).exists()]
    failed = 0
    with ProcessPoolExecutor(workers) as pool:
        jobs = {pool.submit(_enter, folder, name, problem): (name, problem)
                for name, problem in todo}
        for k, job in enumerate(as_completed(jobs), 1):
            failed += bool(job.result())
            print(f'{k}/{len(todo)} {" ".join(jobs[job])} {job.result()}'.rstrip(), flush=True)
    return failed


def _enter(folder: Path, name: str, problem: str) -> str:
    try:
        asked = Problem.read(folder / PROBLEMS / problem)
        start = time.process_time()
        answer = ENTRANTS[name](asked)
        answer = Answer(answer.verdict, answer.sets, time.process_time() - start)
    except Exception:  # an entrant that fails has answered nothing, and that counts against it
        return traceback.format_exc().strip().splitlines()[-1]
    file = _answer_file(folder, name, problem)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(answer.to_dict(), indent=1))
    return ''


def _answer_file(folder: Path, name: str, problem: str) -> Path:
    return folder / ANSWERS / name / f'{problem}.json'


def score_all(folder: Path) -> dict[str, list[tuple[Truth, Answer, Judged]]]:
    """Return every entrant's answers with what is right about them; none counts as silence."""
    truths = [Truth.from_dict(json.loads(file.read_text()))
              for file in sorted((folder / TRUTH).glob('*.json'))]
    found = {}
    for entrant in sorted(path.name for path in (folder / ANSWERS).iterdir()):
        scored = []
        for truth in truths:
            file = _answer_file(folder, entrant, truth.problem)
            answer = (Answer.from_dict(json.loads(file.read_text())) if file.exists()
                      else Answer('none'))
            scored.append((truth, answer, judge(truth, answer)))
        found[entrant] = scored
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
            one.name + (f'({" ".join(one.drives)})' if one.drives else '') for one in found)
            for found in answer.sets)
        print(f'{path.parent.name}: {answer.verdict} {sets}')
    return 0


def main() -> int:
    """Run a step."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('step', choices=('make', 'enter', 'score', 'reveal'))
    parser.add_argument('folder', type=Path)
    parser.add_argument('problem', nargs='?', help='to reveal')
    parser.add_argument('--seed', type=int, default=1, help='of the problems (default 1, public)')
    parser.add_argument('--problems', type=int, default=24, metavar='N')
    parser.add_argument('--entrant', action='append', choices=sorted(ENTRANTS))
    parser.add_argument('--workers', type=int, default=2)
    parser.add_argument('--page', type=Path, help='write the table and its picture')
    options = parser.parse_args()
    if options.step == 'make':
        return min(make_all(options.folder, options.seed, options.problems, options.workers), 1)
    if options.step == 'enter':
        return min(enter_all(options.folder, options.entrant or list(ENTRANTS), options.workers), 1)
    if options.step == 'reveal':
        return reveal(options.folder, options.problem or '')
    scored = score_all(options.folder)
    if options.page:
        write_page(scored, options.page)
    for entrant, answers in scored.items():
        print(entrant, *(f'{name} {rate}' for name, rate in figures(answers).items()),
              f'{seconds(answers):.1f} s', sep='; ')
    return 0


if __name__ == '__main__':
    sys.exit(main())
