# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How often `diagnose` is right about physics hidden in recordings of a simulated arm.

    python -m benchmarks.scores.arms --model base.yaml --seeds 2 --nothing 10 --table arm_score.md
    python -m benchmarks.scores.arms --model base.yaml --pairs --seeds 20 --nothing 0

By the commands alone: `pprs simulate --model … --effect …`, then `pprs diagnose` of one recording.
Outcomes are appended to FILE as they come, and what is there is not run again. Each seed has a
motion, an effect's drives and sizes, and noise of its own. `--workers` and `--scheduler` say where
cases run, as for `pprs survey`.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
import tempfile
import time
import zlib
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.scores.cases import (
    Each,
    Outcome,
    engine,
    read_outcomes,
    run_missing,
    scoring_parser,
)
from pprs_dynamics import DriveModel
from pprs_dynamics.app.commands.pprs import main as pprs
from pprs_dynamics.physics.effects.laws.coupled_drives import CoupledDrives
from pprs_dynamics.physics.effects.laws.joint_friction import JointFrictionEffect
from pprs_dynamics.physics.effects.laws.link_mass import LinkMass
from pprs_dynamics.simulation.injection import NAMES, links_that_weigh

# Effects of real machines, and what each was taken for before it was in the catalogue.
PAIRS = {
    'gear_efficiency': ('load_friction', 'payload_mass'),
    'lost_motion': ('time_delay', 'hysteresis', 'external_wrench'),
    'stribeck_friction': ('coulomb_friction',),
    'friction_temperature': ('friction_drift',),
    'effort_filter': ('time_delay', 'hysteresis'),
    'elastic_joint': ('eccentric_encoder', 'counterbalance'),
    'eccentric_encoder': ('force_ripple',),
    'counterbalance': ('drive_spring', 'payload_mass'),
    'coupled_drives': ('link_mass', 'payload_mass'),
    'current_gain': ('effort_gain', 'force_ripple'),
    'stop_contact': ('drive_spring', 'force_ripple')}


def run_case(case: tuple[str, int], model: Path, duration: float, beside: Sequence[str] = (),
             ) -> Outcome:
    """Simulate and diagnose the recording of effects, joined by +, and a seed."""
    effect, seed = case
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        run, truth, said = (str(Path(folder) / name) for name in (
            'run.csv', 'truth.json', 'said.json'))
        hidden = [word for name in effect.split('+') if name for word in ('--effect', name)]
        status = pprs(['simulate', '--model', str(model), '--output', run, '--seed', str(seed),
                       '--path-seed', str(seed), '--duration', str(duration), '--json', truth,
                       *beside, *hidden])
        begin = time.process_time()
        status = status or pprs(['diagnose', run, '--model', str(model), '--json', said])
        seconds = time.process_time() - begin
        if status:
            return {'effect': effect, 'seed': seed, 'failed': status}
        found = json.loads(Path(said).read_text())
        return {'effect': effect, 'seed': seed, 'seconds': seconds,
                'truth': json.loads(Path(truth).read_text())['effects'],
                'verdict': found['verdict'], 'sets': found['indistinguishable'],
                'effects': [{key: e[key] for key in ('name', 'drives', 'parameters')}
                            for e in found['effects']]}


def judge(outcome: Outcome) -> dict[str, bool]:
    """Return what is right about an outcome, as `diagnosis_table.judge` has it for the 3-PPRS."""
    named = [effect['name'] for effect in outcome['effects']]
    name = outcome['effect']
    if not name:
        return {'claimed': bool(named) or outcome['verdict'] != 'adequate'}
    if '+' in name:
        true, size = name.split('+'), str(name.count('+') + 1)
        matched = len(true) == len(named) and all(
            name in named or any(name in alike and set(alike) & set(named)
                                 for alike in outcome['sets']) for name in true)
        return {'exact ' + size: sorted(true) == sorted(named), 'matched ' + size: matched}
    in_set = any(name in names for names in outcome['sets'])
    first = named[:1] == [name]
    told = next((effect['drives'] for effect in outcome['effects'] if effect['name'] == name), None)
    true = outcome['truth'][0]['drives']
    judged = {'first_or_set': first or in_set, 'exact': named == [name],
              'wrong_alone': bool(named) and name not in named and not in_set}
    if told is not None and true is not None:
        judged['drives'] = set(told) == set(true)
    return judged


