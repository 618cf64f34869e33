# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Update the outputs and pictures of docs/tutorial.md and README: python docs/tutorial.py [FOLDER].

The recordings are those of the simulated robot with a hidden effect. What the commands write goes
to the folder (by default output/tutorial). Parts of it replace the blocks of the pages that follow
a comment with their name.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
IMAGES = DOCS / 'images'
sys.path.insert(0, str(DOCS.parent / 'demo'))

import numpy as np  # noqa: E402
from before_after import draw_before_after, rms_of  # noqa: E402
from rich.progress import track  # noqa: E402
from ros_processes import executable  # noqa: E402

from pprs_dynamics import DriveModel  # noqa: E402
from pprs_dynamics.app.report.pictures import BLUE, GREY, RED, new_figure, save  # noqa: E402
from pprs_dynamics.inference.residuals.measuring import measure_residuals  # noqa: E402
from pprs_dynamics.inference.residuals.residuals import Residuals  # noqa: E402
from pprs_dynamics.measurement.files.recording import read_recording  # noqa: E402

HIDDEN, ON = 'stribeck_friction', 'slide_1'
BINS = 40  # of equal numbers of samples
MOST_CANDIDATES = 8
COMMANDS = {
    'run': f'simulate --demo --output run.mcap --effect {HIDDEN} --seed 2 --duration 30',
    'other': f'simulate --demo --output other.mcap --effect {HIDDEN} --seed 2 --duration 30 '
             '--path-seed 1',
    'info': 'info run.mcap --demo',
    'compare': 'compare run.mcap --demo --report before.html --json before.json',
    'diagnose': 'diagnose run.mcap --validate other.mcap --demo --report why.html '
                '--json why.json',
    'adopt': f'adopt {HIDDEN} run.mcap --validate other.mcap --demo --output adopted.yaml '
             '--report adopt.html --json adopt.json',
    'again': 'compare run.mcap --model adopted.yaml --report after.html --json after.json',
    'wrong': 'adopt drive_spring run.mcap --validate other.mcap --demo --output wrong.yaml',
    'history': 'history adopted.yaml --report history.html',
}

# Of what a command says: from the first line that begins so to the next that begins so.
EXCERPTS = {
    'COMPARE': ('compare', ' ', '1. '), 'WHERE': ('compare', '1. ', 'Next'),
    'DIAGNOSE': ('diagnose', '╭', 'Evidence'), 'ADOPT': ('adopt', '╭', 'page'),
    'VERDICT': ('diagnose', '╭', ' effect'),
    'WRONG': ('wrong', '╭', '  error'), 'AGAIN': ('again', ' ', 'page'),
    'HISTORY': ('history', 'Error', 'page'),
}


def main() -> None:
    """Run all commands that have not run yet, and draw the pictures."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else 'output/tutorial')
    folder.mkdir(parents=True, exist_ok=True)
    for name, command in track(COMMANDS.items(), 'running the commands'):
        said = folder / f'{name}.txt'
        if not said.exists():
            done = subprocess.run([executable('pprs'), *command.split()], cwd=folder, text=True,
                                  capture_output=True)
            said.write_text(f'$ pprs {command}\n{done.stdout}{done.stderr}'
                            f'(status {done.returncode})\n')
    run, other = (read_recording(folder / f'{name}.mcap') for name in ('run', 'other'))
    before, after = DriveModel.load(), DriveModel.load(folder / 'adopted.yaml')
    answer = json.loads((folder / 'why.json').read_text())
    draw_where(measure_residuals(before, [run])[0])
    draw_candidates(answer)
    residuals = [measure_residuals(model, [other])[0] for model in (before, after)]
    fall = [float(np.sqrt(np.nanmean(residual.error ** 2))) for residual in residuals]
    draw_before_after(
        IMAGES / 'tutorial_after.png', *residuals, answer['noise_floor'],
        f'On a motion that was not fitted, {HIDDEN} lowers the error from {fall[0]:.3f} to '
        f'{fall[1]:.3f} N; noise alone is {answer["noise_floor"]:.3f} N')
    photograph(folder / 'why.html', IMAGES / 'diagnose.png')
    write_pages(folder)


def photograph(page: Path, picture: Path) -> None:
    """Take a picture of the first screen of a page in Chromium."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as running:
        browser = running.chromium.launch(executable_path=shutil.which('chromium'),
                                          args=['--no-sandbox'])
        tab = browser.new_page(viewport={'width': 1280, 'height': 900})
        tab.goto(page.resolve().as_uri())
        tab.wait_for_selector('.plot[data-drawn]')
        tab.wait_for_timeout(500)  # [ms], for the last curve
        tab.screenshot(path=picture)
        browser.close()


