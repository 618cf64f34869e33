# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Answers since a reference run for robots of the physics engine, and answers without one.

    python -m benchmarks.scores.reference_robots --model config/hexapod.yaml --effects 30
    python -m benchmarks.scores.reference_robots --model ur_base.yaml --changes --power

In every drive there are hysteresis, ripple and Stribeck friction of forms that the catalogue has
not (`injected_forms` of the simulation), and in every passive joint of a robot with loops dry
friction that turns over otherwise. They are the same on all days. A run on path 0 is the
reference. Others, on `--path`, have noise of their own, and a change. With `--effects` it is an
effect of the catalogue, drawn in turn. With `--changes` it is one of a table, and with `--power`
the same in sizes over the noise. Each is diagnosed since the reference, and every `--both`-th
without it as well.

Outcomes are appended to FILE as they come, and what is there is not run again.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import OUTPUT
from benchmarks.scores.arms import judge
from benchmarks.scores.cases import Outcome, here, read_outcomes, run_missing
from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.robot_block import inertial_values
from pprs_dynamics.simulation.engine import MechanismEngine
from pprs_dynamics.simulation.injected_forms import FORMS, STEEPNESS, JointForm, JointMoment
from pprs_dynamics.simulation.injection import (
    MechanismRun,
    draw_motion,
    noise_like,
    simulate_mechanism,
)

DURATION, REFERENCE_SEED = 20.0, 1000
HEALTHY, SHARE = ('hysteresis', 'force_ripple', 'stribeck_friction'), 0.4  # of a form's size
PASSIVE = 0.02  # of a drive's largest effort, from each passive joint
# Hidden in turn: what changes on a machine, on which the injected and the healthy forms agree.
EFFECTS = ('coulomb_friction', 'viscous_friction', 'payload_mass', 'link_mass', 'drive_spring',
           'effort_offset', 'homing_error', 'drive_inertia', 'load_friction', 'joint_friction')
# Of an arm: number of the model file, drive from the base, and by which share it grows.
SHARES = (('coulomb_friction', 'force', 'friction.coulomb', 4, (0.05, 0.1)),
          ('viscous_friction', 'coefficient', 'friction.viscous', 2, (0.1, 0.3)))
PAYLOAD, DELAY = 0.2, 0.005  # [kg], [s]
OVER_NOISE = (1.5, 2.0, 3.0, 4.0)


@dataclass(frozen=True)
class Change:
    """A change of the machine: name of a case, the effect, and what it is.

    Parameters
    ----------
    name, effect : str
    drive : int
        -1 for all, or the structure.
    key : str
        Of its value in the diagnosis.
    value : float
        nan where it is drawn.
    over_noise : float, optional
        Which rms the value is drawn to have, over the noise's.
    """

    name: str
    effect: str
    drive: int = -1
    key: str = ''
    value: float = np.nan
    over_noise: float = np.nan


