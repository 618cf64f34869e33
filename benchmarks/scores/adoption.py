# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How good a model gets when what `pprs` finds is added to it, from files to files.

    python -m benchmarks.scores.adoption 24

Each case hides a random effect in the simulated robot and records two motions. `pprs diagnose
--adopt-all` sees the first recording; the error of the model it writes is taken on the second,
with that of the best fit of the hidden effect's own form. Then `pprs adopt` is asked for an
effect that is not there, which it must refuse. Outcomes are appended to FILE as they come, and
cases that are there are not run again. `--workers` and `--scheduler` say where cases run, as for
`pprs survey`.
"""

from __future__ import annotations

import copy
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden import recordings as hidden_recordings
from benchmarks.hidden.effort_noise import EffortNoise
from benchmarks.hidden.recordings import IN_CATALOGUE, Case, Scene, noise_settings
from benchmarks.hidden.strength import Whitening
from benchmarks.scores.cases import outcomes_of, scoring_parser
from pprs_dynamics import DriveModel
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.reconstruction import reconstruct
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.simulation.injection import Choice

OTHER_MOTION = 1000  # between the seeds of the two motions
GOOD = 1.1  # error over that of the best fit of the effect's own form
WANTED = 0.95  # of the cases
TOLERANCE_SPREAD = 3 ** -0.5  # standard deviation of what is uniform within a tolerance


class Robot:
    """One robot with a hidden effect, on two motions.

    Parameters
    ----------
    case : Case
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.place = hidden_recordings.scene(case.seed, case.width, case.duration)
        drawn = [hidden_recordings._draw(case, self.place, name) for name in case.effects]
        self.effects: list[Choice] = [d.effect for d in drawn]
        self.noise = min([d.noise for d in drawn], default=hidden_recordings.NOISE)
        self.other = self.place.on_motion(case.seed + OTHER_MOTION)

    @property
    def model(self) -> DriveModel:
        """What is known of it."""
        return self.place.model

    def recordings(self) -> tuple[Recording, Recording]:
        """Return what its sensors say on both motions."""
        return self._recording(self.place, 'first'), self._recording(self.other, 'second')

    def _recording(self, place: Scene, name: str) -> Recording:
        settings = noise_settings(self.case.noise, self.noise)
        rng = self.case.rng(f'noise {name} {self.case.name}')
        return place.recording(name, self.effects,
                               EffortNoise(settings, rng).samples(len(place.time)))

    def best_error(self, first: Recording, second: Recording) -> float:
        """Return the error on the second motion of the effect's own form, fitted on the first.

        The scale of the true effect's forces and the robot's numbers, within their tolerances,
        are fitted by least squares under the true noise.
        """
        (error, columns), (other, others) = (
            self._side(place, recording)
            for place, recording in ((self.place, first), (self.other, second)))
        settings = noise_settings(self.case.noise, self.noise)
        white = Whitening(settings, self.place.block)
        y = white(error).ravel()
        rows = np.stack([white(column).ravel() for column in columns])
        prior = np.full(len(rows), TOLERANCE_SPREAD ** -2)
        prior[:len(self.effects)] = 0.0
        found = np.linalg.solve(rows @ rows.T + np.diag(prior), rows @ y)
        left = other - np.einsum('k,knd->nd', found, others)
        return float(np.sqrt(np.nanmean(left ** 2)))

    def _side(self, place: Scene, recording: Recording) -> tuple[np.ndarray, np.ndarray]:
        """Return the model's error, and what explains it, at the same samples."""
        found = reconstruct(self.model, recording)
        index = np.searchsorted(recording.time, found.time - 0.5 / hidden_recordings.RATE)
        place = copy.copy(place)
        vars(place).pop('_columns', None)
        place.treat = lambda values: found.treat(values[index])
        residuals, _ = measure_residuals(self.model, [recording])
        return residuals.error, np.concatenate((
            [place.contribution(effect) for effect in self.effects], place._columns))


