# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Results since reference runs: python -m benchmarks.real.references FOLDER [--as-far].

Each recording of the da Vinci arm and of the UR10e is diagnosed without a reference and since one.
What is in FOLDER already is not done again; with --as-far nothing is run.
"""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.real import davinci, ur10e
from benchmarks.real.recorded_data import need_data
from benchmarks.real.ur10e import Bench, file, table
from benchmarks.results import write_results
from pprs_dynamics.app.api.simulate import simulate
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.model_writer import write_model

FREE, SAME_DAY = 'free_one_b', 'free_50s_14harm'
# [kg m] about pitch: 105 g at 0.535 m, and at the height of the lower bar's hinges.
MOMENTS = {'insertion': 0.0562, 'parallel': 0.0152}
BODIES = ('link_mass', 'payload_mass')
HIDDEN = ('hysteresis', 'force_ripple')
# Changes of the simulated arm: name, key, joint, factor of its number.
CHANGES = (('nothing', '', 0, 1.0), ('Coulomb wrist_2 + 10 %', 'friction.coulomb', 4, 1.1),
           ('Coulomb wrist_2 + 5 %', 'friction.coulomb', 4, 1.05),
           ('viscous elbow + 30 %', 'friction.viscous', 2, 1.3),
           ('viscous elbow + 10 %', 'friction.viscous', 2, 1.1))


def summary(found: dict[str, Any]) -> str:
    """Return the verdict, the effects with the values of the first, and the rivals of an answer."""
    if not found:
        return 'not measured'
    effects = found['effects']
    if not effects:
        return f'{found["verdict"]}: nothing, {len(found["depends_on"])} patterns'
    first, *others = effects
    known = {**first['parameters'], **(first.get('moments') or {})}
    values = ', '.join(f'{key} {number["value"]:.3g} ± {2 * number["std"]:.2g}'
                       for key, number in list(known.items())[:4] if number.get('std') is not None)
    rivals = sorted({name for row in found['indistinguishable'] for name in row[1:]})
    return (f'{found["verdict"]}: **{first["name"]}** ({values})'
            + (f'; also {", ".join(other["name"] for other in others)}' if others else '')
            + (f'; rivals {", ".join(rivals)}' if rivals else '')
            + f'; {len(found["depends_on"])} patterns; {found["processor_seconds"]:.0f} s')


def since(bench: Bench, name: str, recording: str, model: str, old: str, *reference: str,
          ) -> list[str]:
    """Return a row: the answers without a reference, by the model `old`, and since it."""
    before = bench.run(f'{name}_old', 'diagnose', recording, '--model', old)
    after = bench.run(f'{name}_new', 'diagnose', recording, '--model', model,
                      '--reference', *reference)
    return [name.replace('_', ' '), summary(before), summary(after)]


def surgical_arm(bench: Bench) -> list[list[str]]:
    """Return rows of the da Vinci arm with its weight."""
    (bench.folder / 'psm.yaml').write_text(davinci.model_text())
    bench.run('psm_fit', 'fit', file(FREE), '--model', 'psm.yaml', '--output', 'psm_base.yaml')
    bench.run('psm_full', 'diagnose', file(FREE), '--model', 'psm_base.yaml', '--adopt-all',
              '--output', 'psm_full.yaml')
    return [since(bench, name.removeprefix('load_'), file(name), 'psm_base.yaml', 'psm_full.yaml')
            for name in davinci.LOADED]


def loaded_arm(bench: Bench) -> list[list[str]]:
    """Return rows of the UR10e with its load, since a run of the same day and since others."""
    (bench.folder / 'arm.yaml').write_text(ur10e.MODEL)
    bench.run('ur_fit', 'fit', file(SAME_DAY), '--model', 'arm.yaml', '--output', 'ur_same.yaml')
    bench.run('ur_fit_other', 'fit', *map(file, ur10e.FITTED), '--model', 'arm.yaml', '--output',
              'ur_other.yaml')
    return [since(bench, 'UR10e_same_day', file(ur10e.LOADED), 'ur_same.yaml', 'ur_same.yaml'),
            since(bench, 'UR10e_other_path', file(ur10e.LOADED), 'ur_other.yaml', 'ur_other.yaml')]


def with_noise(clean: Recording, seed: int) -> Recording:
    """Return a recording with white noise of half a percent of each joint's largest effort."""
    size = 0.005 * np.abs(clean.effort).max(axis=0)
    return replace(clean, effort=clean.effort + size * np.random.default_rng(seed).normal(
        size=clean.effort.shape))


def simulated_arm(bench: Bench) -> list[list[str]]:
    """Return rows of a simulated UR10e with hysteresis and ripple that were there before."""
    base, rows = DriveModel.load(bench.folder / 'ur_same.yaml'), []
    keys = [key for key in base.values if key.startswith('reference')]
    plain = {key: value for key, value in base.values.items() if key not in keys}
    for number, (name, key, joint, factor) in enumerate((('', '', 0, 1.0), *CHANGES)):
        values, run = dict(plain), f'sim_{number}'
        if key:
            numbers = list(values[key])
            numbers[joint] *= factor
            values[key] = tuple(numbers)
        write_model(bench.folder / f'{run}.yaml', values)
        # The same hidden effects on each day, as they are of the seed; and other noise.
        recorded = bench.folder / f'{run}.csv'
        if not (bench.as_far or recorded.exists()):
            clean = simulate(bench.folder / f'{run}.yaml', HIDDEN, seed=1, noise=0.0, duration=30.0,
                             path_seed=1).recording
            write_recording(recorded, with_noise(clean, number))
        if number:
            row = since(bench, run, f'{run}.csv', 'sim_0.yaml', 'sim_0.yaml', 'sim_0.csv')
            rows.append([f'simulated, {name}', *row[1:]])
    return rows


def run(folder: Path, as_far: bool) -> None:
    """Run all that is missing and write the results."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, known in (('dvrk', file(FREE)), ('ur10e', file(SAME_DAY))):
        for source in need_data(name, known).iterdir():
            if not (folder / source.name).exists():
                shutil.copyfile(source, folder / source.name)
    bench = Bench(folder, as_far)
    rows = [*surgical_arm(bench), *loaded_arm(bench), *simulated_arm(bench)]
    write_results('references', 'What has changed since a reference run',
                  'python -m benchmarks.real.references FOLDER',
                  table(('run', 'without a reference', 'since it'), rows))


if __name__ == '__main__':
    run(Path(sys.argv[1]).resolve(), '--as-far' in sys.argv)
