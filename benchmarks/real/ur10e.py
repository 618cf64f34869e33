# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Results on a UR10e: python -m benchmarks.real.ur10e [FOLDER] [--as-far].

A UR10e was measured by S. Mamedov (dynamic_calibration, github.com/shamilmamedov), free and with a
load of 2.805 kg; its recordings are not part of the package. Everything is done by the commands;
what is in FOLDER already is not done again, so that this can be stopped and continued. With
--as-far nothing is run, and the results say what was not measured.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import json
import shutil
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from benchmarks.real.recorded_data import need_data
from benchmarks.results import ROOT, write_results
from benchmarks.scores import arms as arm_score
from benchmarks.scores import cases as cases_on_dask
from pprs_dynamics import DriveModel
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.files.recording import read_recording
from pprs_dynamics.physics.mechanism.description import body_at
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.physics.model.robot_block import inertial_values

matplotlib.use('Agg')
from matplotlib import pyplot

DOCS = ROOT / 'docs'
FITTED = ('free_30s_12harm', 'free_40s_12harm', 'free_50s_12harm')
HELD_OUT, LOADED, FURTHER = 'free_50s_14harm', 'load_50s_14harm', 'free_50s_12harm'
GATE = 'free_40s_12harm'
MASS = 2.805  # [kg], as weighed
HAND = 0.73  # [kg], of a hand that the model carries and the robot does not
GOALS = (2.8, 3.9, 1.7, 0.42, 0.56, 0.40)  # [N m rms], of the base model on a run not fitted
PITCH = np.pi / 101  # [rad]: a harmonic drive ripples twice a turn of its motor
SEEDS, NOTHING, DURATION = 3, 10, 30.0  # of the score on simulated arms
MODEL = '''/**:
  ros__parameters:
    robot:
      urdf: ur10e.urdf
      base: base_link
      tool: tool0
      drives: [shoulder_pan_joint, shoulder_lift_joint, elbow_joint,
               wrist_1_joint, wrist_2_joint, wrist_3_joint]
      gain: [11.976, 11.976, 9.839, 10.763, 10.763, 10.763]       # [N m/A]
      gear_ratio: [101.0, 101.0, 101.0, 101.0, 101.0, 101.0]
'''


# Sections of the results, in order.
SECTIONS = {
    'PROOF': 'Goals', 'ERRORS': 'Errors of the base model, rms of means over 20 to 40 ms [N m]',
    'LOADS': 'Load by the base model of one free run, on the whole loaded run and on its halves',
    'RIPPLE': 'Pitch of the ripple on the free run',
    'ZEROS': 'One number of friction set to 0 in the base model, free run diagnosed',
    'VERDICT': 'Verdict on the free run of another day', 'FREE': 'Effects reported there',
    'SCORE': 'Simulated arm with hidden effects',
}


class Bench:
    """Runs commands in a folder, once each.

    Parameters
    ----------
    folder : Path
    as_far : bool
        Nothing is run.
    """

    def __init__(self, folder: Path, as_far: bool) -> None:
        self.folder, self.as_far = folder, as_far

    def run(self, name: str, *arguments: str) -> dict[str, Any]:
        """Return the JSON of a command, from the folder where it was run before."""
        path = self.folder / f'{name}.json'
        if self.as_far and not path.exists():
            return {}
        if not path.exists():
            print(f'{name}: pprs {" ".join(arguments)}', flush=True)
            said, begin = io.StringIO(), time.process_time()
            with contextlib.redirect_stdout(said), contextlib.chdir(self.folder):
                status = main([*arguments, '--json', f'{name}.tmp.json'])
            if status not in (0, 1):
                sys.exit(f'{name}: status {status}')
            (self.folder / f'{name}.txt').write_text(said.getvalue())
            content = json.loads((self.folder / f'{name}.tmp.json').read_text())
            content['processor_seconds'] = time.process_time() - begin
            (self.folder / f'{name}.tmp.json').unlink()
            path.write_text(json.dumps(content))
        found: dict[str, Any] = json.loads(path.read_text())
        return found

    def said(self, name: str) -> str:
        """Return what a command printed."""
        return (self.folder / f'{name}.txt').read_text()


def file(name: str) -> str:
    """Return the file of a recording."""
    return f'{name}.csv.gz'


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [' | '.join(headings), ' | '.join('---' for _ in headings),
             *(' | '.join(row) for row in rows)]
    return '\n'.join(f'| {line} |' for line in lines)


