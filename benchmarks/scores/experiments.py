# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How often a designed motion decides an ambiguous verdict; a random motion and a repeat as well.

    python -m benchmarks.scores.experiments --seeds 10 --file experiments.jsonl
    python -m benchmarks.scores.experiments --table experiments.jsonl

Outcomes are appended to FILE as they come, and cases that are there are not run again.
`--workers` and `--scheduler` say where cases run, as for `pprs survey`.

A robot has a hidden effect, numbers off within the model file's tolerances and noisy sensors. It
makes a poor recording of 10 s: up and down only, or slow and small. The effect is weakened until
the diagnosis is ambiguous with the truth among the candidates. Then one run of 20 s is added: the
designed one, a random one that uses the same limits, or the old motion repeated for as long.
*Settled* is a diagnosis of both together that names the truth without a rival. *Open* is one with
a rival, or without an effect.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden.effort_noise import EffortNoise
from benchmarks.hidden.recordings import (
    ROUNDS,
    driven,
    noise_settings,
    simulated,
    tolerant_model,
)
from benchmarks.hidden.strength import changed_values, tolerated_numbers
from benchmarks.scores.cases import outcomes_of, read_outcomes, scoring_parser
from pprs_dynamics import PlatformMotion
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.experiments.motion_design import Motions
from pprs_dynamics.inference.experiments.next_experiment import (
    Question,
    design_experiment,
    question_of,
)
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.joint_motion import JointSeries
from pprs_dynamics.physics.mechanism.paths import HOME, Excitation
from pprs_dynamics.simulation.injection import CLIMATE, Choice, Injection, PlainRobot
from pprs_dynamics.simulation.simulated_robot import SensorSettings

EFFECTS = ('external_wrench', 'base_tilt', 'payload_mass', 'payload_offset', 'link_mass',
           'effort_offset', 'drive_spring', 'effort_gain', 'homing_error', 'coulomb_friction',
           'load_friction', 'viscous_friction', 'quadratic_friction', 'tool_drag',
           'joint_friction', 'joint_spring', 'drive_inertia', 'platform_inertia')
RATE, TOLERANCE, NOISE, CORRELATION = 250.0, 0.04, 0.08, 0.81
OLD, NEW = 10.0, 20.0  # [s]
SCALES = (1.0, 0.35)  # of the effect as drawn, until it is ambiguous
HEAVE, HEAVE_HARMONICS = 0.05, 3  # [m]


class HiddenRobot:
    """A robot with one hidden effect.

    Parameters
    ----------
    name : str
    seed : int
    scale : float
    """

    def __init__(self, name: str, seed: int, scale: float) -> None:
        self.model = tolerant_model(TOLERANCE)
        rng = np.random.default_rng((seed, 2))
        values: dict[str, Any] = dict(self.model.values)
        for key, index in tolerated_numbers(self.model.values):
            values = changed_values(values, key, index, 1 + TOLERANCE * rng.uniform(-1, 1))
        self.values, self.name, self.seed, self.scale = values, name, seed, scale
        self.effect = Choice(name, np.random.default_rng((seed, 3)), scale)

    def record(self, motion: PlatformMotion, run: int) -> Recording:
        """Return a recording of a motion; `run` seeds its noise."""
        plain = PlainRobot(simulated(self.model, self.values), driven(self.model, motion), ROUNDS)
        run_along = Injection(plain, [self.effect], np.random.default_rng((self.seed, CLIMATE)))
        settings = noise_settings(CORRELATION, NOISE)
        noise = EffortNoise(settings, np.random.default_rng((self.seed, 4, run))).samples(
            len(motion))
        return Recording.from_arrays(f'run {run}', run_along.time, SensorSettings().quantised(
            run_along.position), None, run_along.efforts + noise)


@dataclass(frozen=True)
class Start:
    """What there is before an experiment."""

    robot: HiddenRobot
    how: str
    motion: PlatformMotion
    recording: Recording
    question: Question


def times(duration: float) -> np.ndarray:
    """Return the sampling times of a motion."""
    return np.arange(round(duration * RATE)) / RATE


def poor_motions(seed: int) -> dict[str, PlatformMotion]:
    """Return motions of little information: up and down only, and slow and small."""
    parameters = np.zeros((3, JointSeries.size(HEAVE_HARMONICS)))
    parameters[2] = np.random.default_rng((seed, 5)).normal(size=parameters.shape[1])
    parameters[2] *= HEAVE / np.abs(parameters[2]).max()
    time = times(OLD)
    heave = JointSeries(parameters, np.array(HOME), OLD, HEAVE_HARMONICS).motion(time).position
    return {'heave': PlatformMotion.from_poses(time, heave, np.eye(4)[[3] * len(time)]),
            'slow': Excitation(duration=OLD, seed=seed, amplitude=0.025, tilt=0.05,
                               highest_frequency=0.25).motion(time)}


def rivals_of(name: str, question: Question) -> list[str]:
    """Return what a question holds against an effect."""
    return sorted({rival for contest in question.contests if name in contest.truth
                   for rival in contest.rival})


