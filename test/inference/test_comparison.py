# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The numbers of `pprs compare`, the noise model behind them, and the verdict in words."""

from __future__ import annotations

import io
import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from made_up_diagnosis import NOISE, made_up_residuals, statement
from rich.console import Console
from scipy.signal import lfilter

from pprs_dynamics.app.report.comparison_report import comparison_view
from pprs_dynamics.inference.diagnosis.comparison import compare
from pprs_dynamics.inference.diagnosis.localisation import DriveFindings, Localisation, localise
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.profiles import error_profile, error_spectrum
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError

PERIOD = 0.01
NOWHERE = Localisation((), {})


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


def noise_of(residuals: Residuals) -> NoiseSpectrum:
    """Return the noise of the first drive."""
    regression = Regression(residuals)
    return regression.noise(regression.fit(()))[0]


@pytest.mark.parametrize('width', [1, 6])
def test_numbers_are_those_the_interface_defines(width: int) -> None:
    rng = np.random.default_rng(3)
    effort = rng.normal(5.0, 2.0, (200, width)) * (1 + np.arange(width))
    error = rng.normal(0.3, 0.1, (200, width))
    found = json.loads(json.dumps(compare(recording(error, effort), NOWHERE).to_dict()))
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
    numbers = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert numbers['drives']['drive_0']['relative'] is None
    assert numbers['overall']['relative'] is None
    assert 'constant' in found.drives['drive_0'].verdict


def test_a_model_without_error_leaves_nothing() -> None:
    effort = np.sin(np.arange(400) / 30)[:, None]
    found = compare(recording(np.zeros((400, 1)), effort))
    assert found.rms == 0
    assert found.drives['drive_0'].grade == 'noise'
    assert 'negligible' in found.drives['drive_0'].verdict


def test_noise_is_called_noise_and_an_error_beyond_it_is_not() -> None:
    rng = np.random.default_rng(6)
    time = PERIOD * np.arange(3000)
    effort = 3 * np.sin(0.7 * time)[:, None]
    noise = 0.05 * ar1(0.9, 3000, rng)[:, None]
    floors = {'drive_0': 0.05}
    quiet = compare(recording(noise, effort), floors=floors).drives['drive_0']
    assert quiet.grade == 'noise'
    assert quiet.verdict.endswith('noise')
    friction = 0.5 * np.sign(np.cos(time))[:, None]
    loud = compare(recording(noise + friction, effort), floors=floors).drives['drive_0']
    assert loud.grade == 'poor'
    # What is left is known to a few per cent: the noise model is fitted to 3000 samples.
    assert loud.unexplained == pytest.approx(0.5, rel=0.1)
    assert loud.verdict.endswith('poor')


def test_profiles_hold_the_mean_within_their_uncertainty() -> None:
    rng = np.random.default_rng(12)
    off = []
    for _ in range(20):
        noise = ar1(0.9, 3000, rng)[:, None]
        profile = error_profile(recording(noise + 0.7, np.zeros((3000, 1))), 0, 'position',
                                noise_of(recording(noise, np.zeros((3000, 1)))))
        assert profile is not None
        assert profile.samples.sum() == 3000
        off.append((profile.mean - 0.7) / profile.uncertainty)
    # The bins of one record go together; over twenty the spread is known to about a tenth.
    assert np.std(off) == pytest.approx(1.0, abs=0.3)


def test_spectrum_shows_a_vibration_at_its_frequency_above_the_background() -> None:
    rng = np.random.default_rng(13)
    time = PERIOD * np.arange(4000)
    error = (0.1 * rng.normal(size=4000) + 0.3 * np.sin(2 * np.pi * 12.5 * time))[:, None]
    residuals = recording(error, np.zeros_like(error))
    noise = localise(residuals).drives['drive_0'].noise
    assert noise is not None
    spectrum = error_spectrum(residuals, 0, noise)
    top = int(np.argmax(spectrum.power))
    assert spectrum.frequency[top] == pytest.approx(12.5, abs=0.05)
    quiet = np.abs(spectrum.frequency - 12.5) > 5
    assert np.median(spectrum.power[quiet] / spectrum.background[quiet]) == pytest.approx(
        1, abs=0.45)


