# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How often `localise` says something about noise, and how often it finds a planted error.

    python -m benchmarks.scores.localisation [RECORDINGS] [FIRST_SEED] [WHAT] [--file FILE]

It prints the share of recordings with a perfect model in which anything is stated, per sort of
noise, and
that in which a planted error is named first with drive and variable, per error and sort of noise.
WHAT is `noise`, `planted`, part of a planted error's name, or absent for all. What was said is
appended to FILE as it comes, and recordings that are there are not made again; `--workers` and
`--scheduler` say where they are made, as for `pprs survey`.

Recordings: 40 s at 100 Hz of the paper's robot on a random excitation, noise of 0.08 N rms that is
independent between the drives; planted errors of 0.3 N at most, on one drive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from benchmarks.scores.cases import Outcome, outcomes_of, scoring_parser
from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.diagnosis.comparison import localise
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.physics.mechanism.paths import Excitation

DURATION, RATE = 40.0, 100.0  # [s, Hz]
NOISE, ERROR = 0.08, 0.3  # [N]
NOISES: tuple[float | str, ...] = (0.0, 0.9, 0.97, 0.99, 0.998, 'mixed', '1/f')
# Noise under which errors are planted; slower noise of this size hides most of them.
PLANTED_NOISES: tuple[float | str, ...] = (0.0, 0.9, 0.97)

Planted = tuple[str, np.ndarray]


def record_motion(seed: int) -> Residuals:
    """Return a recording of a perfect model without noise."""
    time = np.arange(0, DURATION, 1 / RATE)
    motion = Excitation(duration=DURATION, seed=seed).motion(time)
    forces = DriveModel.load().drive_forces(motion)
    state = forces.mechanism
    rotation = Rotation.from_quat(motion.orientation).as_matrix()
    rod_angle = state.robot.rods(state.links)[0]
    variables = {
        'position': state.position, 'velocity': state.velocity,
        'acceleration': state.acceleration, 'load': state.friction_load,
        'rod_angle': np.concatenate((rod_angle, rod_angle), axis=1),
        **{f'platform_{axis}': motion.position[:, k] for k, axis in enumerate('xyz')},
        'platform_tilt': np.arccos(np.clip(rotation[:, 2, 2], -1, 1)),
        'platform_turn': np.arctan2(rotation[:, 1, 0] - rotation[:, 0, 1],
                                    rotation[:, 0, 0] + rotation[:, 1, 1])}
    return Residuals(DRIVES, time, np.zeros(len(time), dtype=int), forces.total, forces.total,
                     dict(forces.parts), variables, 1 / RATE)


def make_noise(
    kind: float | str, samples: int, rng: np.random.Generator, width: int = len(DRIVES),
) -> np.ndarray:
    """Return noise of unit rms: AR(1) of that coefficient, 'mixed' (70 % AR(1) .98) or '1/f'."""
    if kind == 'mixed':
        slow, white = make_noise(0.98, samples, rng, width), rng.normal(size=(samples, width))
        return np.sqrt(0.7) * slow + np.sqrt(0.3) * white
    if kind == '1/f':
        spectrum = np.fft.rfft(rng.normal(size=(8 * samples, width)), axis=0)
        frequency = np.maximum(np.arange(len(spectrum)), 1)
        values = np.fft.irfft(spectrum / np.sqrt(frequency)[:, None], axis=0)[:samples]
        return values / values.std()
    phi = float(kind)
    warm = int(12 / (1 - phi)) if phi else 0
    values = lfilter([1.0], [1.0, -phi], rng.normal(size=(samples + warm, width)), axis=0)
    return values[warm:] * np.sqrt(1 - phi ** 2)


def _top_quarter(values: np.ndarray) -> np.ndarray:
    return (values > np.quantile(values, 0.75)).astype(float)