def ambiguous_start(name: str, seed: int) -> Start | None:
    """Return a robot, its poor motion, the recording and the open question, or None."""
    for how, motion in poor_motions(seed).items():
        for scale in SCALES:
            robot = HiddenRobot(name, seed, scale)
            old = robot.record(motion, 0)
            question = question_of(robot.model, [old], Motions(robot.model, NEW),
                                   lambda share: None)
            if rivals_of(name, question):
                return Start(robot, how, motion, old, question)
            if question.kind == 'commission':
                break
    return None


def judged(robot: HiddenRobot, recordings: list[Recording]) -> dict[str, Any]:
    """Return what a diagnosis says, and whether the question is settled by it."""
    try:
        found = diagnose(robot.model, recordings)
    except PprsError as error:
        return {'verdict': 'failed', 'said': str(error)}
    names = [effect.name for effect in found.effects]
    held = [name for group in found.indistinguishable if robot.name in group for name in group]
    verdict = ('open' if held or not names else 'settled' if robot.name in names else 'wrong')
    return {'verdict': verdict, 'names': names, 'held': held, 'said': found.verdict}


def score(name: str, seed: int) -> dict[str, Any] | None:
    """Return how one case goes."""
    start = ambiguous_start(name, seed)
    if start is None:
        return None
    robot, old, question = start.robot, start.recording, start.question
    motions = Motions(robot.model, NEW, 4 * question.information.noise_floor)
    cpu, wall = time.process_time(), time.perf_counter()
    experiment = design_experiment(question, motions, seed)
    cost = {'design_cpu': time.process_time() - cpu, 'design_wall': time.perf_counter() - wall}
    (random,) = motions.drawn(seed + 1000, 1)
    result: dict[str, Any] = {
        'effect': name, 'seed': seed, 'scale': robot.scale, 'motion': start.how,
        'rivals': rivals_of(name, question),
        'promised': [list(pair) for pair in experiment.separates],
        'probability': min((b.probability for b in experiment.contests if b.truth == name),
                           default=1.0),
        'expected_evidence': experiment.expected_evidence,
        'largest_use': max(experiment.limits.values()), **cost}
    grid = times(NEW)
    result['designed'] = judged(robot, [old, robot.record(experiment.motion(grid), 1)])
    result['random'] = judged(robot, [old, robot.record(motions.sampled(random, grid), 2)])
    result['repeat'] = judged(robot, [old, *(robot.record(start.motion, run) for run in (3, 4))])
    return result


def outcome_of(case: tuple[str, int]) -> dict[str, Any]:
    """Return how the case of an effect and a seed goes; no more than these without ambiguity."""
    name, seed = case
    return score(name, seed) or {'effect': name, 'seed': seed}


def table(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the lines of a table."""
    yield '| hidden | with it in the set | runs | designed | random | repeated |'
    yield '|---|---|---|---|---|---|'
    for name in [*dict.fromkeys(row['effect'] for row in rows), 'all']:
        some = [row for row in rows if name in (row['effect'], 'all')]
        rivals = sorted({rival for row in some for rival in row['rivals']})
        counts = [sum(row[how]['verdict'] == 'settled' for row in some)
                  for how in ('designed', 'random', 'repeat')]
        wrong = [sum(row[how]['verdict'] in ('wrong', 'failed') for row in some)
                 for how in ('designed', 'random', 'repeat')]
        cells = [f'{count}' + (f' ({bad} wrong)' if bad else '')
                 for count, bad in zip(counts, wrong, strict=True)]
        yield (f'| {name} | {"" if name == "all" else ", ".join(rivals)} | {len(some)} | '
               f'{" | ".join(cells)} |')
    pairs = [(row['effect'], rival, row['designed']['verdict'] == 'settled')
             for row in rows for rival in row['rivals']]
    different = {frozenset(pair[:2]) for pair in pairs}
    yield (f'{len(different)} different pairs of truth and rival, {len(pairs)} in all, of which '
           f'the designed motion settled {sum(pair[2] for pair in pairs)}')
    promised = [row for row in rows if row['probability'] >= 0.9]
    kept = sum(row['designed']['verdict'] == 'settled' for row in promised)
    yield f'promised with 0.9 or more: {len(promised)}, of which settled {kept}'
    yield f'CPU of a design: {np.median([row["design_cpu"] for row in rows]):.0f} s (median)'


def main() -> None:
    """Run cases, or show the table of those that were run."""
    parser = scoring_parser(__doc__, 'experiments.jsonl')
    parser.add_argument('--effects', default=','.join(EFFECTS))
    parser.add_argument('--seeds', type=int, default=10)
    parser.add_argument('--first-seed', type=int, default=0)
    parser.add_argument('--table', type=Path, help='only show what is in a file')
    options = parser.parse_args()
    if options.table:
        rows = read_outcomes(options.table)
    else:
        cases = {(name, seed): (name, seed)
                 for seed in range(options.first_seed, options.first_seed + options.seeds)
                 for name in options.effects.split(',')}
        rows = outcomes_of(options, outcome_of, cases,
                           lambda row: (row['effect'], row['seed']), str)
    # Of what was not ambiguous there is nothing to settle.
    print('\n'.join(table([row for row in rows if 'designed' in row])))


if __name__ == '__main__':
    main()
