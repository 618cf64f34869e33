# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""From recordings to residuals: with a perfect model, what remains is the sensors' noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from pprs_dynamics import DriveModel
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.reconstruction import reconstruct
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.paths import Excitation

RATE, DURATION, NOISE, ENCODER = 500.0, 20.0, 0.08, 1e-6
# The reconstruction itself leaves 0.001 N, which under 0.03 N of treated noise adds 0.1 %.
SAME = 0.02


def recorded(seed: int, correlation: float) -> tuple[Recording, np.ndarray]:
    """Return a recording of a robot that the model explains, and the noise of its efforts."""
    time = np.arange(0, DURATION, 1 / RATE)
    forces = DriveModel.load().drive_forces(Excitation(DURATION, seed=seed).motion(time))
    rng = np.random.default_rng(seed)
    news = rng.normal(scale=NOISE * np.sqrt(1 - correlation ** 2), size=(len(time), 6))
    noise = lfilter([1.0], [1.0, -correlation], news, axis=0)
    position = np.round(forces.mechanism.position / ENCODER) * ENCODER
    return Recording.from_arrays(f'run {seed}', time, position, None, forces.total + noise), noise


@pytest.mark.parametrize('correlation', [0.0, 0.97])
def test_a_perfect_model_leaves_the_noise_treated_the_same_way(correlation: float) -> None:
    recording, noise = recorded(21, correlation)
    residuals, _ = measure_residuals(DriveModel.load(), [recording])
    reconstruction = reconstruct(DriveModel.load(), recording)
    expected = reconstruction.treat(noise[reconstruction.index])
    found = np.sqrt(np.mean(residuals.error ** 2, axis=0))
    np.testing.assert_allclose(found, np.sqrt(np.mean(expected ** 2, axis=0)), rtol=SAME)
    difference = residuals.error - expected
    assert np.sqrt(np.mean(difference ** 2, axis=0)).max() < 0.005


def test_recordings_follow_each_other_as_segments_of_their_own() -> None:
    recordings = [recorded(seed, 0.0)[0] for seed in (23, 24)]
    both, notes = measure_residuals(DriveModel.load(), recordings)
    alone = [measure_residuals(DriveModel.load(), [recording])[0] for recording in recordings]
    assert np.all(np.diff(both.time) > 0)
    np.testing.assert_array_equal(np.unique(both.segment), [0, 1])
    np.testing.assert_array_equal(both.record, both.segment)
    for number, single in enumerate(alone):
        part = both.segment == number
        np.testing.assert_array_equal(both.error[part], single.error)
        for name, values in single.variables.items():
            np.testing.assert_array_equal(both.variables[name][part], values)
    assert len(notes) >= 4


def test_noise_goes_on_through_the_gaps_of_a_recording() -> None:
    recording = recorded(23, 0.0)[0]
    kept = (recording.time < 8.0) | (recording.time > 9.0)
    cut = Recording.from_arrays('cut', recording.time[kept], recording.position[kept], None,
                                recording.effort[kept])
    residuals, _ = measure_residuals(DriveModel.load(), [cut, recording])
    np.testing.assert_array_equal(np.unique(residuals.segment), [0, 1, 2])
    np.testing.assert_array_equal(residuals.record, np.maximum(residuals.segment - 1, 0))