def without(bench: Bench, base: DriveModel, kind: str, joint: int) -> dict[str, Any]:
    """Return the diagnosis of the base model with one number of friction set to 0."""
    name = f'zero_{kind}_{joint}'
    values = dict(base.values)
    numbers = list(values[f'friction.{kind}'])
    numbers[joint] = 0.0
    values[f'friction.{kind}'] = tuple(numbers)
    write_model(bench.folder / f'{name}.yaml', values, bench.folder / 'base.yaml')
    return bench.run(name, 'diagnose', file(HELD_OUT), '--model', f'{name}.yaml')


def with_hand(base: DriveModel) -> dict[str, Any]:
    """Return the values of the base model with a hand on its tool."""
    hand = body_at(HAND, (0.0, 0.02, 0.045), np.diag([1e-3, 1e-3, 4e-4]))
    inertial = base.robot.with_body('tool0', hand).inertial
    return {**base.values, **{key: tuple(map(float, values)) for key, values in
                              inertial_values(inertial).items()}}


def zero_rows(bench: Bench, base: DriveModel) -> tuple[list[list[str]], int, int]:
    """Return what was named where one number of friction was 0, how often rightly, and first.

    Rightly: first, with a value within 15 %. First: on that joint, with any value.
    """
    rows, right, named = [], 0, 0
    for kind, effect, parameter in (('viscous', 'viscous_friction', 'coefficient'),
                                    ('coulomb', 'coulomb_friction', 'force')):
        for joint, name in enumerate(base.drives):
            truth = base.values[f'friction.{kind}'][joint]
            found = without(bench, base, kind, joint)
            if not found:
                continue
            first = (found['effects'] or [{'name': 'nothing'}])[0]
            value = next((row['parameters'].get(f'{name}.{parameter}', {}).get('value')
                          for row in found['effects'] if row['name'] == effect), None)
            is_first = value is not None and first['name'] == effect
            named += is_first
            right += is_first and abs(value / truth - 1) < 0.15
            rows.append([name, kind, f'{truth:.3g}', first['name'],
                         'not named' if value is None else f'{effect}, {value:.3g}'])
    return rows, right, named


def first_mass(found: dict[str, Any]) -> dict[str, float] | None:
    """Return the mass of a payload that was named first."""
    first = next(iter(found.get('effects', ())), None)
    return first['parameters']['mass'] if first and first['name'] == 'payload_mass' else None


def worded(mass: dict[str, float]) -> str:
    """Return a mass and its interval."""
    return f'{mass["value"]:.3f} ± {2 * mass["std"]:.3f} kg'


def contains_truth(mass: dict[str, float]) -> bool:
    """Return whether the interval contains what the load weighs."""
    return abs(mass['value'] - MASS) <= 2 * mass['std']


def load_rows(bench: Bench) -> tuple[list[list[str]], int, int, int]:
    """Return the load by a base of each free run alone, on the whole run and on its halves.

    And in how many it was first, within 3 %, and within its interval.
    """
    head, *lines = gzip.decompress((bench.folder / file(LOADED)).read_bytes()).splitlines(True)
    half = len(lines) // 2
    for name, part in (('first', lines[:half]), ('second', lines[half:])):
        (bench.folder / f'{name}_half.csv').write_bytes(head + b''.join(part))
    rows, first, near, held = [], 0, 0, 0
    for run in (*FITTED, HELD_OUT):
        bench.run(f'fit_{run}', 'fit', file(run), '--model', 'arm.yaml', '--output', f'{run}.yaml')
        rows.append([f'`{run}`'])
        for part in (file(LOADED), 'first_half.csv', 'second_half.csv'):
            found = bench.run(f'load_{run}_{part.partition(".")[0]}', 'diagnose', part, '--model',
                              f'{run}.yaml')
            mass = first_mass(found)
            if mass is None:
                rows[-1].append((found.get('effects') or [{'name': 'nothing'}])[0]['name'])
                continue
            first += 1
            near += abs(mass['value'] / MASS - 1) < 0.03
            held += contains_truth(mass)
            rows[-1].append(worded(mass))
    return rows, first, near, held