class Robot:
    """A robot of the physics engine whose drives rub as no effect of the catalogue does.

    Parameters
    ----------
    model : DriveModel
        All that is known of it.
    duration : float
        Of its runs [s].
    """

    def __init__(self, model: DriveModel, duration: float) -> None:
        self.model, self.duration = model, duration
        self.engine = MechanismEngine(model)
        motion = draw_motion(model, duration, 0)
        self.plain = simulate_mechanism(model, (), REFERENCE_SEED, noise=0.0, duration=duration)
        self.largest = np.abs(self.plain.effort).max(axis=0)
        random = np.random.default_rng(REFERENCE_SEED)
        self.forms: list[tuple[JointForm, int, dict[str, float]]] = []
        for j in range(len(model.drives)):
            for name in HEALTHY:
                drawn = FORMS[name].draw(random, self._moment(motion, self.plain, j))
                drawn[next(iter(drawn))] *= SHARE
                self.forms.append((FORMS[name], j, drawn))

    def _moment(self, motion: JointMotion, run: MechanismRun, joint: int) -> JointMoment:
        return JointMoment.along(motion, joint, run.effort[:, joint], self.largest[joint],
                                 self.model.gear_ratios[joint], np.zeros_like(motion.position))

    def healthy(self, run: MechanismRun) -> Array:
        """Return what no effect explains and was always there, (N, D) [N, N m]."""
        force = self._passive(run.motion)
        for form, j, drawn in self.forms:
            force[:, j] += form.force(drawn, self._moment(run.motion, run, j))
        return force

    @cached_property
    def passive(self) -> dict[str, tuple[float, float]]:
        """Torque and width of turning over of each passive joint that can rub [N m], [rad/s]."""
        structure = self.model.robot.structure
        names = [name for name, (row, _) in structure.friction_rows.items()
                 if row >= 0 and name not in structure.drives]
        closed, found = self.engine.closed(self.plain.motion), {}
        for name in names:
            dof = self.engine.state.dof(name)
            felt = np.abs(closed.rates[:, dof]).max(axis=0)
            d = int(np.argmax(felt))
            found[name] = (PASSIVE * float(self.largest[d] / felt[d]),
                           STEEPNESS * float(np.abs(closed.velocity[:, dof]).max()))
        return found

    def _passive(self, motion: JointMotion) -> Array:
        found = np.zeros_like(motion.position)
        if not self.passive:
            return found
        closed = self.engine.closed(motion)
        for name, (torque, width) in self.passive.items():
            dof = self.engine.state.dof(name)
            rate = closed.velocity[:, dof]
            found += (torque * rate / np.hypot(rate, width))[:, None] * closed.rates[:, dof]
        return found

    def noise(self) -> Array:
        """Return the noise of each drive, (D,) [N, N m]: half a percent of its largest effort."""
        return 0.005 * self.largest

    def sized(self, change: Change) -> float:
        """Return the value of a change."""
        if np.isnan(change.over_noise):
            return change.value
        motion, d = self.plain.motion, change.drive
        if change.effect == 'payload_mass':
            pull = self._changed(replace(change, value=1.0, over_noise=np.nan))
            clean = simulate_mechanism(pull, (), 0, noise=0.0, duration=self.duration)
            unit = float((root_mean_square(clean.effort - self.plain.effort)
                          / self.noise()).max())
            return change.over_noise / unit
        v = motion.velocity[:, d]
        law = v if change.effect == 'viscous_friction' else np.tanh(
            v / np.asarray(self.model.reversal.velocity)[d])
        return change.over_noise * float(self.noise()[d]) / float(root_mean_square(law))

    def _changed(self, change: Change) -> DriveModel:
        """Return the machine after a change of its model's numbers."""
        values = dict(self.model.values)
        for effect, _, key, _, _ in SHARES:
            if effect == change.effect:
                numbers = list(values[key])
                numbers[change.drive] += change.value
                values[key] = tuple(numbers)
        if change.effect == 'payload_mass':
            robot = self.model.robot
            tool = robot.structure.tool
            point = change.value * np.array([1.0, *np.zeros(9)])
            values.update({key: tuple(map(float, given)) for key, given in inertial_values(
                robot.with_body(tool, point).inertial).items()})
        changed = DriveModel.from_parameters(values, self.model.source)
        return changed

    def record(self, change: Change, seed: int, path: int,
               ) -> tuple[Recording, list[dict[str, Any]]]:
        """Return a run after a change, its noise of a seed, and what is true of it."""
        drawn = np.isnan(change.value) and np.isnan(change.over_noise) and change.effect
        truth: list[dict[str, Any]] = []
        if drawn:
            run = simulate_mechanism(self.model, (change.effect,), seed, noise=0.0,
                               duration=self.duration, path_seed=path)
            truth = [dict(effect) for effect in run.effects]
        else:
            change = replace(change, value=self.sized(change))
            run = simulate_mechanism(self._changed(change), (), seed, noise=0.0,
                               duration=self.duration, path_seed=path)
            if change.effect:
                truth = [{'name': change.effect, 'parameters': {change.key: change.value},
                          'drives': [self.model.drives[change.drive]] if change.drive >= 0
                          else None}]
        effort, time_ = run.effort + self.healthy(run), run.motion.time
        assert time_ is not None
        if change.effect == 'time_delay':
            effort = np.stack([np.interp(time_ - change.value, time_, curve) for curve in effort.T],
                              axis=1)
        noise = noise_like(np.random.default_rng((seed, 1)), effort.shape)
        return Recording.from_arrays(
            f'run_{seed}', time_, run.position, None, effort + noise * self.noise(),
            self.model.drives), truth


