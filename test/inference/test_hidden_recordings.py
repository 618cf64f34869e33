# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The recordings that the diagnosis is scored on, their strength, and what counts as right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden import motions, recordings
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.physics.model.drive_model import DriveModel

pytestmark = pytest.mark.slow


@pytest.mark.parametrize('seed', range(2))
def test_random_motions_are_exact_and_keep_the_limits(
    seed: int,
) -> None:
    model = recordings.tolerant_model(0.05)
    path = motions.draw_motion(model, seed, 8.0)
    time = np.arange(0.0, 8.0, 0.001)
    state = model.mechanism(path.motion(time))
    model.limits.check_strokes(state.position)
    for values, rates in ((state.position, state.velocity), (state.velocity, state.acceleration)):
        differences = np.gradient(values, time, axis=0)[2:-2]
        assert np.abs(differences - rates[2:-2]).max() < 1e-4 * np.abs(rates).max()
    assert np.ptp(state.position, axis=0).min() > 0.01
    if path.from_rest:
        assert np.abs(state.velocity[[0]]).max() == 0.0
    if path.period:
        later = model.mechanism(path.motion(time + path.period))
        np.testing.assert_allclose(later.position, state.position, atol=1e-9)


def test_a_robot_with_nothing_hidden_is_explained_by_its_own_numbers(

) -> None:
    case = recordings.Case('nothing', (), 3, width=1.0, duration=8.0)
    model, recording, truth = recordings.make_case(case)
    robot = DriveModel.from_parameters({**model.values, **truth['robot']})
    found = np.sqrt(np.mean(measure_residuals(robot, [recording])[0].error ** 2))
    assert found < 1.1 * truth['noise_floor']
    for key, value in truth['robot'].items():
        off = np.divide(value, model.values[key]) - 1
        assert 0 < np.abs(off).max() <= truth['tolerance']
        assert model.values[f'tolerances.{key}'] == truth['tolerance']


@pytest.mark.parametrize('names', [('drive_spring',), ('time_delay', 'payload_mass')])
def test_a_case_has_the_strength_it_promises_and_repeats(
    tmp_path: Path, names: tuple[str, ...],
) -> None:
    case = recordings.Case('effects', names, 3, 1.0, duration=8.0)
    model, recording, truth = recordings.make_case(case)
    assert [effect['name'] for effect in truth['effects']] == list(names)
    for effect in truth['effects']:
        assert effect['snr'] == pytest.approx(1.0, rel=0.05)
        pooled = np.sqrt(np.mean(np.square(effect['snr_by_drive'])))
        assert pooled == pytest.approx(effect['snr'], rel=1e-6)
    path = recordings.save_case(tmp_path, case)
    kept, again, same = recordings.load_case(path)
    assert same == truth
    assert kept.values == model.values
    np.testing.assert_array_equal(again.position, recording.position)
    np.testing.assert_allclose(again.effort, recording.effort, rtol=1e-6)


def test_a_play_is_as_strong_as_a_comparison_sees_it() -> None:
    """It shows as bursts of acceleration, a hundred times what it is as an error of position."""
    case = recordings.Case('effects', ('lost_motion',), 4, 3.0, duration=8.0)
    model, recording, truth = recordings.make_case(case)
    robot = DriveModel.from_parameters({**model.values, **truth['robot']})
    error = measure_residuals(robot, [recording])[0].error
    over_noise = np.sqrt(np.mean(np.square(error), axis=0)) / truth['noise_by_drive']
    (effect,) = truth['effects']
    strongest = int(np.argmax(effect['snr_by_drive']))
    expected = np.hypot(1.0, effect['snr_by_drive'][strongest])
    # Noise that is correlated hides less of bursts than of what is as slow as itself.
    assert 0.5 * expected < over_noise[strongest] < 2 * expected