def ripple_rows(found: dict[str, Any]) -> tuple[list[list[str]], int]:
    """Return pitches of ripple with that of the gears, and how many are within 0.5 %."""
    rows, near = [], 0
    for effect in found['effects']:
        if effect['name'] == 'force_ripple':
            for key, number in effect['parameters'].items():
                if key.endswith('.pitch'):
                    off = number['value'] / PITCH - 1
                    near += abs(off) <= 0.005
                    rows.append([key.removesuffix('.pitch'), f'{1e3 * number["value"]:.3f}',
                                 f'{1e3 * PITCH:.3f}', f'{100 * off:+.2f} %'])
    return rows, near


def draw(path: Path, drives: Sequence[str], curves: dict[str, Any], ylabel: str) -> None:
    """Draw one row per joint."""
    figure, axes = pyplot.subplots(len(drives), 1, figsize=(8, 1.5 * len(drives)), sharex=True,
                                   layout='constrained')
    for axis, drive, d in zip(np.atleast_1d(axes), drives, range(len(drives)), strict=True):
        for label, (when, values, colour) in curves.items():
            axis.plot(when, values[:, d], color=colour, lw=0.8, label=label)
        axis.set_ylabel(drive.removesuffix('_joint').replace('_', ' '), fontsize=8)
        axis.axhline(0, color='#1a1a1a', lw=0.5)
    np.atleast_1d(axes)[0].legend(loc='upper right', fontsize=8, ncols=len(curves))
    np.atleast_1d(axes)[-1].set_xlabel('time [s]')
    figure.suptitle(ylabel, fontsize=10)
    figure.savefig(path, dpi=90)
    pyplot.close(figure)


def pictures(bench: Bench) -> None:
    """Draw errors of the base model on a run that was not fitted, and on the loaded run."""
    described, base, found = (DriveModel.load(bench.folder / f'{name}.yaml')
                              for name in ('arm', 'base', 'loaded'))
    curves = {}
    run = read_recording(bench.folder / file(HELD_OUT), base.recorded)
    for label, model, colour in (('URDF', described, '#bbbbbb'), ('base model', base, '#0072B2')):
        residuals, _ = measure_residuals(model, [run])
        curves[label] = residuals.time - residuals.time[0], residuals.error, colour
    draw(DOCS / 'images/arms_base.png', base.drives, curves,
         'measured minus model [N m], free run that was not fitted')
    run = read_recording(bench.folder / file(LOADED), base.recorded)
    curves = {}
    for label, model, colour in (('base model', base, '#D55E00'),
                                 ('with the reported payload', found, '#009E73')):
        residuals, _ = measure_residuals(model, [run])
        curves[label] = residuals.time - residuals.time[0], residuals.error, colour
    draw(DOCS / 'images/arms_load.png', base.drives, curves,
         'measured minus model [N m], with a load that the base model does not contain')


