# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How far a measured curve takes the error down along another motion.

    python -m benchmarks.scores.curves [RECORDINGS] [--file FILE] [--table docs/curves_table.md]

On a recording of the paper's robot one drive needs a force more that no law of the catalogue has:
a bump at a position, the pull of a cable that another drive drags along, the error of a screw with
three harmonics. `adopt measured_curve` fits it to one motion; told is the error of that drive along
another, over that of the model which knows the hidden force. Outcomes are appended to FILE, and
what is there is not run again.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.scores.cases import Outcome, outcomes_of, scoring_parser
from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.request import requested
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.paths import Excitation

DURATION, RATE, NOISE = 30.0, 100.0, 0.08  # [s, Hz, N]
SIZES = 0.4, 1.2  # [N], smallest and largest of a hidden force
GOAL = 1.1  # error over that of the model which knows the force
LEADS = 0.008, 0.02  # [m], of screws

Positions = np.ndarray
Hidden = Callable[[Positions], np.ndarray]


def bump(q: Positions, drive: int, random: np.random.Generator) -> tuple[str, Hidden]:
    """Return the variable and the force of a bump of 4 to 8 % of the stroke."""
    x = q[:, drive]
    centre, width = np.quantile(x, random.uniform(0.2, 0.8)), random.uniform(0.04, 0.08)
    return 'position', lambda q: np.exp(-((q[:, drive] - centre) / (width * np.ptp(x))) ** 2)


def cable(q: Positions, drive: int, random: np.random.Generator) -> tuple[str, Hidden]:
    """Return the variable and the pull of a cable over another drive's position."""
    other = int(random.choice([d for d in range(len(DRIVES)) if d != drive]))
    middle, reach = q[:, other].mean(), random.uniform(0.15, 0.4) * np.ptp(q[:, other])
    return (f'position of {DRIVES[other]}',
            lambda q: np.tanh((q[:, other] - middle) / reach))


def screw(q: Positions, drive: int, random: np.random.Generator) -> tuple[str, Hidden]:
    """Return the variable and the force of a screw's error with three harmonics."""
    lead, phases = random.uniform(*LEADS), random.uniform(0, 2 * np.pi, 3)
    sizes = np.array([1.0, random.uniform(0.3, 0.7), random.uniform(0.15, 0.4)])

    def force(q: Positions) -> np.ndarray:
        turns = 2 * np.pi * q[:, drive, None] * np.arange(1, 4) / lead
        return np.asarray(np.sin(turns + phases) @ sizes / sizes.sum())
    return 'position', force


FORMS = {'bump': bump, 'cable': cable, 'screw': screw}


def run_case(case: tuple[str, int], model: DriveModel) -> Outcome:
    """Hide a force, adopt a curve, and hold it against another motion."""
    form, seed = case
    random = np.random.default_rng((list(FORMS).index(form), seed))
    drive, size = int(random.integers(len(DRIVES))), float(random.uniform(*SIZES))
    time = np.arange(0, DURATION, 1 / RATE)
    motions = [Excitation(DURATION, seed=2 * seed + k).motion(time) for k in range(2)]
    forces = [model.drive_forces(motion) for motion in motions]
    variable, shape = FORMS[form](forces[0].mechanism.position, drive, random)
    runs, known = [], []
    for k, one in enumerate(forces):
        q = one.mechanism.position
        effort = one.total + NOISE * random.standard_normal(q.shape)
        known.append(Recording.from_arrays(f'known {k}', time, q, effort=effort))
        hidden = effort.copy()
        hidden[:, drive] += size * shape(q)
        runs.append(Recording.from_arrays(f'run {k}', time, q, effort=hidden))
    name = DRIVES[drive]
    answer = adopt(model, requested(f'measured_curve:{name}@{variable}', model), runs[:1], runs[1:])
    before, after, floor = (rms_by_drive(measure_residuals(one, [run])[0])[name] for one, run in (
        (model, runs[1]), (answer.after, runs[1]), (model, known[1])))
    return {'form': form, 'seed': seed, 'drive': name, 'variable': variable, 'size': size,
            'adopted': answer.adopted, 'before': before / floor, 'after': after / floor}


def table(outcomes: list[Outcome]) -> str:
    """Return the count of those that reach the goal, and the errors, in Markdown."""
    lines = [f'| hidden | error at most {GOAL:g} x the noise | error / noise before, median | '
             'after, median | after, largest |', '|---|---|---|---|---|']
    for name in (*FORMS, 'all'):
        chosen = [one for one in outcomes if name in (one['form'], 'all')]
        if not chosen:
            continue
        before, after = (np.array([one[key] for one in chosen]) for key in ('before', 'after'))
        met = sum(one['adopted'] and one['after'] <= GOAL for one in chosen)
        lines.append(f'| {name} | {met} of {len(chosen)} | {np.median(before):.2f} | '
                     f'{np.median(after):.3f} | {after.max():.3f} |')
    return '\n'.join(lines) + '\n'


def main() -> None:
    """Run what is asked for."""
    parser = scoring_parser(__doc__ or '', 'curves.jsonl')
    parser.add_argument('recordings', type=int, nargs='?', default=21, help='in all (default 21)')
    parser.add_argument('--table', type=Path, help='write the table of all outcomes in FILE')
    options = parser.parse_args()
    names = list(FORMS)
    cases = [(names[k % len(names)], k // len(names)) for k in range(options.recordings)]
    outcomes = outcomes_of(
        options, partial(run_case, model=DriveModel.load()), {case: case for case in cases},
        lambda one: (one['form'], one['seed']),
        lambda one: f'{one["form"]} {one["seed"]} {one["drive"]}@{one["variable"]}: '
        f'{one["before"]:.2f} -> {one["after"]:.3f}, '
        f'{"adopted" if one["adopted"] else "refused"}')
    said = table(outcomes)
    print(said)
    if options.table:
        options.table.write_text(said)


if __name__ == '__main__':
    main()
