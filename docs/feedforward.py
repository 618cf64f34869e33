"""Makes the table and the picture of docs/feedforward.md: python docs/feedforward.py.

Every case runs as processes over DDS, in real time, on the helical path and on an excitation. What
is hidden in the robot is then looked for in the recording of the excitation, and added.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent / 'demo'))

import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
from closed_loop import CASES, Case, Tracking, execute, run_case  # noqa: E402
from ros_processes import executable, reserve_domain  # noqa: E402

from pprs_dynamics.measurement.recording import Recording, write_recording  # noqa: E402

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402

PATHS = {'helical path': (['source:=helix'], 3 * np.pi / 2),
         'excitation': (['source:=excitation', 'duration:=15.0', 'seed:=1'], 15.0)}
LEARN_FROM = 'excitation'
HIDDEN = ('coulomb_friction', 'payload_offset')
COLOURS = ('#999999', '#56B4E9', '#0072B2', '#D55E00', '#D55E00', '#CC79A7', '#CC79A7')
ADDED = 'added'
LIVE, ON_TIME = 'over topics', 'in simulated time'
Runs = dict[tuple[str, str], dict[str, Tracking]]


def main() -> None:
    """Run all cases, print the tables, draw the picture."""
    domain, holder = reserve_domain()
    runs: Runs = {}
    with holder, tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def drive(case: Case) -> None:
            for path, (parameters, duration) in PATHS.items():
                print(f'running: {case.name}, {path}', file=sys.stderr)
                run = run_case(case, parameters, duration, domain, folder)
                runs[case.name, path] = {LIVE: run, ON_TIME: execute(case, run.commands)}

        for case in CASES:
            drive(case)
        for effect in HIDDEN:
            case = Case(f'the same, with `{effect}` hidden in the robot', 'friction', (effect,))
            drive(case)
            recording = runs[case.name, LEARN_FROM][LIVE].recording('run')
            drive(Case(f'the same, with what was found of `{effect}` added', 'friction', (effect,),
                       learn(recording, folder / effect)))
    cases = list(dict.fromkeys(name for name, _ in runs))
    for kind in (LIVE, ON_TIME):
        _print_table(kind, cases, runs)
    late = max(run[LIVE].late_share for run in runs.values())
    print(f'late cycles: {late:.3%} at most')
    _draw(cases, {key: run[LIVE] for key, run in runs.items()})


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
    figure, axes = pyplot.subplots(1, len(PATHS), figsize=(12, 4.5), layout='constrained')
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
    figure.legend(*axes[0].get_legend_handles_labels(), loc='outside lower center', ncols=3,
                  frameon=False)
    figure.savefig(DOCS / 'images' / 'tracking.png', dpi=110)


if __name__ == '__main__':
    main()
