# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Problems drawn from seeds: robots of a physics engine with effects in forms of their own.

The 3-PPRS comes from `benchmarks.hidden`, where the strength of an effect is what it adds beyond
the model refitted within its tolerances. The others are simulated by MuJoCo's inverse dynamics.
There the strength is the rms that an effect adds to the error of its drives, over the standard
deviation of their noise. The noise is scaled to the wanted strength.
"""

from __future__ import annotations

import json
import shutil
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from benchmarks.hidden.effort_noise import EffortNoise
from benchmarks.hidden.off_forms import CAN_BE_OFF
from benchmarks.hidden.recordings import Case, make_case, noise_settings
from benchmarks.naming.columns import problem_of
from benchmarks.naming.problems import Named, Truth
from benchmarks.naming.robots import ROBOTS, hidden_names, model_of
from benchmarks.scores.diagnosis_table import SAME_FORM
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.measurement.files.recording import (
    Recording,
    read_recording,
    write_recording,
)
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.model_writer import format_model
from pprs_dynamics.simulation.export.exported_robot import export_robot, written
from pprs_dynamics.simulation.injection import NOT_IN_CATALOGUE, simulate_mechanism

DURATION = 40.0  # [s]
SNRS = (0.5, 1.0, 2.0, 5.0, 20.0)
NOISES = ('white', 'AR(1) 0.9', 'AR(1) 0.98', '1/f', 'gaps', 'drift')
CORRELATIONS: dict[str, float | str] = {
    'white': 0.0, 'AR(1) 0.9': 0.9, 'AR(1) 0.98': 0.98, '1/f': '1/f', 'gaps': 0.9, 'drift': 0.997}
GAPS, LONGEST_GAP = 6, 1.5  # in a recording of that noise [s]
LEVEL = 0.005  # noise over a drive's largest effort, where nothing is hidden
FELT = 0.1  # of what the most concerned drive feels, from which on a drive counts
STRONG = 5.0  # least SNR at which forms are off and the unknown is asked for
BUMP = (0.02, 0.05)  # widths of an unknown force over position, over the stroke
FORM_OFF = (0.05, 0.15)  # see `benchmarks.hidden.off_forms`
# In turn: six of twelve hide one effect, two nothing, two a set.
KINDS = ('single', 'nothing', 'two', 'single', 'unknown', 'single', 'nothing', 'single', 'form',
         'three', 'single', 'single')


@dataclass(frozen=True)
class Draw:
    """One problem to be made."""

    robot: str
    kind: str
    names: tuple[str, ...]
    snr: float
    noise: str
    seed: int

    @property
    def name(self) -> str:
        """Of the problem: says nothing about what is hidden."""
        return f'{self.robot}_{zlib.crc32(repr(self).encode()):08x}'

    def rng(self, what: str) -> np.random.Generator:
        """Return random numbers for one purpose."""
        return np.random.default_rng((self.seed, zlib.crc32(f'{self} {what}'.encode())))


def draws(seed: int, count: int) -> Iterator[Draw]:
    """Yield problems of a seed, so that any first part is balanced.

    Kinds and robots go in turn; strengths and noises of each kind, and effects of each robot, in
    rounds that are shuffled: each comes once before any comes again.
    """
    rng = np.random.default_rng((seed, zlib.crc32(b'naming')))
    rounds: dict[tuple[str, str], Iterator[str]] = {}

    def following(what: str, of: str, values: Sequence[object]) -> str:
        return next(rounds.setdefault((what, of), _shuffled(rng, [str(value) for value in values])))

    for k in range(count):
        kind = KINDS[k % len(KINDS)]
        robots = [robot for robot in ROBOTS if kind not in ('two', 'three') or robot != 'axis']
        robot = following('robot', 'sets' if kind in ('two', 'three') else kind, robots)
        names = [name for name in hidden_names(robot) if kind != 'form' or name in CAN_BE_OFF]
        if kind in ('two', 'three'):
            size = ('two', 'three').index(kind) + 2
            chosen = tuple(str(name) for name in rng.choice(sorted(names), size, replace=False))
        else:
            chosen = () if kind in ('nothing', 'unknown') else (
                following('names', f'{robot} {kind == "form"}', sorted(names)),)
        least = {'form': STRONG, 'unknown': STRONG, 'two': 1.0, 'three': 1.0}.get(kind, 0.0)
        snr = float(following('snr', kind, [strength for strength in SNRS if strength >= least]))
        noise = following('noise', kind, NOISES)
        yield Draw(robot, kind, chosen, 0.0 if kind == 'nothing' else snr, noise,
                   int(rng.integers(2 ** 31)))


def _shuffled(rng: np.random.Generator, values: Sequence[str]) -> Iterator[str]:
    while True:
        yield from (str(value) for value in rng.permutation(values))


def make(draw: Draw, folder: Path) -> Truth:
    """Write a problem with its columns into a folder of its name, and return what is true."""
    target = folder / draw.name
    truth = write_problem(draw, target)
    model = DriveModel.load(target / 'model.yaml')
    problem_of(model, read_recording(target / 'recording.csv', model.drives)).write(target)
    return truth


def write_problem(draw: Draw, folder: Path, seconds: float = DURATION) -> Truth:
    """Write recording and model into a folder, and return what is true."""
    model, recording, truth = (_of_platform if draw.robot == '3-PPRS' else _of_arm)(draw)
    if draw.noise == 'gaps':
        recording = _with_gaps(draw, recording)
    if seconds < DURATION:
        part = recording.time < recording.time[0] + seconds
        recording = Recording.from_arrays(
            recording.name, recording.time[part], recording.position[part], None,
            recording.effort[part], recording.drives)
    folder.mkdir(parents=True, exist_ok=True)
    write_recording(folder / 'recording.csv', recording)
    _write_model(draw.robot, model, folder)
    return truth


def _write_model(robot: str, model: DriveModel, folder: Path) -> None:
    if robot == '3-PPRS':
        (folder / 'model.yaml').write_text(format_model(model.values))
        (folder / 'model.xml').write_text(written(export_robot(model, 'mjcf'), 'mjcf'))
        return
    source = model_of(robot)
    shutil.copy(source, folder / 'model.yaml')
    shutil.copy(source.with_suffix('.urdf'), folder)


def _truth(draw: Draw, effects: Sequence[dict[str, object]]) -> Truth:
    return Truth(draw.name, draw.robot, draw.kind, draw.noise, draw.snr, tuple(
        _named(effect, draw.kind) for effect in effects))


def _named(effect: dict[str, object], kind: str) -> Named:
    name, drives = str(effect['name']), cast('Sequence[str] | None', effect['drives'])
    parameters = json.loads(json.dumps(effect['parameters']))
    flat: dict[str, tuple[float, float | None]] = {}
    if name in SAME_FORM and kind != 'form':
        for key, value in parameters.items():
            if isinstance(value, dict):
                flat.update({f'{key}.{inner}': (float(v), None) for inner, v in value.items()})
            else:  # one value is that of every drive
                flat.update({f'{drive}.{key}' if drive else key: (float(value), None)
                             for drive in drives or ('',)})
    return Named(name, None if drives is None else tuple(drives), flat)


def _of_platform(draw: Draw) -> tuple[DriveModel, Recording, Truth]:
    rng = draw.rng('platform')
    row = {'single': 'effects', 'nothing': 'nothing', 'form': 'forms', 'unknown': 'unknown'}.get(
        draw.kind, 'pairs')
    names = draw.names or ((str(rng.choice(sorted(NOT_IN_CATALOGUE))),)
                           if draw.kind == 'unknown' else ())
    case = Case(row, names, draw.seed % 100_000, draw.snr or 1.0, CORRELATIONS[draw.noise])
    model, recording, truth = make_case(case)
    return model, recording, _truth(draw, truth['effects'])


def _of_arm(draw: Draw) -> tuple[DriveModel, Recording, Truth]:
    model = DriveModel.load(model_of(draw.robot))
    motion_seed = draw.seed % 1_000_000
    plain, run = (simulate_mechanism(model, names, draw.seed, noise=0.0, duration=DURATION,
                                     path_seed=motion_seed) for names in ((), draw.names))
    assert run.motion.time is not None
    time, effort, effects = run.motion.time, run.effort, list(run.effects)
    largest = np.maximum(np.abs(plain.effort).max(axis=0), 1e-9)
    if draw.kind == 'form':
        effort = plain.effort + (effort - plain.effort) * _wave(draw, run.position)
    if draw.kind == 'unknown':
        added, drive = _bump(draw, run.position, largest)
        effort = effort + added
        effects.append({'name': 'local_bump', 'drives': [drive], 'parameters': {}})
    sigma = LEVEL * largest
    if draw.snr:
        signal = _added(*(_residuals(model, time, *pair) for pair in (
            (run.position, effort), (plain.position, plain.effort)))) / sigma
        strength = np.sqrt(np.nanmean(np.square(signal), axis=0))
        feels = strength > FELT * strength.max()
        total = float(np.sqrt(np.mean(np.square(strength[feels]))))
        # A set's strengths add up: each effect has about its share.
        sigma = sigma * total / (draw.snr * np.sqrt(max(len(draw.names), 1)))
    noise = EffortNoise(noise_settings(CORRELATIONS[draw.noise], 1.0), draw.rng('noise'),
                        len(largest)).samples(len(time))
    recording = Recording.from_arrays(draw.name, time, run.position, None, effort + noise * sigma,
                                      model.drives)
    return model, recording, _truth(draw, effects)


def _residuals(model: DriveModel, time: Array, position: Array, effort: Array) -> Residuals:
    recording = Recording.from_arrays('noise-free', time, position, None, effort, model.drives)
    return measure_residuals(model, [recording])[0]


def _added(with_effects: Residuals, plain: Residuals) -> Array:
    """Return what effects add to the error at their times, (M, D); NaN where not both are known.

    Rests may differ, and with them the times of the samples: the nearest one counts.
    """
    after = np.clip(np.searchsorted(plain.time, with_effects.time), 1, len(plain) - 1)
    middle = (plain.time[after - 1] + plain.time[after]) / 2
    nearest = np.where(with_effects.time < middle, after - 1, after)
    far = np.abs(plain.time[nearest] - with_effects.time) > 0.6 * plain.period
    return np.where(far[:, None], np.nan, with_effects.error - plain.error[nearest])


def _wave(draw: Draw, position: Array) -> Array:
    """Return by what each drive's force is multiplied whose form is off, (N, D)."""
    rng = draw.rng('form')
    share, waves = rng.uniform(*FORM_OFF), rng.uniform(1.0, 3.0, position.shape[1])
    phase = rng.uniform(0, 2 * np.pi, position.shape[1])
    stroke = np.maximum(np.ptp(position, axis=0), 1e-12)
    wave: Array = 1 + share * np.sqrt(2) * np.cos(
        2 * np.pi * waves * (position - position.min(axis=0)) / stroke + phase)
    return wave


def _bump(draw: Draw, position: Array, largest: Array) -> tuple[Array, str]:
    """Return a force in a narrow range of one drive's positions, (N, D), and the drive."""
    rng = draw.rng('bump')
    d = int(rng.integers(position.shape[1]))
    stroke = float(np.ptp(position[:, d]))
    middle = float(np.quantile(position[:, d], rng.uniform(0.3, 0.7)))
    width = rng.uniform(*BUMP) * stroke
    added = np.zeros_like(position)
    added[:, d] = 0.1 * largest[d] * np.exp(-((position[:, d] - middle) / width) ** 2)
    return added, DriveModel.load(model_of(draw.robot)).drives[d]


def _with_gaps(draw: Draw, recording: Recording) -> Recording:
    rng, time = draw.rng('gaps'), recording.time
    kept = np.ones(len(time), dtype=bool)
    for begin in rng.uniform(time[0], time[-1] - LONGEST_GAP, GAPS):
        kept &= ~((time >= begin) & (time < begin + rng.uniform(0.2, LONGEST_GAP)))
    return Recording.from_arrays(draw.name, time[kept], recording.position[kept], None,
                                 recording.effort[kept], recording.drives)