def tell(bench: Bench) -> dict[str, str]:
    """Run everything and return the sections of the results."""
    fit = bench.run('fit', 'fit', *map(file, FITTED), '--model', 'arm.yaml', '--output',
                    'base.yaml', '--validate', file(HELD_OUT))
    load = bench.run('load', 'diagnose', file(LOADED), '--model', 'base.yaml')
    bench.run('adopted', 'adopt', 'payload_mass', file(LOADED), '--model', 'base.yaml', '--output',
              'loaded.yaml')
    free = bench.run('free', 'diagnose', file(HELD_OUT), '--model', 'base.yaml')
    base = DriveModel.load(bench.folder / 'base.yaml')
    if (bench.folder / 'loaded.yaml').exists():
        pictures(bench)
    write_model(bench.folder / 'hand.yaml', with_hand(base), bench.folder / 'base.yaml')
    hand = bench.run('hand', 'diagnose', file(HELD_OUT), '--model', 'hand.yaml')
    zeros, right, first_named = zero_rows(bench, base)
    bench.run('better', 'diagnose', file(FURTHER), '--model', 'base.yaml', '--adopt-all',
              '--output', 'better.yaml', '--validate', file(GATE))
    before, after = (bench.run(f'on_{name}', 'compare', file(HELD_OUT), '--model',
                               f'{name}.yaml') for name in ('base', 'better'))
    ripples, near = ripple_rows(free) if free else ([], 0)
    loads, load_first, load_near, load_held = load_rows(bench)
    count = 3 * len(loads)
    held = fit['held_out']
    mass = next((effect['parameters']['mass'] for effect in load['effects']
                 if effect['name'] == 'payload_mass'), None)
    claimed = {effect['name'] for effect in free.get('effects', ())} & {
        'payload_mass', 'effort_gain'}
    fall = (f'{100 * (1 - after["overall"]["rms"] / before["overall"]["rms"]):.0f} % lower'
            if before and after else 'not measured')
    errors = [[name, f'{fit["error_before"][name]:.3g}', f'{fit["error_after"][name]:.3g}',
               f'{held[name]:.3g}', f'{goal:g}'] for name, goal in
              zip(base.drives, GOALS, strict=True)]
    met = sum(held[name] <= goal for name, goal in zip(base.drives, GOALS, strict=True))
    first = load['effects'][0]['name'] if load['effects'] else 'nothing'
    seconds = sorted(outcome['processor_seconds'] for outcome in (load, free) if outcome)
    value = 'none' if mass is None else (
        f'{worded(mass)} ({100 * (mass["value"] / MASS - 1):+.1f} %, '
        f'{"contains" if contains_truth(mass) else "does not contain"} {MASS} kg)')
    taken = first_mass(hand)
    without_hand = ', '.join(effect['name'] for effect in hand.get('effects', ())) or 'not measured'
    proof = [
        ['the load is named first, mass within 3 %, its interval contains 2.805 kg', 'yes',
         f'{first} first; {value}'],
        ['the same with a base of one free run each, on the whole run and its halves', 'all',
         f'{load_first} of {count} first, {load_near} within 3 %, {load_held} contain it'],
        [f'a hand of {HAND} kg in the model that is not there: first, within 5 %, no zeros', 'yes',
         without_hand if taken is None else
         f'first; {worded(taken)}; all: {without_hand}'],
        ['free run: payload or gain claimed', 'none', ', '.join(sorted(claimed)) or 'none'],
        ['base model on a run not fitted, joints within the goal', '6 of 6', f'{met} of 6'],
        ['the same after `--adopt-all` on another free run, error over all joints',
         '≥ 35 % lower', fall],
        ['one number of friction set to 0: named first, value within 15 %', '≥ 11 of 12',
         f'{right} of {len(zeros)}; {first_named} named first with any value'],
        ['pitch of the ripple within 0.5 % of π/101 rad', '≥ 3 joints', f'{near} joints'],
        ['50 s, six joints, processor time', '≤ 10 s', f'{seconds[0]:.0f} to {seconds[-1]:.0f} s'],
    ]
    if not bench.as_far:
        arm_score.run(bench.folder / 'base.yaml', range(SEEDS), range(NOTHING), range(0), DURATION,
                      bench.folder / 'score.jsonl', cases_on_dask.here)
    outcomes = cases_on_dask.read_outcomes(bench.folder / 'score.jsonl')
    return {
        'SCORE': arm_score.table(outcomes).rstrip() if outcomes else 'Not measured; see below.',
        'PROOF': table(('figure', 'goal', 'found'), proof),
        'ERRORS': table(('joint', 'URDF', 'fitted to', 'not fitted to', 'goal'), errors),
        'ZEROS': table(('joint', 'set to 0', 'was', 'named first', 'and where it is'), zeros),
        'LOADS': table(('base from', 'whole run', 'first half', 'second half'), loads),
        'RIPPLE': table(('joint', 'pitch [mrad]', 'of the gear', 'off'), ripples),
        'FREE': ', '.join(effect['name'] for effect in free.get('effects', ())) or 'not measured',
        'VERDICT': free.get('verdict', 'not measured'),
    }


def make(folder: Path, as_far: bool = False) -> None:
    """Write the results."""
    data = need_data('ur10e', file(LOADED))
    folder.mkdir(parents=True, exist_ok=True)
    for name in (*map(file, {*FITTED, HELD_OUT, LOADED}), 'ur10e.urdf'):
        if not (folder / name).exists():
            shutil.copy(data / name, folder / name)
    (folder / 'arm.yaml').write_text(MODEL)
    found = tell(Bench(folder, as_far))
    write_results('ur10e', 'A UR10e with a load of 2.805 kg', 'python -m benchmarks.real.ur10e',
                  '\n\n'.join(f'## {title}\n\n{found[key]}' for key, title in SECTIONS.items()))


if __name__ == '__main__':
    given = [argument for argument in sys.argv[1:] if argument != '--as-far']
    make(Path(given[0]) if given else Path('output/arms'), '--as-far' in sys.argv)
