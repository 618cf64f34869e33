# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The numbers of `pprs compare`, the noise model behind them, and the verdict in words."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scores import localisation as benchmark
from pprs_dynamics.inference.diagnosis.comparison import compare, localise
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError

PERIOD = 0.01
NOWHERE: tuple = ((), {})


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
    assert found.drives['drive_0'].grade == 'poor'


def test_noise_is_called_noise_and_an_error_beyond_it_is_not() -> None:
    rng = np.random.default_rng(6)
    time = PERIOD * np.arange(3000)
    effort = 3 * np.sin(0.7 * time)[:, None]
    noise = 0.05 * benchmark.make_noise(0.9, 3000, rng, 1)
    floors = {'drive_0': 0.05}
    quiet = compare(recording(noise, effort), floors=floors).drives['drive_0']
    assert quiet.grade == 'noise'
    friction = 0.5 * np.sign(np.cos(time))[:, None]
    loud = compare(recording(noise + friction, effort), floors=floors).drives['drive_0']
    assert loud.grade == 'poor'
    # What is left is known to a few per cent: the noise model is fitted to 3000 samples.
    assert loud.unexplained == pytest.approx(0.5, rel=0.1)


def test_efforts_that_cannot_be_compared_are_refused_in_one_sentence() -> None:
    right = recording(np.zeros((50, 2)), np.ones((50, 2)))
    for change, words in [
            ({'measured': np.full((50, 2), np.nan)}, 'none was measured on any drive'),
            ({'model': np.full((50, 2), np.inf)}, 'not finite')]:
        with pytest.raises(ResidualsError, match=words):
            replace(right, **change)


# Where the model fails: nothing is said of noise, and a planted error is named first.

FIRST_SEED = 40_000  # none of the benchmark's


def noisy(seed: int, kind: float | str = 0.9) -> Residuals:
    """Return a recording of a perfect model with correlated noise of 0.08 N."""
    recording = benchmark.record_motion(seed)
    noise = benchmark.make_noise(kind, len(recording), np.random.default_rng((seed, 3)))
    return replace(recording, measured=recording.measured + 0.08 * noise)


def test_a_perfect_model_with_correlated_noise_is_seldom_accused() -> None:
    said = [text for k, kind in enumerate((0.0, 0.9, 0.97, 0.99) * 2)
            if (text := benchmark.states_anything(kind, FIRST_SEED + k))]
    # At a rate of 2 % two or more of 8 come about once in a hundred times.
    assert len(said) <= 1, said


@pytest.mark.parametrize('name', [
    'bump near a position', 'below 10 mm/s', 'in one direction', 'friction', 'for 5 s',
    'at a frequency', 'growing with load', 'offset'])
def test_a_planted_error_is_named_first_with_its_drive_and_variable(name: str) -> None:
    seed = FIRST_SEED + 100 + list(benchmark.PLANTS).index(name)
    assert benchmark.misses(name, 0.9, seed) == ''


def test_missing_samples_and_segments_do_not_hide_an_error_nor_make_one() -> None:
    clean = noisy(FIRST_SEED + 202)
    rng = np.random.default_rng(5)
    measured = clean.measured.copy()
    measured[rng.random(measured.shape) < 0.03] = np.nan
    measured[1000:1200, 2] = np.nan
    segment = (clean.time > 25).astype(int)
    holed = replace(clean, measured=measured, segment=segment)
    assert localise(holed)[0] == ()
    load = clean.variables['load'][:, 2]
    measured[:, 2] += 0.4 * (load - load.min()) / np.ptp(load)
    first = localise(replace(holed, measured=measured))[0][0]
    assert (first.drive, first.variable) == ('slide_3', 'load')
