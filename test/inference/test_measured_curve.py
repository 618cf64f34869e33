# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A measured curve: what no law explains, fitted as knots, judged along another motion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BSpline

from pprs_dynamics import DriveModel
from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.fit_curve import without_curve
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.measured_curve import spline_basis
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.ledger import read_steps
from pprs_dynamics.physics.model.model_writer import write_model

RATE, LENGTH, NOISE = 200.0, 16.0, 0.08  # [Hz, s, N]
LIFT, SLIDE = 3, 0


def recorded(model: DriveModel, seed: int, hidden: Callable[[Array], Array]) -> Recording:
    """Return a recording whose first lift needs a force over the drives' positions more."""
    motion = Excitation(LENGTH, seed=seed).motion(np.arange(0, LENGTH, 1 / RATE))
    forces = model.drive_forces(motion)
    effort = forces.total + NOISE * np.random.default_rng(seed).standard_normal((len(motion), 6))
    effort[:, LIFT] += hidden(forces.mechanism.position)
    return Recording.from_arrays(f'run {seed}', np.arange(len(motion)) / RATE,
                                 forces.mechanism.position, effort=effort)


def bump(position: Array) -> Array:
    return np.asarray(np.exp(-((position[:, LIFT] - 0.203) / 0.004) ** 2))


def cable(position: Array) -> Array:
    """A cable chain that the first slide drags along pulls at the lift."""
    return 0.8 * np.tanh((position[:, SLIDE] - position[:, SLIDE].mean()) / 0.02)


@pytest.fixture(scope='module')
def model() -> DriveModel:
    return DriveModel.load()


@pytest.mark.parametrize('periodic', [False, True])
def test_the_basis_is_that_of_de_boor(periodic: bool) -> None:
    start, end, intervals = -0.3, 0.7, 8
    x = np.random.default_rng(0).uniform(start, end, 200)
    step = (end - start) / intervals
    knots = start + step * np.arange(-3, intervals + 4)
    full = np.stack([BSpline.basis_element(knots[k:k + 5], extrapolate=False)(x)
                     for k in range(intervals + 3)], axis=1)
    full = np.nan_to_num(full)
    if periodic:
        full[:, :3] += full[:, intervals:]
        full = full[:, :intervals]
    mine = spline_basis(x, start, end, intervals, periodic).toarray()
    np.testing.assert_allclose(mine, full, atol=1e-12)


@pytest.mark.parametrize(('hidden', 'variable'), [
    (bump, 'position'), (cable, 'position of slide_1')])
def test_the_error_falls_to_the_noise_along_another_motion(
    model: DriveModel, hidden: Callable[[Array], Array], variable: str, tmp_path: Path,
) -> None:
    run, other = (recorded(model, seed, hidden) for seed in (1, 2))
    answer = adopt(
        model, EffectRequest.of(f'measured_curve:lift_1@{variable}', model), [run], [other])
    assert answer.adopted, answer.reason
    assert answer.held_out_after < 1.1 * answer.noise_floor < 0.5 * answer.held_out_before
    assert answer.to_dict()['effect'] == f'measured_curve:lift_1@{variable}'
    assert 'not a cause' in answer.remarks[0]
    # A model file holds it, and its undoing.
    file = tmp_path / 'with_curve.yaml'
    write_model(file, answer.after.values, 'config/paper.yaml')
    read = DriveModel.load(file)
    motion = Excitation(3.0, seed=9).motion(np.arange(0, 3.0, 0.01))
    np.testing.assert_allclose(read.drive_forces(motion).total,
                               answer.after.drive_forces(motion).total, atol=1e-9)
    assert read_steps(read.values) == []
    np.testing.assert_array_equal(without_curve(read, 'lift_1').drive_forces(motion).total,
                                  model.drive_forces(motion).total)


def test_where_nothing_is_missing_it_is_refused(model: DriveModel) -> None:
    run, other = (recorded(model, seed, lambda position: np.zeros(len(position)))
                  for seed in (1, 2))
    answer = adopt(model, EffectRequest.of('measured_curve:lift_1@position', model), [run], [other])
    assert not answer.adopted
    assert 'evidence' in answer.reason
    assert answer.error_after == pytest.approx(answer.error_before, rel=0.02)


@pytest.mark.parametrize(('change', 'said'), [
    ({'variable': 'colour'}, 'variable'), ({'to': -1.0}, 'greater than from'),
    ({'values': [1.0]}, 'values'), ({'values': [1.0, 2.0, 3.0, float('nan')]}, 'finite'),
    ({'periodic': 'yes'}, 'true or false'), ({'knots': 3}, 'unknown key')])
def test_what_is_no_curve_is_refused_in_a_sentence(
    model: DriveModel, change: dict[str, object], said: str,
) -> None:
    curve = {'variable': 'position', 'from': 0.0, 'to': 0.1, 'values': [0.0, 1.0, 0.0, 1.0],
             **change}
    values = {f'effects.measured_curve.lift_1.{key}': value for key, value in curve.items()}
    with pytest.raises(ModelError, match=said):
        DriveModel.from_parameters({**model.values, 'effects.active': ['measured_curve'], **values})


def test_a_curve_that_is_not_active_may_be_given_key_by_key(model: DriveModel) -> None:
    """As a node gets it."""
    key = f'effects.measured_curve.{model.drives[0]}.values'
    assert DriveModel.from_parameters({**model.values, key: [0.0] * 4}).values[key] == [0.0] * 4
