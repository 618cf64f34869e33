"""The numbers of `pprs compare`, the noise model behind them, and the verdict in words."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from pprs_dynamics.diagnosis.noise import (
    effective_samples,
    find_repetition,
    fit_noise,
    unrepeated,
)
from scipy.signal import lfilter

from pprs_dynamics.diagnosis.comparison import compare
from pprs_dynamics.diagnosis.localisation import Localisation
from pprs_dynamics.residuals.profiles import error_profile, error_spectrum
from pprs_dynamics.residuals.residuals import Residuals, ResidualsError

PERIOD = 0.01
NOWHERE = Localisation((), {}, np.inf)


def ar1(phi: float, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Return AR(1) noise of unit variance, long after its start."""
    warm = int(12 / (1 - phi))
    y = lfilter([1.0], [1.0, -phi], rng.normal(size=samples + warm))[warm:]
    return np.asarray(y * np.sqrt(1 - phi ** 2))


def recording(error: np.ndarray, effort: np.ndarray) -> Residuals:
    """Return drives whose measured effort is `effort` and whose model misses it by `error`."""
    samples, width = error.shape
    time = PERIOD * np.arange(samples)
    model = effort - error
    return Residuals(
        tuple(f'drive_{k}' for k in range(width)), time, np.zeros(samples, dtype=int), effort,
        model, {'rigid_body': 0.9 * model, 'passive_friction': 0.1 * model},
        {'position': np.stack([np.sin(time + k) for k in range(width)], axis=1),
         'velocity': np.stack([np.cos(time + k) for k in range(width)], axis=1)}, PERIOD)


@pytest.mark.parametrize('width', [1, 6])
def test_numbers_are_those_the_interface_defines(width: int) -> None:
    rng = np.random.default_rng(3)
    effort = rng.normal(5.0, 2.0, (200, width)) * (1 + np.arange(width))
    error = rng.normal(0.3, 0.1, (200, width))
    found = json.loads(json.dumps(compare(recording(error, effort), NOWHERE).to_json()))
    assert list(found['drives']) == [f'drive_{k}' for k in range(width)]
    for k, numbers in enumerate(found['drives'].values()):
        rms = np.sqrt((error[:, k] ** 2).sum() / 200)
        assert numbers == pytest.approx({
            'rms': rms, 'relative': rms / np.std(effort[:, k]), 'bias': error[:, k].sum() / 200,
            'peak': max(abs(error[:, k]))})
    assert found['overall']['rms'] == pytest.approx(np.sqrt((error ** 2).mean()))
    pooled = np.sqrt((error ** 2).sum() / ((effort - effort.mean(axis=0)) ** 2).sum())
    assert found['overall']['relative'] == pytest.approx(pooled)
    assert found['where'] == []


def test_what_was_not_measured_does_not_count() -> None:
    rng = np.random.default_rng(4)
    effort, error = rng.normal(size=(300, 2)), rng.normal(size=(300, 2))
    full = recording(error, effort)
    holes = full.measured.copy()
    holes[100:250, 0] = np.nan
    holes[:, 1] = np.nan
    found = compare(replace(full, measured=holes), NOWHERE)
    kept = np.r_[0:100, 250:300]
    assert list(found.drives) == ['drive_0']
    assert found.drives['drive_0'].samples == 150
    assert found.rms == pytest.approx(np.sqrt(np.mean(error[kept, 0] ** 2)))


def test_a_constant_effort_has_no_relative_error_and_raises_no_warning() -> None:
    still = recording(np.full((200, 1), 0.1), np.full((200, 1), 13.0))
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        found = compare(still, NOWHERE)
    numbers = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert numbers['drives']['drive_0']['relative'] is None
    assert numbers['overall']['relative'] is None
    assert 'constant' in found.drives['drive_0'].verdict


def test_a_model_without_error_leaves_nothing() -> None:
    effort = np.sin(np.arange(400) / 30)[:, None]
    found = compare(recording(np.zeros((400, 1)), effort))
    assert found.rms == 0
    assert found.drives['drive_0'].grade == 'noise'
    assert 'nothing' in found.drives['drive_0'].verdict


def test_noise_is_called_noise_and_an_error_beyond_it_is_set_against_the_models_parts() -> None:
    rng = np.random.default_rng(6)
    time = PERIOD * np.arange(3000)
    effort = 3 * np.sin(0.7 * time)[:, None]
    noise = 0.05 * ar1(0.9, 3000, rng)[:, None]
    quiet = compare(recording(noise, effort)).drives['drive_0']
    assert quiet.grade == 'noise'
    assert quiet.verdict.startswith('drive_0: the model leaves')
    friction = 0.5 * np.sign(np.cos(time))[:, None]
    loud = compare(recording(noise + friction, effort)).drives['drive_0']
    assert loud.grade == 'poor'
    # What is left is known to a few per cent: the noise model is fitted to 3000 samples.
    assert loud.unexplained == pytest.approx(0.5, rel=0.1)
    assert loud.noise_floor < 0.1
    assert 'more than passive friction contributes' in loud.verdict