def test_arrays_that_do_not_fit_are_refused_in_one_sentence() -> None:
    right = recording(np.zeros((50, 2)), np.ones((50, 2)))
    for change, words in [
            ({'model': np.zeros((50, 3))}, 'model: its shape is'),
            ({'measured': np.full((50, 2), np.nan)}, 'none was measured on any drive'),
            ({'variables': {'position': np.zeros(49)}}, "variables['position']"),
            ({'model': np.full((50, 2), np.inf)}, 'not finite')]:
        with pytest.raises(ResidualsError, match=words.replace('[', r'\[')):
            replace(right, **change)


def test_a_vibration_on_one_drive_is_told_and_no_noise() -> None:
    rng = np.random.default_rng(15)
    time = PERIOD * np.arange(4000)
    error = 0.05 * rng.normal(size=(4000, 6))
    error[:, 3] += 0.9 * np.sin(2 * np.pi * 6.1 * time)
    found = compare(recording(error, 3 * np.sin(0.7 * time)[:, None] * np.ones(6)),
                    floors={f'drive_{k}': 0.05 for k in range(6)})
    assert [(one.drive, one.variable) for one in found.localisation.statements] == [
        ('drive_3', 'frequency')]
    assert found.drives['drive_3'].grade == 'poor'
    assert 'all of it noise' not in found.verdict


def test_a_drive_that_drifts_far_more_than_its_peers_is_told() -> None:
    rng = np.random.default_rng(16)
    error = 0.05 * rng.normal(size=(4000, 6))
    error[:, 2] += 0.5 * ar1(0.995, 4000, rng)
    found = compare(recording(error, np.ones((4000, 6)) * np.sin(np.arange(4000) / 90)[:, None]))
    assert ('drive_2', 'time') in [(one.drive, one.variable)
                                   for one in found.localisation.statements]
    assert found.drives['drive_2'].grade != 'noise'


@pytest.mark.parametrize(('share', 'is_noise'), [(0.5, False), (0.05, True), (0.001, True)])
def test_what_a_statement_explains_is_never_put_down_to_noise(
    share: float, is_noise: bool,
) -> None:
    residuals = made_up_residuals()
    error = residuals.error[:, 1]
    told = replace(statement('slide_2'), mean_square=share * float(np.mean(error ** 2)))
    where = Localisation((told,), {name: DriveFindings((told,) if name == 'slide_2' else (), None)
                                   for name in residuals.drives})
    # A noise that would account for all of the error.
    found = compare(residuals, where, dict.fromkeys(residuals.drives, NOISE))
    drive = found.drives['slide_2']
    assert found.where == ((told,) if share >= 0.01 else ())
    assert ('except on slide_2' in found.verdict) is (is_noise and bool(found.where))
    assert (drive.grade == 'noise') is is_noise


@pytest.mark.parametrize('count', [0, 1, 12])
def test_verdict_places_and_next_step_fit_25_lines_of_80_columns(count: int) -> None:
    residuals = made_up_residuals()
    long = ('{}: 62% of its squared error lies at a position of slide_3 between -25.1 and 42.6 mm, '
            'in 82% of the time; it is shifted there by +0.0844 N in the direction of motion')
    told = tuple(replace(statement(name), text=long.format(name), mean_square=0.5 * NOISE ** 2)
                 for name in (*residuals.drives, *residuals.drives))[:count]
    found = compare(residuals, Localisation(told, {
        name: DriveFindings(tuple(one for one in told if one.drive == name), None)
        for name in residuals.drives}), dict.fromkeys(residuals.drives, NOISE))
    command = 'pprs diagnose a_recording_with_a_long_name.mcap --model robot.yaml --report why.html'

    def printed(details: bool) -> list[str]:
        screen = Console(width=80, file=io.StringIO())
        screen.print(comparison_view(found, ('Find out why', command), details))
        assert isinstance(screen.file, io.StringIO)
        return screen.file.getvalue().splitlines()

    short, whole = printed(False), printed(True)
    # The command adds a finding of a recording and the name of the page.
    assert len(short) <= 25 - 2
    assert max(map(len, [*short, *whole])) <= 80
    assert ('Next' in ' '.join(short)) is (count > 0)
    assert ('--details' in ' '.join(short)) is (count == 12)
    assert all(one.text in ' '.join(' '.join(whole).split()) for one in found.where)