def _bump(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    x = recording.variables['position'][:, drive]
    centre = np.quantile(x, rng.uniform(0.2, 0.8))
    return 'position', np.exp(-0.5 * ((x - centre) / (0.06 * np.ptp(x))) ** 2)


def _span(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    start = rng.uniform(3, DURATION - 8)
    return 'time', ((recording.time > start) & (recording.time < start + 5)).astype(float)


def _load(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    load = recording.variables['load'][:, drive]
    return 'load', (load - load.min()) / np.ptp(load)


def _slow(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    return 'velocity', (np.abs(recording.variables['velocity'][:, drive]) < 0.01).astype(float)


def _stribeck(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    v = recording.variables['velocity'][:, drive]
    return 'velocity', np.tanh(v / 0.001) * np.exp(-(v / 0.01) ** 2)


def _one_way(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    return 'direction', (recording.variables['velocity'][:, drive] > 0).astype(float)


def _friction(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    return 'direction', np.tanh(recording.variables['velocity'][:, drive] / 0.001)


def _line(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    return 'frequency', np.sin(2 * np.pi * rng.uniform(2, 30) * recording.time + rng.uniform(0, 6))


def _offset(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    return 'time', np.ones(len(recording))


def _ripple(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    x = recording.variables['position'][:, drive]
    return 'position', np.sin(2 * np.pi * x / np.ptp(x) * rng.uniform(4, 20))


def _viscous(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    v = recording.variables['velocity'][:, drive]
    return 'velocity', v / np.abs(v).max()


def _quarter(name: str) -> Callable[[Residuals, int, np.random.Generator], Planted]:
    def plant(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
        values = recording.variable(name, drive)
        assert values is not None
        return name, _top_quarter(values)
    return plant


def _rough(recording: Residuals, drive: int, rng: np.random.Generator) -> Planted:
    x = recording.variables['position'][:, drive]
    centre = np.quantile(x, rng.uniform(0.2, 0.8))
    return 'position', (np.abs(x - centre) < 0.1 * np.ptp(x)) * rng.normal(size=len(x))


PLANTS: dict[str, Callable[[Residuals, int, np.random.Generator], Planted]] = {
    'bump near a position': _bump, 'below 10 mm/s': _slow, 'below 10 mm/s, as friction': _stribeck,
    'in one direction': _one_way, 'friction': _friction, 'for 5 s': _span,
    'at a frequency': _line, 'growing with load': _load, 'offset': _offset,
    'ripple over position': _ripple, 'viscous': _viscous,
    'rod angle, top quarter': _quarter('rod_angle'),
    'platform x, top quarter': _quarter('platform_x'),
    'platform tilt, top quarter': _quarter('platform_tilt'),
    'rough near a position': _rough,
}


def states_anything(kind: float | str, seed: int) -> str:
    """Return the first statement on a perfect model with noise, or nothing."""
    recording = record_motion(seed)
    rng = np.random.default_rng((seed, 1))
    noisy = recording.measured + NOISE * make_noise(kind, len(recording), rng)
    found = localise(replace(recording, measured=noisy))[0]
    return f'[{found[0].evidence:.0f}] {found[0].text}' if found else ''


def misses(name: str, kind: float | str, seed: int) -> str:
    """Return what was said instead of the planted error, or nothing where that came first."""
    recording = record_motion(seed)
    rng = np.random.default_rng((seed, 2))
    drive = int(rng.integers(len(DRIVES)))
    variable, shape = PLANTS[name](recording, drive, rng)
    noisy = recording.measured + NOISE * make_noise(kind, len(recording), rng)
    noisy[:, drive] += ERROR * shape
    found = localise(replace(recording, measured=noisy))[0]
    if not found:
        return 'nothing said'
    right = (found[0].drive, found[0].variable) == (DRIVES[drive], variable)
    return '' if right else f'{DRIVES[drive]} meant, [{found[0].evidence:.0f}] {found[0].text}'


def outcome_of(case: tuple[str, float | str, int]) -> Outcome:
    """Return what is said of a case: planted error or 'noise', sort of noise, seed."""
    name, kind, seed = case
    said = states_anything(kind, seed) if name == 'noise' else misses(name, kind, seed)
    return {'planted': name, 'noise': kind, 'seed': seed, 'said': said}


def name_of(outcome: Outcome) -> tuple[str, float | str, int]:
    """Return the case of an outcome."""
    return outcome['planted'], outcome['noise'], outcome['seed']


def main() -> None:
    """Run what is missing, and print the table with what went wrong."""
    parser = scoring_parser(__doc__, 'localisation.jsonl')
    parser.add_argument('recordings', type=int, nargs='?', default=100)
    parser.add_argument('first_seed', type=int, nargs='?', default=100_000)
    parser.add_argument('what', nargs='?', default='')
    options = parser.parse_args()
    rows = [('noise', kind) for kind in NOISES if options.what in ('', 'noise')]
    rows += [(name, kind) for name in PLANTS for kind in PLANTED_NOISES
             if options.what in ('', 'planted') or options.what in name]
    seeds = range(options.first_seed, options.first_seed + options.recordings)
    cases = {(*row, seed): (*row, seed) for row in rows for seed in seeds}
    found = outcomes_of(options, outcome_of, cases, name_of,
                        lambda outcome: ' '.join(map(str, outcome.values())))
    said = {name_of(outcome): outcome['said'] for outcome in found}
    for name, kind in rows:
        every = [said[name, kind, seed] for seed in seeds if (name, kind, seed) in said]
        texts = [text for text in every if text]
        if name == 'noise':
            print(f'perfect model, noise {kind!s:6}: {len(texts):3} of {len(every)} say something')
        else:
            print(f'{name:27} noise {kind!s:5}: {len(every) - len(texts):3} of {len(every)} found '
                  'first')
        print(''.join(f'    {text}\n' for text in texts[:4]), end='')


if __name__ == '__main__':
    main()