def described(outcome: Outcome) -> str:
    """Return what was hidden and what was said, in a line."""
    if 'failed' in outcome:
        return f'FAILED {outcome["effect"]} {outcome["seed"]}'
    return (f'{outcome["effect"] or "nothing"} {outcome["seed"]} {_on(outcome)} -> '
            f'{outcome["verdict"]}: {_said(outcome) or "-"} {outcome["sets"] or ""} '
            f'{outcome["seconds"]:.0f} s')


def _on(outcome: Outcome) -> str:
    return '; '.join(', '.join(effect['drives'] or ()) for effect in outcome['truth']).strip('; ')


def _said(outcome: Outcome) -> str:
    return '; '.join(e['name'] + (f'({", ".join(e["drives"])})' if e['drives'] else '')
                     for e in outcome['effects'])


def by_effect(told: Sequence[tuple[Outcome, dict[str, bool]]]) -> list[str]:
    """Return a table with a row for each hidden effect, and where its name stood wrongly."""
    singles = [(outcome, judged) for outcome, judged in told if '+' not in outcome['effect']]
    lines = ['', '| hidden | first or in the named set | right joints | claimed where another is '
             'hidden, or nothing |', '|---|---|---|---|']
    for name in sorted({outcome['effect'] for outcome, _ in singles} - {''}):
        own = [judged for outcome, judged in singles if outcome['effect'] == name]
        others = [outcome for outcome, _ in singles if outcome['effect'] != name]
        drives = [judged['drives'] for judged in own if 'drives' in judged]
        wrong = sum(name in [effect['name'] for effect in outcome['effects']] for outcome in others)
        lines.append(f'| `{name}` | {sum(judged["first_or_set"] for judged in own)} of {len(own)} '
                     f'| {f"{sum(drives)} of {len(drives)}" if drives else "-"} | '
                     f'{wrong} of {len(others)} |')
    return lines


def by_pair(found: Sequence[Outcome]) -> str:
    """Return a table in Markdown of each pair: which was named right, and which as the other.

    Right is first or in the named set; as the other, where the other is named and it is not.
    """
    told = [(outcome, judge(outcome)) for outcome in found if 'failed' not in outcome]

    def counted(name: str, other: str) -> str:
        own = [(outcome, judged) for outcome, judged in told if outcome['effect'] == name]
        right = sum(judged['first_or_set'] for _, judged in own)
        taken = sum(other in [effect['name'] for effect in outcome['effects']]
                    and not judged['first_or_set'] for outcome, judged in own)
        return f'{right} of {len(own)} | {taken}'

    lines = ['| hidden | right | as the other | the other | right | as the first |',
             '|---|---|---|---|---|---|']
    lines += [f'| `{name}` | {counted(name, other)} | `{other}` | {counted(other, name)} |'
              for name, others in PAIRS.items() for other in others]
    return '\n'.join(lines) + '\n'


def table(found: Sequence[Outcome]) -> str:
    """Return the table in Markdown, then each effect that was not found, or not alone."""
    told = [(outcome, judge(outcome)) for outcome in found if 'failed' not in outcome]
    lines = ['| figure | goal | found |', '|---|---|---|']
    for text, goal, what in (
            ('true effect first or in the named set', '≥ 98 %', 'first_or_set'),
            ('exactly the true effect, nothing added', '', 'exact'),
            ('a wrong effect alone', '≤ 1 %', 'wrong_alone'),
            ('right joints', '≥ 95 %', 'drives'),
            ('nothing missing: something claimed', '≤ 5 %', 'claimed'),
            ('exact set of two effects', '≥ 85 %', 'exact 2'),
            ('the same, named sets counted', '', 'matched 2'),
            ('exact set of three effects', '≥ 75 %', 'exact 3'),
            ('the same, named sets counted', '', 'matched 3')):
        known = [judged[what] for _, judged in told if what in judged]
        if known:
            lines.append(f'| {text} | {goal} | {sum(known)} of {len(known)} |')
    lines += by_effect(told)
    failed = len(found) - len(told)
    if failed:
        lines.append(f'| refused or failed | 0 | {failed} |')
    lines += ['', '| hidden | on | reported |', '|---|---|---|']
    for outcome, judged in told:
        if judged.get('claimed') or not all(
                right for what, right in judged.items() if what.startswith('exact')):
            lines.append(f'| {outcome["effect"] or "nothing"} | {_on(outcome) or "the robot"} | '
                         f'{outcome["verdict"]}: {_said(outcome) or "nothing"} |')
    return '\n'.join(lines) + '\n'