@pytest.mark.parametrize('phi', [0.0, 0.9, 0.97])
def test_effective_samples_of_ar1_noise_follow_its_correlation(phi: float) -> None:
    rng = np.random.default_rng(7)
    found = [effective_samples(fit_noise(ar1(phi, 8000, rng), [slice(0, 8000)]), 8000)
             for _ in range(9)]
    # phi is known to sqrt((1 - phi^2) / N), which at 0.97 is 9 % of 1 - phi, and thrice that
    # over nine records' median is ample.
    assert np.median(found) == pytest.approx(8000 * (1 - phi) / (1 + phi), rel=0.15)


def test_noise_near_a_unit_root_is_not_taken_for_faster_noise() -> None:
    rng = np.random.default_rng(8)
    distance = [fit_noise(ar1(0.998, 4000, rng), [slice(0, 4000)]).filter.sum()
                for _ in range(30)]
    # Yule-Walker on these records gives about 0.004; what is true is 0.002.
    assert 0.001 < np.median(distance) < 0.0032


@pytest.mark.parametrize('phi', [0.0, 0.97])
def test_whitened_noise_is_white_of_unit_variance_also_across_segments(phi: float) -> None:
    rng = np.random.default_rng(9)
    stretches = [slice(0, 1500), slice(1500, 1600), slice(1650, 4000)]
    noise = np.concatenate([ar1(phi, 1500, rng), ar1(phi, 100, rng), np.zeros(50),
                            ar1(phi, 2350, rng)])
    model = fit_noise(noise, stretches)
    white = model.whiten(noise, stretches)
    assert np.all(white[1600:1650] == 0)
    used = np.concatenate([white[part] for part in stretches])
    # Variance of N samples is known to sqrt(2 / N) = 0.023, a correlation to 1 / sqrt(N) = 0.016.
    assert used.var() == pytest.approx(1, abs=0.1)
    for lag in (1, 5, 50):
        assert abs(np.mean(used[lag:] * used[:-lag])) < 0.07


def test_what_does_not_repeat_is_the_noise_of_a_periodic_motion() -> None:
    rng = np.random.default_rng(11)
    time = PERIOD * np.arange(4000)
    turn = 2 * np.pi * time / 6.4
    positions = np.stack((np.sin(turn), np.cos(turn) + 0.5 * np.sin(3 * turn)), axis=1)
    assert find_repetition(positions + 1e-6 * rng.normal(size=positions.shape)) == 640
    error = np.sin(turn) + 0.1 * rng.normal(size=4000)
    assert unrepeated(error, 640) == pytest.approx(0.1, rel=0.06)
    assert find_repetition(np.cumsum(rng.normal(size=(4000, 2)), axis=0)) is None


def test_profiles_hold_the_mean_within_their_uncertainty() -> None:
    rng = np.random.default_rng(12)
    off = []
    for _ in range(20):
        noise = ar1(0.9, 3000, rng)[:, None]
        profile = error_profile(recording(noise + 0.7, np.zeros((3000, 1))), 0, 'position',
                                fit_noise(noise[:, 0], [slice(0, 3000)]))
        assert profile is not None
        assert profile.samples.sum() == 3000
        off.append((profile.mean - 0.7) / profile.uncertainty)
    # The bins of one record go together; over twenty the spread is known to about a tenth.
    assert np.std(off) == pytest.approx(1.0, abs=0.3)


def test_spectrum_shows_a_vibration_at_its_frequency_above_the_background() -> None:
    rng = np.random.default_rng(13)
    time = PERIOD * np.arange(4000)
    error = (0.1 * rng.normal(size=4000) + 0.3 * np.sin(2 * np.pi * 12.5 * time))[:, None]
    spectrum = error_spectrum(recording(error, np.zeros_like(error)), 0)
    top = int(np.argmax(spectrum.power))
    assert spectrum.frequency[top] == pytest.approx(12.5, abs=0.05)
    quiet = np.abs(spectrum.frequency - 12.5) > 5
    assert np.median(spectrum.power[quiet] / spectrum.background[quiet]) == pytest.approx(
        1, abs=0.45)


def test_arrays_that_do_not_fit_are_refused_in_one_sentence() -> None:
    right = recording(np.zeros((50, 2)), np.ones((50, 2)))
    for change, words in [
            ({'model': np.zeros((50, 3))}, 'model: its shape is'),
            ({'measured': np.full((50, 2), np.nan)}, 'no effort was measured'),
            ({'variables': {'position': np.zeros(49)}}, "variables['position']"),
            ({'model': np.full((50, 2), np.inf)}, 'not finite')]:
        with pytest.raises(ResidualsError, match=words.replace('[', r'\[')):
            replace(right, **change)
