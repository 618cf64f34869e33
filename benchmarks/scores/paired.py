# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

r"""Two versions of the diagnosis on the same small recordings: what became better, and what worse.

    python -m benchmarks.scores.paired FOLDER --make --seed 41 --count 60
    python -m benchmarks.scores.paired FOLDER --make --seed 71 --count 120 --single \
        --robots 3-PPRS hexapod delta arm
    python -m benchmarks.scores.paired FOLDER --answers old.jsonl      # PYTHONPATH: the old version
    python -m benchmarks.scores.paired FOLDER --answers new.jsonl      # and the new one
    python -m benchmarks.scores.paired FOLDER --beside old.jsonl new.jsonl

Problems of the naming benchmark with more sets of effects and forms that are off, cut to 20 s.
Answers are appended one by one; a run can be stopped and continued.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import zlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden.off_forms import CAN_BE_OFF
from benchmarks.naming.generate import NOISES, SNRS, STRONG, Draw, write_problem
from benchmarks.naming.robots import hidden_names
from benchmarks.scores.cases import read_outcomes
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.measurement.files.recording import read_recording
from pprs_dynamics.physics.model.drive_model import DriveModel

SECONDS = 20.0  # of each recording
KINDS = ('two', 'form', 'single', 'three', 'unknown', 'two', 'nothing', 'form', 'single', 'three')
ROBOTS = ('3-PPRS', 'arm', 'axis')


def draws(seed: int, count: int, kinds: Sequence[str] = KINDS,
          robots: Sequence[str] = ROBOTS) -> Iterator[Draw]:
    """Yield problems of a seed, kinds and robots in turn."""
    rng = np.random.default_rng((seed, zlib.crc32(b'paired')))
    for k in range(count):
        kind, robot = kinds[k % len(kinds)], robots[(k + k // len(kinds)) % len(robots)]
        names = sorted(set(hidden_names(robot)) & set(CAN_BE_OFF) if kind == 'form'
                       else hidden_names(robot))
        size = {'nothing': 0, 'unknown': 0, 'two': 2, 'three': 3}.get(kind, 1)
        if robot == 'axis' and size > 1:
            size, kind = 1, 'single'
        chosen = tuple(str(name) for name in rng.choice(names, size, replace=False))
        snr = float(rng.choice(SNRS))
        snr = max(snr, STRONG if kind in ('form', 'unknown') else 1.0 if size > 1 else 0.0)
        yield Draw(robot, kind, chosen, 0.0 if kind == 'nothing' else snr,
                   str(rng.choice(NOISES)), int(rng.integers(2 ** 31)))


def make(folder: Path, seed: int, found: Iterable[Draw]) -> None:
    """Write the recordings, models and truths that a folder does not have."""
    for number, draw in enumerate(found):
        target = folder / f'{seed}_{number:03d}'
        if not (target / 'truth.json').exists():
            truth = write_problem(draw, target, SECONDS)
            (target / 'truth.json').write_text(json.dumps({
                'kind': draw.kind, 'robot': draw.robot, 'snr': draw.snr, 'noise': draw.noise,
                'names': truth.names}))
            print(target.name, draw, flush=True)


def answer(problem: Path) -> dict[str, Any]:
    """Return what is said of a problem."""
    model = DriveModel.load(problem / 'model.yaml')
    recording = read_recording(problem / 'recording.csv', model.drives)
    start = time.process_time()
    said = diagnose(model, [recording]).to_dict()
    return {'name': problem.name, 'seconds': time.process_time() - start, 'said': said}


def grade(truth: dict[str, Any], said: dict[str, Any]) -> int:
    """Return how right an answer is: 3 exactly, 2 in doubt of it, 1 in part, 0 not at all."""
    told, true = sorted(effect['name'] for effect in said['effects']), sorted(truth['names'])
    if truth['kind'] == 'nothing':
        return 3 if said['verdict'] == 'adequate' else 0
    if truth['kind'] == 'unknown':
        return 3 if said['verdict'] == 'unknown' and not told else (
            2 if said['verdict'] == 'unknown' else 0)
    if told == true:
        return 3 if said['verdict'] == 'effect' else 2
    rivals = [set(names) for names in said['indistinguishable']]
    if len(told) == len(true) and all(
            name in told or any(name in rival for rival in rivals) for name in true):
        return 2
    return 1 if set(told) <= set(true) and told else 0


def beside(folder: Path, before: Path, after: Path) -> None:
    """Print both answers to every problem where they differ, and the counts."""
    old, new = ({o['name']: o for o in read_outcomes(file)} for file in (before, after))
    counts = {'worse': 0, 'same': 0, 'better': 0}
    exact, seconds = np.zeros(2, dtype=int), np.zeros(2)
    for name in sorted(set(old) & set(new)):
        truth = json.loads((folder / name / 'truth.json').read_text())
        grades = [grade(truth, outcomes[name]['said']) for outcomes in (old, new)]
        seconds += [outcomes[name]['seconds'] for outcomes in (old, new)]
        exact += np.array(grades) == 3
        told = [_said(outcomes[name]['said']) for outcomes in (old, new)]
        key = 'same' if grades[0] == grades[1] else 'better' if grades[1] > grades[0] else 'worse'
        counts[key] += 1
        if told[0] != told[1]:
            print(f'{key:6} {name} {truth["robot"]} {truth["kind"]} snr {truth["snr"]:g} '
                  f'{truth["noise"]}: {", ".join(truth["names"])}\n    {told[0]}\n    {told[1]}')
    print(f'{sum(counts.values())} problems: {counts}; exact {exact.tolist()}; '
          f'processor time {seconds.round(1).tolist()} s')


def _said(said: dict[str, Any]) -> str:
    named = ', '.join(effect['name'] for effect in said['effects']) or '-'
    rivals = '; '.join(' ~ '.join(names) for names in said['indistinguishable'])
    return f'{said["verdict"]}: {named}' + (f' ({rivals})' if rivals else '')


def main() -> int:
    """Make problems, answer them, or compare two files of answers."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folder', type=Path, help='of the problems')
    parser.add_argument('--make', action='store_true', help='write them')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--count', type=int, default=60)
    parser.add_argument('--single', action='store_true', help='one effect in each')
    parser.add_argument('--robots', nargs='+', default=ROBOTS)
    parser.add_argument('--answers', type=Path, metavar='FILE', help='append answers to FILE')
    parser.add_argument('--most', type=int, default=10 ** 6, help='problems to answer in this run')
    parser.add_argument('--beside', type=Path, nargs=2, metavar=('OLD', 'NEW'))
    options = parser.parse_args()
    if options.make:
        kinds = ('single',) * len(KINDS) if options.single else KINDS
        make(options.folder, options.seed,
             draws(options.seed, options.count, kinds, options.robots))
    if options.answers:
        done = {outcome['name'] for outcome in read_outcomes(options.answers)}
        todo = [folder for folder in sorted(options.folder.iterdir()) if folder.name not in done
                and (folder / 'truth.json').exists()]
        for problem in todo[:options.most]:
            outcome = answer(problem)
            with options.answers.open('a') as stream:
                stream.write(json.dumps(outcome) + '\n')
            print(problem.name, _said(outcome['said']), f'{outcome["seconds"]:.1f} s', flush=True)
    if options.beside:
        beside(options.folder, *options.beside)
    return 0


if __name__ == '__main__':
    sys.exit(main())