def pprs(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command-line tool."""
    program = Path(sys.executable).parent / 'pprs'
    return subprocess.run([str(program), *arguments], capture_output=True, text=True)


def run_case(case: Case, wrong: str) -> dict[str, Any]:
    """Return the outcome of one case."""
    robot = Robot(case)
    first, second = robot.recordings()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_model(folder / 'model.yaml', robot.model.values)
        write_recording(folder / 'first.csv', first)
        write_recording(folder / 'second.csv', second)
        common = (str(folder / 'first.csv'), '--model', str(folder / 'model.yaml'))
        loop = pprs('diagnose', *common, '--adopt-all', '--output', str(folder / 'new.yaml'),
                    '--json', str(folder / 'loop.json'))
        written = (folder / 'new.yaml').exists()
        errors = [_error(folder / file, second) if (folder / file).exists() else float('nan')
                  for file in ('model.yaml', 'new.yaml')]
        said = json.loads((folder / 'loop.json').read_text()) if (
            folder / 'loop.json').exists() else {}
        refused = pprs('adopt', wrong, *common, '--output', str(folder / 'wrong.yaml'),
                       '--json', str(folder / 'wrong.json'))
        reason = json.loads((folder / 'wrong.json').read_text())['reason'] if (
            folder / 'wrong.json').exists() else refused.stderr.strip()
    best = robot.best_error(first, second)
    adoption = said.get('adoption', {})
    return {'name': case.name, 'seed': case.seed, 'hidden': list(case.effects),
            'adopted': [step['effect'] for step in adoption.get('steps', [])
                        if step['adopted']],
            'ended': adoption.get('ended', loop.stderr.strip()), 'status': loop.returncode,
            'given': errors[0], 'error': errors[1] if written else errors[0], 'best': best,
            'wrong': wrong, 'wrong_status': refused.returncode, 'wrong_reason': reason}


def outcome_of(drawn: tuple[Case, str]) -> dict[str, Any]:
    """Return the outcome of a case and a wrong effect."""
    return run_case(*drawn)


def _error(model: Path, recording: Recording) -> float:
    error = measure_residuals(DriveModel.load(model), [recording])[0].error
    return float(np.sqrt(np.nanmean(error ** 2)))


def draw_cases(count: int, first: int, snr: float, duration: float) -> list[tuple[Case, str]]:
    """Return cases, each with a wrong effect: every effect in turn, then again."""
    found = []
    names = sorted(IN_CATALOGUE)
    order = np.random.default_rng(first).permutation(len(names))
    for number in range(count):
        hidden = names[order[number % len(names)]]
        case = Case('effects', (hidden,), first + number, snr, duration=duration)
        others = sorted(set(catalogue()) - {hidden})
        found.append((case, str(case.rng('wrong').choice(others))))
    return found


def one_line(outcome: dict[str, Any]) -> str:
    """Return an outcome for people."""
    ratio = outcome['error'] / outcome['best']
    refused = 'refused' if outcome['wrong_status'] == 1 else f'STATUS {outcome["wrong_status"]}'
    return (f'{"ok " if ratio <= GOOD else "BAD"} {outcome["seed"]} {outcome["hidden"][0]}: '
            f'{" ".join(outcome["adopted"]) or "-"} ({outcome["ended"]}), error '
            f'{outcome["given"]:.4f} -> {outcome["error"]:.4f} N, best {outcome["best"]:.4f}, '
            f'ratio {ratio:.3f}; {outcome["wrong"]} {refused}')


def summary(outcomes: Sequence[dict[str, Any]]) -> str:
    """Return the shares that count."""
    count = len(outcomes)
    ratios = np.array([outcome['error'] / outcome['best'] for outcome in outcomes])
    good = int(np.sum(ratios <= GOOD))
    refused = sum(outcome['wrong_status'] == 1 for outcome in outcomes)
    return (f'{good} of {count} ({good / count:.0%}, wanted {WANTED:.0%}) within {GOOD} of the '
            f'best fit of the own form; ratio median {np.median(ratios):.3f}, largest '
            f'{ratios.max():.3f}\n{refused} of {count} ({refused / count:.0%}, wanted '
            f'{WANTED:.0%}) wrong effects refused')


def main() -> int:
    """Run cases that are not in the file yet, and print the shares."""
    parser = scoring_parser(__doc__, 'adoption.jsonl')
    parser.add_argument('cases', type=int, nargs='?', default=24)
    parser.add_argument('--first', type=int, default=500, help='first seed')
    parser.add_argument('--snr', type=float, default=1.0)
    parser.add_argument('--duration', type=float, default=40.0, help='of recordings [s]')
    options = parser.parse_args()
    cases = {case[0].name: case for case in draw_cases(
        options.cases, options.first, options.snr, options.duration)}
    print(summary(outcomes_of(options, outcome_of, cases,
                              lambda outcome: outcome['name'], one_line)))
    return 0


if __name__ == '__main__':
    sys.exit(main())
