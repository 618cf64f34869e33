# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Results on a da Vinci arm: python -m benchmarks.real.davinci FOLDER.

The data, psm.urdf and the recordings as `free_one_b.csv.gz` and `load_….csv.gz`, is looked for in
../shared/data/dvrk and in the folder `dvrk` below PPRS_DATA; see the page. Everything is done by
the commands; what is in FOLDER already is not done again.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path

import numpy as np
from scipy.signal import butter, filtfilt

from benchmarks.real.recorded_data import need_data
from benchmarks.results import ROOT, write_results
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.files.recording import Recording, read_recording
from pprs_dynamics.physics.model.drive_model import DriveModel

PAGE = ROOT / 'docs' / 'closed_chain.md'
FREE = 'free_one_b.csv.gz'
LOADED = ('load_insertion_105_fast', 'load_insertion_105_slow', 'load_parallel_105_fast',
          'load_parallel_105_slow')
BELOW = 6.0  # [Hz]: the insertion shakes at 11 Hz, and published errors are low-passed


def model_text() -> str:
    """Return the model file that the page shows."""
    return PAGE.read_text(encoding='utf-8').partition('```yaml\n')[2].partition('```')[0]


def relative_below(model: DriveModel, recordings: list[Recording]) -> list[tuple[Array, Array]]:
    """Return error and effort of each drive below `BELOW`, zero phase, of each recording."""
    found = []
    for recording in recordings:
        residuals = measure_residuals(model, [recording])[0]
        step = float(np.median(np.diff(residuals.time)))
        b, a = butter(4, 2 * BELOW * step)
        measured = residuals.measured
        keep = np.isfinite(measured).all(axis=1)
        found.append((filtfilt(b, a, residuals.error[keep], axis=0),
                      filtfilt(b, a, measured[keep], axis=0)))
    return found


def share(pairs: list[tuple[Array, Array]]) -> list[float]:
    """Return rms error over rms effort with its mean removed, by drive."""
    error, effort = (np.concatenate(rows) for rows in zip(*pairs, strict=True))
    return [float(value) for value in np.sqrt((error ** 2).mean(axis=0)) / effort.std(axis=0)]


def run(folder: Path) -> None:
    """Run the commands in a folder, and write the results."""
    data = need_data('dvrk', FREE)
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    for name in ('psm.urdf', FREE, *(f'{stem}.csv.gz' for stem in LOADED)):
        if not Path(name).exists():
            shutil.copyfile(data / name, name)
    if not Path('psm.yaml').exists():
        Path('psm.yaml').write_text(model_text())
    if not Path('base.yaml').exists():
        main(['fit', FREE, '--model', 'psm.yaml', '--output', 'base.yaml'])
    for name in LOADED:
        if not Path(f'{name}.json').exists():
            main(['diagnose', f'{name}.csv.gz', '--model', 'base.yaml', '--reference',
                  '--as-it-is', '--json', f'{name}.json'])
    free = read_recording(FREE, DriveModel.load('psm.yaml').recorded)
    lines = [f'| model | {" | ".join(free.drives)} |', '|---|---|---|---|']
    for name in ('psm', 'base'):
        errors = share(relative_below(DriveModel.load(f'{name}.yaml'), [free]))
        lines.append(f'| {name} | ' + ' | '.join(f'{100 * error:.1f} %' for error in errors) + ' |')
    lines += ['', '| recording | verdict | effect | alike | parameters |', '|---|---|---|---|---|']
    for name in LOADED:
        answer = json.loads(Path(f'{name}.json').read_text())
        for effect in answer['effects']:
            values = ', '.join(f'{key} {value["value"]:.3g}'
                               for key, value in effect['parameters'].items() if value['value'])
            alike = '; '.join(map(', '.join, effect['alike']))
            lines.append(f'| {name} | {answer["verdict"]} | {effect["name"]} | {alike} | '
                         f'{values} |')
    draw()
    write_results('davinci', 'A surgical arm with two parallelograms',
                  'python -m benchmarks.real.davinci FOLDER',
                  'Relative errors of effort below 6 Hz on the free run, then the diagnoses of '
                  'runs with a weight of 105 g since that run.\n\n' + '\n'.join(lines))


def draw() -> None:
    """Draw the error of pitch with the weight on top, before and with the body found."""
    model = DriveModel.load('base.yaml')
    name = LOADED[0]
    said = json.loads(Path(f'{name}.json').read_text())['effects'][0]
    values = {f'effects.{said["name"]}.{key}': number['value']
              for key, number in said['parameters'].items() if number['value']}
    active = [*model.values.get('effects.active', ()), said['name']]
    loaded = type(model).from_parameters({**model.values, **values, 'effects.active': active},
                                         source=model.source)
    recording = read_recording(f'{name}.csv.gz', model.recorded)
    from matplotlib.figure import Figure  # tests import the rest of this file

    figure = Figure(figsize=(7.5, 2.8), layout='constrained')
    axes = figure.subplots()
    for shown, label, colour in ((model, 'without the weight', '#999999'),
                                 (loaded, 'with the reported body', '#0072B2')):
        residuals = measure_residuals(shown, [recording])[0]
        axes.plot(residuals.time, residuals.error[:, 1], label=label, color=colour, lw=0.8)
    axes.set_xlim(5, 20)
    axes.set_ylim(-0.6, 1.0)
    axes.set_xlabel('time [s]')
    axes.set_ylabel('error of pitch [N m]')
    axes.legend(frameon=False, ncols=2)
    axes.spines[['top', 'right']].set_visible(False)
    figure.savefig(PAGE.parent / 'images' / 'closed_chain.png', dpi=110)


if __name__ == '__main__':
    run(Path(sys.argv[1]).resolve())