def changes(model: DriveModel, kinds: Sequence[str], effects: int, seeds: int,
            ) -> Iterator[tuple[Change, int]]:
    """Yield changes and seeds."""
    for k in range(effects):
        yield Change(f'effect {EFFECTS[k % len(EFFECTS)]}', EFFECTS[k % len(EFFECTS)]), k
    for seed in range(max(1, effects // 3) if effects else 0):
        yield Change('nothing', '', value=0.0), 100 + seed
    for seed in range(seeds):
        if 'changes' in kinds:
            yield Change('nothing', '', value=0.0), 100 + seed
            for effect, key, number, drive, shares in SHARES:
                own = float(model.values[number][drive])
                name = f'{model.drives[drive]}.{key}'
                for share in shares:
                    yield Change(f'{effect} + {share:.0%}', effect, drive, name,
                                 share * own), 200 + seed
            yield Change(f'payload {PAYLOAD} kg', 'payload_mass', -1, 'mass', PAYLOAD), 200 + seed
            yield Change(f'delay {1e3 * DELAY:g} ms', 'time_delay', -1, '', DELAY), 200 + seed
        if 'power' in kinds:
            for size in OVER_NOISE:
                for effect, key, _, drive, _ in SHARES:
                    yield Change(f'{effect} SNR {size:g}', effect, drive,
                                 f'{model.drives[drive]}.{key}', over_noise=size), 300 + seed
                yield Change(f'payload SNR {size:g}', 'payload_mass', -1, 'mass',
                             over_noise=size), 300 + seed


def told(found: Diagnosis, seconds: float) -> dict[str, Any]:
    """Return what a diagnosis says, for a file."""
    content = found.to_dict()
    return {'verdict': content['verdict'], 'sets': content['indistinguishable'],
            'seconds': seconds, 'reference': content.get('reference'),
            'effects': [{key: effect[key] for key in ('name', 'drives', 'parameters')}
                        for effect in content['effects']]}


def outcome_of(robot: Robot, reference: Reference, change: Change, seed: int, path: int,
               both: bool) -> Outcome:
    """Return the answers on a change with a reference and, on request, without."""
    run, truth = robot.record(change, seed, path)
    found: Outcome = {'name': change.name, 'effect': change.effect, 'seed': seed, 'path': path,
                      'truth': truth}
    for key, given in (('new', reference), ('old', None))[:1 + both]:
        begin = time.process_time()
        found[key] = told(diagnose(robot.model, [run], reference=given),
                          time.process_time() - begin)
    return found


def judged(outcome: Outcome, key: str) -> dict[str, float]:
    """Return what is right about one of the two answers."""
    since = {**outcome, **outcome[key]}
    names = [effect['name'] for effect in since['effects']]
    found = dict(judge({**since, 'truth': since['truth'] or [{'drives': None}]}))
    found['false'] = sum(name != outcome['effect'] for name in names)
    if not outcome['effect']:
        return {'adequate': not found['claimed'], 'false': found['false']}
    true = outcome['truth'][0]
    if names[:1] == [outcome['effect']]:
        for parameter, value in true['parameters'].items():
            said = since['effects'][0]['parameters'].get(parameter)
            if said and said.get('std') is not None and np.isscalar(value):
                found['holds'] = abs(said['value'] - value) <= 2 * said['std']
    return found


def described(outcome: Outcome) -> str:
    """Return what was hidden and what was said, in a line."""
    return f'{outcome["name"]} {outcome["seed"]} path {outcome["path"]}: ' + '; '.join(
        f'{key}: {outcome[key]["verdict"]} '
        + (', '.join(effect['name'] for effect in outcome[key]['effects']) or '-')
        + f' {outcome[key]["seconds"]:.0f} s' for key in ('new', 'old') if key in outcome)


def table(found: Sequence[Outcome]) -> str:
    """Return a row for each change: of both answers, how often what is first, alone, and so on."""
    lines = ['| change | runs | | first | first or in the named set | alone | holds | beside it |',
             '|---|---|---|---|---|---|---|---|']
    names = list(dict.fromkeys((outcome['path'], outcome['name']) for outcome in found))
    for path, name in names:
        for key, label in (('new', 'since the reference'), ('old', 'without')):
            own = [outcome for outcome in found
                   if (outcome['path'], outcome['name']) == (path, name) and key in outcome]
            if not own:
                continue
            right = [judged(outcome, key) for outcome in own]
            first = sum([effect['name'] for effect in o[key]['effects']][:1] == [o['effect']]
                        for o in own)
            cells = [first if own[0]['effect'] else sum(outcome['adequate'] for outcome in right)]
            for what in ('first_or_set', 'exact', 'holds'):
                known = [outcome[what] for outcome in right if what in outcome]
                cells.append(f'{sum(known)} of {len(known)}' if known else '')
            cells.append(f'{sum(outcome["false"] for outcome in right):g}')
            lines.append(f'| {name}{f", path {path}" if path else ""} | {len(own)} | {label} | '
                         + ' | '.join(map(str, cells)) + ' |')
    return '\n'.join(lines)


def main() -> int:
    """Run what is asked for, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--model', type=Path, required=True)
    parser.add_argument('--effects', type=int, default=0, help='recordings with one of the '
                        'catalogue hidden; a third as many with nothing')
    parser.add_argument('--changes', action='append_const', dest='kinds', const='changes')
    parser.add_argument('--power', action='append_const', dest='kinds', const='power')
    parser.add_argument('--seeds', type=int, default=1)
    parser.add_argument('--path', type=int, default=0)
    parser.add_argument('--both', type=int, default=1, metavar='N',
                        help='diagnose every N-th without the reference, too (default: each)')
    parser.add_argument('--duration', type=float, default=DURATION)
    parser.add_argument('--file', type=Path)
    options = parser.parse_args()
    model = DriveModel.load(options.model)
    robot = Robot(without_reference(model), options.duration)
    file = options.file or OUTPUT / f'reference_{options.model.stem}.jsonl'
    reference = Reference.of(robot.model, [robot.record(
        Change('nothing', '', value=0.0), REFERENCE_SEED, 0)[0]])
    cases = {(change.name, seed, options.path): (change, seed, options.path,
                                                 k % options.both == 0)
             for k, (change, seed) in enumerate(changes(
                 robot.model, options.kinds or (), options.effects, options.seeds))}
    run_missing(here, lambda case: outcome_of(robot, reference, *case), cases, file,
                lambda outcome: (outcome['name'], outcome['seed'], outcome['path']), described)
    print(table(read_outcomes(file)))
    return 0


def without_reference(model: DriveModel) -> DriveModel:
    """Return a model that names no reference run."""
    values = {key: value for key, value in model.values.items()
              if key.partition('_')[0] != 'reference'}
    plain = DriveModel.from_parameters(values, model.source)
    return plain


if __name__ == '__main__':
    sys.exit(main())
