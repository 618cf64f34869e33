# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The noise spectrum: it is that of the noise, whatever its colour, and so are its bands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import lfilter

from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.residuals.bands import DriveSeries, FrequencyBands
from pprs_dynamics.inference.residuals.noise import NoiseShapes, NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import Residuals

PERIOD = 0.01


def ar1(phi: float, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Return AR(1) noise of unit variance, long after its start."""
    warm = int(12 / (1 - phi))
    y = lfilter([1.0], [1.0, -phi], rng.normal(size=samples + warm))[warm:]
    return np.asarray(y * np.sqrt(1 - phi ** 2))


def recording(noise: np.ndarray, segment: np.ndarray | None = None) -> Residuals:
    """Return drives that are left with nothing but noise (N, D)."""
    samples, width = noise.shape
    return Residuals(tuple(f'drive_{k}' for k in range(width)), PERIOD * np.arange(samples),
                     np.zeros(samples, dtype=int) if segment is None else segment, noise,
                     np.zeros_like(noise), {}, {}, PERIOD)


def fitted(noise: np.ndarray) -> tuple[Regression, JointFit]:
    regression = Regression(recording(noise))
    return regression, regression.fit(())


def ar1_power(phi: float, frequency: np.ndarray) -> np.ndarray:
    """Return the variance of a DCT coefficient of AR(1) noise of unit variance."""
    return (1 - phi ** 2) / np.abs(1 - phi * np.exp(-2j * np.pi * frequency * PERIOD)) ** 2


@pytest.mark.parametrize('phi', [0.0, 0.9, 0.997])
def test_the_spectrum_is_that_of_ar1_noise_at_every_frequency(phi: float) -> None:
    rng = np.random.default_rng(1)
    frequency = np.geomspace(0.1, 40, 12)
    found = []
    for _ in range(4):
        regression, fit = fitted(np.stack([ar1(phi, 4000, rng) for _ in range(6)], axis=1))
        found += [noise.power(frequency) for noise in regression.noise(fit).values()]
    ratio = np.array(found) / ar1_power(phi, frequency)
    # 24 records; the lowest of these frequencies has a few dozen coefficients in each.
    assert np.median(ratio, axis=0) == pytest.approx(np.ones(12), abs=0.35)
    rms = [noise.rms for noise in regression.noise(fit).values()]
    assert np.median(rms) == pytest.approx(1.0, rel=0.25 if phi > 0.99 else 0.06)


@pytest.mark.parametrize('phi', [0.0, 0.9, 0.97])
def test_whitened_noise_is_white_of_unit_variance_also_across_segments(phi: float) -> None:
    rng = np.random.default_rng(3)
    noise = np.concatenate([ar1(phi, 1500, rng), ar1(phi, 2500, rng)])[:, None]
    segment = (np.arange(4000) >= 1500).astype(int)
    regression = Regression(recording(noise, segment))
    fit = regression.fit(())
    white = regression.whitened(fit, 0, noise[:, 0])
    assert white.var() == pytest.approx(1, abs=0.1)
    for lag in (1, 5, 50):
        assert abs(np.mean(white[lag:] * white[:-lag])) < 0.07


@pytest.mark.parametrize('seed', range(3))
def test_no_other_amplitudes_have_a_higher_likelihood(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bands = FrequencyBands(40.0, PERIOD)
    shapes = NoiseShapes(bands)
    counts = np.maximum(np.round(np.diff(np.clip(bands.edges, 0, 0.5 / PERIOD)) * 80), 1.0)
    true = np.zeros(len(shapes.at_bands))
    true[0] = 1.0
    true[rng.integers(1, len(true), 2)] = 10 ** rng.uniform(0, (4, 3))
    squares = true @ shapes.at_bands * rng.chisquare(counts)
    found = shapes.fitted(shapes.start(squares[None], counts[None]), squares[None], counts[None],
                          np.zeros((1, len(counts))))[0]
    phi = shapes.at_bands[:, 1:]

    def deviance(amplitudes: np.ndarray) -> tuple[float, np.ndarray]:
        power = amplitudes @ phi
        ratio = squares[1:] / power
        return (float(np.sum(counts[1:] * np.log(power) + ratio)),
                phi @ ((counts[1:] - ratio) / power))
    lowest = min(minimize(deviance, start, jac=True, method='L-BFGS-B',
                          bounds=[(1e-9, None)] * len(true), options={'maxiter': 3000}).fun
                 for start in (np.ones(len(true)), found, np.maximum(true, 1e-6)))
    assert deviance(found)[0] - lowest < 1e-3


def walk(rng: np.random.Generator) -> np.ndarray:
    return 0.1 * np.cumsum(rng.normal(size=2000))


def falling(exponent: float, rng: np.random.Generator) -> np.ndarray:
    """Return 1 / f^exponent noise of unit variance that goes on 16 times as long as its record."""
    root = np.maximum(np.arange(16001), 1) ** (exponent / 2)
    spectrum = (rng.normal(size=len(root)) + 1j * rng.normal(size=len(root))) / root
    spectrum[0] = 0
    y = np.fft.irfft(spectrum)
    first = rng.integers(0, len(y) - 2000)
    return np.asarray(y[first:first + 2000] / y.std())


NOISES = {
    'white': lambda rng: rng.normal(size=2000),
    'AR(1)': lambda rng: ar1(0.9, 2000, rng),
    'slow AR(1)': lambda rng: ar1(0.998, 2000, rng),
    'slow AR(1) and white': lambda rng: rng.normal(size=2000) + 0.3 * ar1(0.98, 2000, rng),
    '1/f': lambda rng: falling(1.0, rng),
    '1/f and white': lambda rng: falling(1.0, rng) + rng.normal(size=2000),
    'walk': walk,
    'walk and white': lambda rng: walk(rng) + 3 * rng.normal(size=2000),
}


@pytest.mark.parametrize('alike', [2, 8])
def test_constants_stand_out_of_noise_as_seldom_as_a_normal_law_says(alike: int) -> None:
    """A normal law has 0.27 % beyond three deviations; of one drive of 1/f noise it was 11 %."""
    rng, draws = np.random.default_rng(12), 200
    noise = np.stack([draw(rng) for draw in NOISES.values() for _ in range(draws)], axis=1)
    fits = [fitted(noise[:, k:k + alike])[1] for k in range(0, noise.shape[1], alike)]
    squares, power = (np.concatenate([getattr(fit, name)[:, 0] for fit in fits])
                      for name in ('squares', 'spectra'))
    beyond = (squares > 9 * power).reshape(len(NOISES), draws).mean(axis=1)
    shares = dict(zip(NOISES, beyond, strict=True))
    assert beyond.mean() <= 0.01, shares
    assert max(shares.values()) <= 0.03, shares  # of 200
    # An offset of four deviations of white noise is hardly less for what the noise may be else.
    assert np.median(4 / np.sqrt(power[:draws])) > 3.4


@pytest.mark.parametrize('drifting', [1, 5])
def test_drives_that_drift_hide_no_offset_of_a_sound_one(drifting: int) -> None:
    """Of four deviations 0.5 counted where all five peers drift, by their median slope."""
    rng = np.random.default_rng(12)
    spectra = np.array([fitted(np.column_stack([
        walk(rng) if k < drifting else rng.normal(size=2000) for k in range(6)]))[1].spectra[:, 0]
        for _ in range(40)])
    assert np.median(4 / np.sqrt(spectra[:, drifting:])) > 3
    assert np.median(spectra[:, :drifting]) > 1000  # of a drive that drifts itself


def test_a_vibration_is_no_noise() -> None:
    rng = np.random.default_rng(5)
    time = PERIOD * np.arange(4000)
    noise = 0.05 * rng.normal(size=(4000, 1))
    line = 0.9 * np.sin(2 * np.pi * 6.1 * time)[:, None]
    regression, fit = fitted(noise + line)
    power = regression.noise(fit)[0].power(np.array([6.1]))[0]
    # The line puts 0.4 N^2 into three of 4000 coefficients: a hundred times what S can follow.
    assert power < 0.01 * 4000 * 0.9 ** 2 / 6


def test_the_rms_is_that_of_the_spectrum() -> None:
    noise = NoiseSpectrum(np.array([0.5, 4.0]), np.array([0.3, 40.0, 2.0]), PERIOD)
    frequency = (np.arange(200_000) + 0.5) / 200_000 * 0.5 / PERIOD
    assert noise.rms ** 2 == pytest.approx(np.mean(noise.power(frequency)), rel=1e-4)


def test_a_regression_spends_leverage_and_does_not_hide_noise_by_it() -> None:
    rng = np.random.default_rng(8)
    found = []
    for _ in range(5):
        noise = rng.normal(size=(1000, 1))
        regression = Regression(recording(noise))
        columns = regression.block({0: rng.normal(size=(200, 1000))})
        fit = regression.fit((columns,))
        found.append(regression.noise(fit)[0].rms)
    # Without leverage it would be sqrt(1 - 200 / 1000) = 0.89.
    assert np.mean(found) == pytest.approx(1.0, abs=0.03)


def with_rests(noise: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return noise (N, D) that is not known in twenty rests, half of the time."""
    at = np.sort(rng.choice(np.arange(60, len(noise) - 60, 40), 40, replace=False))
    holed = noise.copy()
    for first, last in at.reshape(-1, 2):
        holed[first:last] = np.nan
    return holed


@pytest.mark.parametrize('is_cut', [False, True])
def test_the_transform_is_orthonormal_over_whatever_was_measured(is_cut: bool) -> None:
    rng = np.random.default_rng(10)
    holed = with_rests(rng.normal(size=(3000, 1)), rng)
    holed[rng.random(3000) < 0.2] = np.nan
    number = np.arange(3000) // 1000
    residuals = replace(recording(holed, number), record=0 * number if is_cut else number)
    series = DriveSeries(residuals, 0, FrequencyBands.for_residuals(residuals))
    assert np.isfinite(holed[series.index]).all()
    assert len(series) > 0.95 * np.isfinite(holed).sum()
    matrix = series.transform(np.eye(len(series)))
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(len(series)), atol=1e-12)
    np.testing.assert_allclose(series.inverse(matrix), np.eye(len(series)), atol=1e-12)
    # The constant of each record, and no mean of a stretch between.
    assert len(series.stretches) > 15
    assert series.counts[0] == (1 if is_cut else 3)