def write_pages(folder: Path) -> None:
    """Replace the blocks of the tutorial and of README by what the commands printed."""
    pages = (DOCS / 'tutorial.md', DOCS.parent / 'README.md')
    texts = [page.read_text(encoding='utf-8') for page in pages]
    for name, (command, first, last) in EXCERPTS.items():
        lines = (folder / f'{command}.txt').read_text().splitlines()[1:]
        start = next(k for k, line in enumerate(lines) if line.strip() and line.startswith(first))
        end = next(k for k in range(start + 1, len(lines)) if lines[k].startswith(last))
        shown = '\n'.join(line.rstrip() for line in lines[start:end]).rstrip()
        block = re.compile(rf'(<!-- {name.lower()} -->\n```text\n).*?(\n```)', re.S)
        if sum(len(block.findall(text)) for text in texts) != 1:
            raise ValueError(f'{name.lower()} must be the name of one block')
        texts = [block.sub(lambda found, shown=shown: found[1] + shown + found[2], text)
                 for text in texts]
    for page, text in zip(pages, texts, strict=True):
        page.write_text(text, encoding='utf-8')


def draw_where(residuals: Residuals) -> None:
    """Draw the error of every drive, and of the worst one against its velocity."""
    figure = new_figure(11, 4)
    left, right = figure.subplots(1, 2, width_ratios=(2, 3))
    sizes = rms_of(residuals.error)
    worst = int(np.argmax(sizes))
    left.barh(residuals.drives, sizes, color=[
        RED if drive == worst else GREY for drive in range(len(sizes))])
    left.invert_yaxis()
    left.set(xlabel='measured minus model, rms [N]', title='which drive')
    velocity = 1e3 * residuals.variables['velocity'][:, worst]
    error = residuals.error[:, worst]
    edges = np.quantile(velocity, np.linspace(0, 1, BINS + 1))
    place = np.clip(np.searchsorted(edges, velocity, side='right') - 1, 0, BINS - 1)
    right.plot(velocity, error, '.', color=GREY, ms=2, alpha=0.35, label='samples')
    right.plot([velocity[place == k].mean() for k in range(BINS)],
               [error[place == k].mean() for k in range(BINS)], '-', color=RED, lw=2,
               label=f'mean in each of {BINS} bins')
    right.set(xlabel='velocity [mm/s]', ylabel='measured minus model [N]',
              title=f'{residuals.drives[worst]}, against its velocity')
    right.legend(frameon=False)
    _finish(figure, (left, right), 'tutorial_where.png')


def draw_candidates(answer: Mapping[str, Any]) -> None:
    """Draw the evidence of the best candidates for the first place."""
    figure = new_figure(8, 3.5)
    axis = figure.subplots()
    best = answer['candidates'][:MOST_CANDIDATES]
    names = [effect['name'] + (f' on {", ".join(effect["drives"])}' if effect['drives'] and len(
        effect['drives']) < 4 else '') for effect in best]
    axis.barh(names, [effect['evidence'] for effect in best],
              color=[BLUE, *[GREY] * (len(best) - 1)])
    axis.axvline(0, color='black', lw=0.8)
    axis.invert_yaxis()
    axis.set(xlabel='evidence: twice the gain in log-likelihood, less penalties')
    _finish(figure, (axis,), 'tutorial_why.png')


def _finish(figure: Any, axes: tuple[Any, ...], name: str) -> None:
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.spines[['top', 'right']].set_visible(False)
    save(figure, IMAGES / name)


if __name__ == '__main__':
    main()
