# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Makes the tables and the picture of docs/feedforward.md: python docs/feedforward.py.

Every case runs as processes over DDS, in real time, on the helical path and on an excitation, and
its commands once more in simulated time, in which none comes late. What is hidden in the robot is
looked for in the recording of the excitation, and added. With --simulated nothing goes through
topics, so that the results are the same on every machine.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent / 'demo'))

import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
from closed_loop import CASES, Case, Tracking, commands_for, execute, run_case  # noqa: E402
from ros_processes import executable, reserve_domain  # noqa: E402

from pprs_dynamics.measurement.files.recording import Recording, write_recording  # noqa: E402
from pprs_dynamics.physics.mechanism.paths import Excitation, HelicalPath  # noqa: E402

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402

PATHS: dict[str, HelicalPath | Excitation] = {
    'helical path': HelicalPath(), 'excitation': Excitation(duration=15.0, seed=1)}
PLAYED = {'helical path': ['source:=helix'],
          'excitation': ['source:=excitation', 'duration:=15.0', 'seed:=1']}
LEARN_FROM = 'excitation'
HIDDEN = ('coulomb_friction', 'payload_mass')
COLOURS = ('#999999', '#56B4E9', '#0072B2', '#D55E00', '#D55E00', '#CC79A7', '#CC79A7')
ADDED = 'added'
LIVE, ON_TIME = 'over topics', 'in simulated time'
Runs = dict[tuple[str, str], dict[str, Tracking]]


def main() -> None:
    """Run all cases, print the tables, draw the picture."""
    domain, holder = reserve_domain()
    with holder, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if '--simulated' in sys.argv:
            runs = run_all(CASES, simulated, folder)
        else:
            runs = run_all(CASES, partial(live, domain=domain, folder=folder), folder)
    cases = list(dict.fromkeys(name for name, _ in runs))
    kinds = list(next(iter(runs.values())))
    for kind in kinds:
        _print_table(kind, cases, runs)
    if LIVE in kinds:
        late = max(run[LIVE].late_share for run in runs.values())
        print(f'late cycles: {late:.3%} at most')
    _draw(cases, {key: run[ON_TIME] for key, run in runs.items()})


def run_all(
    cases: Sequence[Case], drive: Callable[[Case, str], dict[str, Tracking]], folder: Path,
) -> Runs:
    """Run cases on all paths, then those with something hidden.

    `drive` returns in which ways a path was followed.
    """
    runs: Runs = {}

    def run(case: Case) -> None:
        for path in PATHS:
            runs[case.name, path] = drive(case, path)
            print(f'{case.name}, {path}: ' + '; '.join(
                f'{1e3 * run.position_rms:.4f} mm, {1e3 * run.angle_rms:.4f} mrad {kind}'
                for kind, run in runs[case.name, path].items()), file=sys.stderr, flush=True)

    for case in cases:
        run(case)
    for effect in HIDDEN:
        case = Case(f'the same, with `{effect}` hidden in the robot', 'friction', (effect,))
        run(case)
        first, *_ = runs[case.name, LEARN_FROM].values()
        run(Case(f'diagnosed and {ADDED}: `{effect}`', 'friction', (effect,),
                 learn(first.recording('run'), folder / effect)))
    return runs


def live(case: Case, path: str, domain: int, folder: Path) -> dict[str, Tracking]:
    """Run a case as processes, and its commands again in simulated time."""
    run = run_case(case, PLAYED[path], PATHS[path].duration, domain, folder)
    return {LIVE: run, ON_TIME: execute(case, run.commands)}


def simulated(case: Case, path: str) -> dict[str, Tracking]:
    """Run a case in simulated time alone."""
    return {ON_TIME: execute(case, commands_for(case, PATHS[path]))}


def learn(recording: Recording, folder: Path) -> Path:
    """Return a model file with what `pprs` finds in a recording."""
    folder.mkdir()
    write_recording(folder / 'run.mcap', recording)
    model = folder / 'adopted.yaml'
    done = subprocess.run(
        [executable('pprs'), 'diagnose', str(folder / 'run.mcap'), '--adopt-all',
         '--output', str(model)], capture_output=True, text=True)
    print(done.stdout, done.stderr, file=sys.stderr)
    if not model.exists():
        raise SystemExit(f'nothing was added; status {done.returncode}')
    return model


def _print_table(kind: str, cases: list[str], runs: Runs) -> None:
    headings = ' | '.join(f'{path} [mm] | [mrad]' for path in PATHS)
    print(f'\n| {kind} | {headings} |\n|---|{"---|" * 2 * len(PATHS)}')
    for case in cases:
        cells = ' | '.join(f'{1e3 * runs[case, path][kind].position_rms:.4f} | '
                           f'{1e3 * runs[case, path][kind].angle_rms:.4f}' for path in PATHS)
        print(f'| {case} | {cells} |')


def _draw(names: list[str], runs: dict[tuple[str, str], Tracking]) -> None:
    figure, axes = pyplot.subplots(1, len(PATHS), figsize=(12, 5), layout='constrained')
    for axis, path in zip(axes, PATHS, strict=True):
        for name, colour in zip(names, COLOURS, strict=True):
            run = runs[name, path]
            axis.semilogy(run.time, 1e3 * np.linalg.norm(run.position_error, axis=1),
                          '--' if ADDED in name else '-', color=colour, lw=1.2,
                          label=name.replace('`', ''))
        axis.set(title=path, xlabel='time [s]', ylim=(1e-3, None))
        axis.grid(alpha=0.25)
        axis.spines[['top', 'right']].set_visible(False)
    axes[0].set_ylabel('distance of the platform from its path [mm]')
    figure.legend(*axes[0].get_legend_handles_labels(), loc='outside lower center', ncols=2,
                  frameon=False)
    figure.savefig(DOCS / 'images' / 'tracking.png', dpi=110)


if __name__ == '__main__':
    main()