@pytest.mark.parametrize('samples', [541, 1000])
@pytest.mark.parametrize('first', [0, 1])
def test_efforts_at_half_the_rate_are_one_stretch_and_count_once(samples: int, first: int) -> None:
    noise = np.random.default_rng(11).normal(size=(samples, 1))
    noise[first::2] = np.nan
    residuals = replace(recording(noise), measured=noise)
    series = DriveSeries(residuals, 0, FrequencyBands.for_residuals(residuals))
    assert len(series.stretches) == 1
    assert len(series) > 0.45 * samples
    assert series.frequency[-1] <= 0.25 / PERIOD
    assert np.isfinite(series.error).all()


@pytest.mark.parametrize('every', [1, 20])
def test_the_noise_is_that_of_the_samples_that_were_measured(every: int) -> None:
    rng = np.random.default_rng(13)
    noise = rng.normal(size=(4000 * every, 6))
    noise[rng.random(noise.shape) < 0.3] = np.nan
    noise[np.arange(len(noise)) % every > 0] = np.nan
    regression, fit = fitted(noise)
    floors = [regression.noise_floor(fit, d) for d in regression.drives]
    # 17 000 samples: half a per cent. Bridged samples that count made it 0.93.
    assert np.mean(floors) == pytest.approx(1.0, abs=0.02)


def test_a_drive_without_any_noise_has_finite_noise() -> None:
    shapes = NoiseShapes(FrequencyBands(20.0, PERIOD))
    bands = shapes.at_bands.shape[1]
    nothing, counts = np.zeros((1, bands)), np.full((1, bands), 10.0)
    with np.errstate(all='raise'):
        found = shapes.fitted(shapes.start(nothing, counts), nothing, counts,
                              np.ones((1, bands)))
        weights = 1 / (found @ shapes.at_bands) ** 2
    assert np.isfinite(weights).all()
    assert (found > 0).all()