def todo(model: Path, seeds: range, nothing: range, sets: range, only: Sequence[str] = (),
         ) -> Iterator[tuple[str, int]]:
    """Yield effects that a robot can have and seeds, every effect once before any twice."""
    loaded = DriveModel.load(model)
    robot, structure = loaded.robot, loaded.robot.structure
    has_passive = any(row >= 0 and name not in structure.drives
                      for name, (row, _) in structure.friction_rows.items())
    names = [name for name in NAMES if (has_passive or name != JointFrictionEffect.name)
             and (robot.motors or name != CoupledDrives.name)
             and (links_that_weigh(loaded) or name != LinkMass.name)
             and (not only or name in only)]
    for seed in max(seeds, nothing, key=len):
        if seed in seeds:
            yield from ((name, seed) for name in names)
        if seed in nothing:
            yield '', seed
    for seed in sets:
        rng = np.random.default_rng((seed, zlib.crc32(b'sets')))
        for size in (2, 3):
            yield '+'.join(rng.choice(sorted(names), size, replace=False)), seed


def run(model: Path, seeds: range, nothing: range, sets: range, duration: float, file: Path,
        each: Each, only: Sequence[str] = (), beside: Sequence[str] = ()) -> None:
    """Run the cases that are not in a file of outcomes yet; append and print theirs."""
    run_missing(each, partial(run_case, model=model.resolve(), duration=duration,
                              beside=beside),
                {case: case for case in todo(model, seeds, nothing, sets, only)}, file,
                lambda outcome: (outcome['effect'], outcome['seed']), described)


def main() -> int:
    """Run what is asked for, and print or write the table."""
    parser = scoring_parser(__doc__, 'arm_score.jsonl')
    parser.add_argument('--model', type=Path, required=True, help='model file of an arm')
    parser.add_argument('--seeds', type=int, default=2, help='per effect (default 2)')
    parser.add_argument('--first', type=int, default=0, help='first seed (default 0)')
    parser.add_argument('--nothing', type=int, default=10, help='recordings without (default 10)')
    parser.add_argument('--sets', type=int, default=0, metavar='N',
                        help='pairs, and triples, of effects drawn at random (default 0)')
    parser.add_argument('--only', metavar='NAME', nargs='+', default=(), choices=NAMES,
                        help='effects that are hidden (default: all): a new one beside what it '
                        'might be taken for')
    parser.add_argument('--pairs', action='store_true', help='effects of real machines and what '
                        'each was taken for, thermometers and links recorded whatever is hidden')
    for name, what in (('--thermometers', 'temperatures'), ('--link-encoders', 'links')):
        parser.add_argument(name, action='append_const', dest='beside', const=name, default=[],
                            help=f'record {what} whatever is hidden')
    parser.add_argument('--duration', type=float, default=40.0, help='[s] (default 40)')
    parser.add_argument('--table', type=Path, help='write the table of all outcomes in FILE')
    options = parser.parse_args()
    if options.pairs:
        options.only = sorted({*PAIRS, *(name for others in PAIRS.values() for name in others)})
        options.beside = ['--thermometers', '--link-encoders']
    seeds, nothing, sets = (range(options.first, options.first + count) for count in (
        options.seeds, options.nothing, options.sets))
    with engine(options) as each:
        run(options.model, seeds, nothing, sets, options.duration, options.file, each,
            options.only, options.beside)
    found = read_outcomes(options.file)
    text = table(found) + ('\n' + by_pair(found) if options.pairs else '')
    if options.table:
        options.table.write_text(text)
    else:
        print(text)
    return 0


if __name__ == '__main__':
    sys.exit(main())
