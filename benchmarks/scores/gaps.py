# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What gaps in a recording do to the likelihood: constants, noise floor, and claims on nothing.

    python -m benchmarks.scores.gaps
    python -m benchmarks.scores.gaps --diagnoses 12

Noise and nothing else, on six drives over 40 s, whole and with the efforts of twenty rests masked
(or of single samples). Each figure should be the same in every row of one colour.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.hidden.recordings import DURATION, PINK, Case, make_case
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.simulation.sensors import EffortNoise, SensorSettings

PERIOD, DRIVES, RECORDINGS = 0.01, 6, 20
PER_MEAN = 5  # samples at full rate, of which a mean is taken
RESTS, RESTING = 20, 0.5  # and the share of the time that they take
LOST = 0.3  # of single samples
COLOURS = {'white': SensorSettings(white_noise=0.08, coloured_noise=0.0),
           'AR(1) 0.997': SensorSettings(white_noise=0.0, coloured_noise=0.08,
                                         noise_correlation=0.997 ** (1 / PER_MEAN)),
           '1/f': SensorSettings(white_noise=0.0, coloured_noise=0.0, pink_noise=0.08)}
Mask = Callable[[np.random.Generator, int], np.ndarray]


def rests(rng: np.random.Generator, samples: int) -> np.ndarray:
    """Return where a drive that rests from time to time is not measured, (M,)."""
    moves, stands = (share * rng.dirichlet(np.full(RESTS + extra, 5.0)) for share, extra in (
        (1 - RESTING, 1), (RESTING, 0)))
    edges = np.cumsum(np.concatenate([*np.column_stack((moves[:-1], stands)), moves[-1:]]))
    at = np.searchsorted(edges, (np.arange(samples) + 0.5) / samples)
    return np.asarray(at % 2 == 1)


def lost(rng: np.random.Generator, samples: int) -> np.ndarray:
    """Return where single samples are lost, (M,)."""
    return np.asarray(rng.random(samples) < LOST)


def whole(rng: np.random.Generator, samples: int) -> np.ndarray:
    """Return that nothing is missing, (M,)."""
    return np.zeros(samples, dtype=bool)


MASKS: dict[str, Mask] = {'whole': whole, '20 rests': rests, '30 % lost': lost}


def measure(settings: SensorSettings, mask: Mask) -> tuple[float, float]:
    """Return the share of constants beyond three deviations, and floor over true noise."""
    beyond, floors = [], []
    samples = round(DURATION / PERIOD)
    for seed in range(RECORDINGS):
        rng = np.random.default_rng((seed, 47))
        full = EffortNoise(settings, rng).samples(PER_MEAN * samples)
        noise = full.reshape(samples, PER_MEAN, DRIVES).mean(axis=1)
        true = np.sqrt(np.mean(noise ** 2, axis=0))
        measured = np.where(mask(rng, samples)[:, None], np.nan, noise)
        regression = Regression(Residuals(
            tuple(f'drive_{d}' for d in range(DRIVES)), PERIOD * np.arange(samples),
            np.zeros(samples, dtype=int), measured, np.zeros_like(noise), {}, {}, PERIOD))
        alone = regression.fit(())
        for d in range(DRIVES):
            constant = regression.block({d: np.ones((1, samples))}, 1e-12 * np.eye(1))
            fit = regression.at((constant,), alone.amplitudes)
            place = fit.places[constant].start
            beyond.append(abs(fit.coefficients[place]) > 3 * np.sqrt(fit.covariance[place, place]))
            floors.append(regression.noise_floor(alone, d) / true[d])
    return float(np.mean(beyond)), float(np.median(floors))


def claims(mask: Mask, recordings: int, first: int = 0) -> int:
    """Return in how many recordings of 1/f noise and nothing else something is claimed."""
    claimed = 0
    for seed in range(first, first + recordings):
        model, recording, _ = make_case(Case('nothing', (), seed, noise=PINK))
        rng = np.random.default_rng((seed, 48))
        gone = mask(rng, len(recording.time))[:, None]
        found = diagnose(model, [replace(recording, effort=np.where(
            gone, np.nan, recording.effort))])
        claimed += found.verdict != 'adequate'
        print(f'  {seed}: {found.verdict} {[one.name for one in found.effects]}', flush=True)
    return claimed


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--diagnoses', type=int, default=0, metavar='N',
                        help='recordings of nothing that are diagnosed for each mask (default 0)')
    parser.add_argument('--first', type=int, default=0, help='first seed (default 0)')
    options = parser.parse_args()
    for name, mask in MASKS.items():
        for colour, settings in COLOURS.items():
            beyond, floor = measure(settings, mask)
            print(f'{name:10} {colour:12} constants beyond 3 deviations {beyond:6.1%}   '
                  f'floor / true noise {floor:.3f}', flush=True)
    for name in ('whole', '20 rests') if options.diagnoses else ():
        print(f'{name:10} claimed {claims(MASKS[name], options.diagnoses, options.first)} of '
              f'{options.diagnoses}')


if __name__ == '__main__':
    main()
