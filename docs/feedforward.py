"""Makes the table and the picture of docs/feedforward.md: python docs/feedforward.py.

Every case runs as processes over DDS, in real time, on the helical path and on an excitation.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent / 'demo'))

import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
from closed_loop import CASES, Case, Tracking, run_case  # noqa: E402
from rich.progress import track  # noqa: E402
from ros_processes import reserve_domain  # noqa: E402

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402

PATHS = {'helical path': (['source:=helix'], 3 * np.pi / 2),
         'excitation': (['source:=excitation', 'duration:=15.0', 'seed:=1'], 15.0)}
HIDDEN = ('coulomb_friction', 'payload_offset')
COLOURS = ('#999999', '#56B4E9', '#0072B2', '#D55E00', '#CC79A7')


def main() -> None:
    """Run all cases, print the table, draw the picture."""
    cases = [*CASES, *(Case(f'friction-compensated, {name} hidden in the robot', 'friction',
                            (name,)) for name in HIDDEN)]
    domain, holder = reserve_domain()
    runs: dict[tuple[str, str], Tracking] = {}
    jobs = [(case, path) for case in cases for path in PATHS]
    with holder, tempfile.TemporaryDirectory() as folder:
        for case, path in track(jobs, 'running the robot'):
            runs[case.name, path] = run_case(case, *PATHS[path], domain, Path(folder))
    headings = ' | '.join(f'{path} [mm] | [mrad]' for path in PATHS)
    print(f'| case | {headings} |\n|---|{"---|" * 2 * len(PATHS)}')
    for case in cases:
        cells = ' | '.join(f'{1e3 * runs[case.name, path].position_rms:.3f} | '
                           f'{1e3 * runs[case.name, path].angle_rms:.3f}' for path in PATHS)
        print(f'| {case.name} | {cells} |')
    print(f'late cycles: {max(run.late_share for run in runs.values()):.3%} at most')
    _draw([case.name for case in cases], runs)


def _draw(names: list[str], runs: dict[tuple[str, str], Tracking]) -> None:
    figure, axes = pyplot.subplots(1, len(PATHS), figsize=(12, 4.5), layout='constrained')
    for axis, path in zip(axes, PATHS, strict=True):
        for name, colour in zip(names, COLOURS, strict=True):
            run = runs[name, path]
            axis.semilogy(run.time, 1e3 * np.linalg.norm(run.position_error, axis=1),
                          color=colour, lw=1.2, label=name)
        axis.set(title=path, xlabel='time [s]', ylim=(1e-3, None))
        axis.grid(alpha=0.25)
        axis.spines[['top', 'right']].set_visible(False)
    axes[0].set_ylabel('distance of the platform from its path [mm]')
    figure.legend(*axes[0].get_legend_handles_labels(), loc='outside lower center', ncols=3,
                  frameon=False)
    figure.savefig(DOCS / 'images' / 'tracking.png', dpi=110)


if __name__ == '__main__':
    main()
