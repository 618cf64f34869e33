# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The ledger of a model file: steps in, steps out, and back exactly."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pprs_command import pprs

from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import (
    Step,
    original_values,
    read_steps,
    with_step,
    without_last_step,
)
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.physics.model.parameter_file import default_parameters, read_parameters

STEP = Step(
    effect='coulomb_friction', error_before=0.2, error_after=0.1, held_out_before=0.21,
    held_out_after=0.11, held_out_on='blocks', noise_floor=0.09, recordings=('a.csv', 'b.csv'),
    sha256=('0' * 64, 'f' * 64), spans=(0.0, 20.0, 5.0, 25.0),
    date='2026-11-21T08:00:00+00:00', version='0.1.0', forced=False, drives=('lift_1',),
    parameters=('lift_1.force',), values=(1.5,), std=(0.02,), units=('N',),
    measured=('slide_1', 'lift_1'), drive_errors_before=(0.1, 0.3),
    drive_errors_after=(0.1, 0.1), calibrated=('masses.payload',))
FRICTION = {'effects.active': ['coulomb_friction'],
            'effects.coulomb_friction.lift_1.force': 1.5, 'masses.payload': 1.02}
TILT = {'effects.active': ['coulomb_friction', 'base_tilt'], 'effects.base_tilt.x': 0.01,
        'effects.base_tilt.y': 0.0, 'effects.coulomb_friction.lift_1.force': 1.4,
        'masses.payload': 1.01}


def model_values(values: dict[str, Any]) -> dict[str, Any]:
    return dict(DriveModel.from_parameters(values).values)


@pytest.fixture
def stages() -> list[dict[str, Any]]:
    """Values before, after one step, and after two."""
    first = model_values(default_parameters())
    second = with_step(first, model_values({**first, **FRICTION}), STEP)
    third = with_step(second, model_values({**second, **TILT}),
                      replace(STEP, effect='base_tilt', drives=(), rivals=('external_wrench',)))
    return [first, second, third]


def test_each_step_is_taken_back_exactly_through_files(
    stages: list[dict[str, Any]], tmp_path: Path,
) -> None:
    write_model(tmp_path / 'model.yaml', stages[2])
    values = model_values(read_parameters(tmp_path / 'model.yaml'))
    assert values == stages[2]
    values, step = without_last_step(values)
    assert step.effect == 'base_tilt'
    assert model_values(values) == stages[1]
    values, step = without_last_step(values)
    assert step.effect == 'coulomb_friction'
    assert model_values(values) == stages[0]
    with pytest.raises(ModelError, match='history is missing'):
        without_last_step(values)


def test_a_model_that_was_fitted_to_an_earlier_one_has_all_steps(
    stages: list[dict[str, Any]],
) -> None:
    """Several effects are adopted in the values of one fit, which knows no step in between."""
    bare = {key: value for key, value in stages[2].items() if not key.startswith('history.')}
    values = with_step(stages[1], bare, replace(STEP, effect='base_tilt', drives=()))
    assert [step.effect for step in read_steps(values)] == ['coulomb_friction', 'base_tilt']
    values, _ = without_last_step(values)
    assert model_values(values) == stages[1]


def test_tolerances_count_from_the_numbers_of_the_first_file(stages: list[dict[str, Any]]) -> None:
    original = original_values(stages[2])
    assert original['masses.payload'] == 1.0
    assert original['effects.coulomb_friction.lift_1.force'] == 1.4


DAMAGE = {
    'history.step_01.error_before': ('a lot', 'be a finite number'),
    'history.step_01.error_after': (-math.inf, 'be a finite number'),
    'history.step_01.spans': ([0.0, math.nan], 'be a list of finite numbers'),
    'history.step_01.noise_floor': (10 ** 400, 'be a finite number'),
    'history.step_01.forced': (0.5, 'be true or false'),
    'history.step_01.recordings': ('a.csv', 'be a list'),
    'history.step_01.weather': ('fine', 'unknown key history.step_01.weather'),
    'history': ('x', 'be under history.step_01'),
    'history.first.effect': ('x', 'be under history.step_01'),
    'history.step_04.effect': ('x', 'be there before history.step_04'),
}


@pytest.mark.parametrize('key', DAMAGE)
def test_a_damaged_ledger_is_one_sentence(stages: list[dict[str, Any]], key: str) -> None:
    value, rule = DAMAGE[key]
    with pytest.raises(ModelError, match=rule):
        read_steps({**stages[2], key: value})


def test_a_step_whose_effect_was_removed_by_hand_is_not_taken_back(
    stages: list[dict[str, Any]],
) -> None:
    values = {key: value for key, value in stages[1].items()
              if key != 'effects.coulomb_friction.lift_1.force'}
    with pytest.raises(ModelError, match='would not give the model that was'):
        without_last_step(values)


def test_the_command_shows_draws_and_takes_back(
    stages: list[dict[str, Any]], tmp_path: Path,
) -> None:
    old, new = tmp_path / 'old.yaml', tmp_path / 'new.yaml'
    write_model(old, stages[2])
    content = old.read_bytes()
    done = pprs('history', str(old), '--json', str(tmp_path / 'steps.json'),
                '--report', str(tmp_path / 'page.html'))
    assert done.returncode == 0, done.stderr
    assert 'base_tilt' in done.stdout
    steps = json.loads((tmp_path / 'steps.json').read_text())['steps']
    assert [(s['effect'], s['error_before'], s['error_after']) for s in steps] == [
        ('coulomb_friction', 0.2, 0.1), ('base_tilt', 0.2, 0.1)]
    assert steps[1]['drives'] is None
    assert 'coulomb_friction' in (tmp_path / 'page.html').read_text()
    done = pprs('history', str(old), '--undo', '--output', str(new))
    assert done.returncode == 0, done.stderr
    assert model_values(read_parameters(new)) == stages[1]
    assert old.read_bytes() == content


def test_a_model_without_steps_has_none_to_take_back(tmp_path: Path) -> None:
    write_model(tmp_path / 'model.yaml', default_parameters())
    done = pprs('history', str(tmp_path / 'model.yaml'), '--undo', '--output',
                str(tmp_path / 'new.yaml'))
    assert done.returncode == 1
    assert 'has no step' in done.stderr
    assert not (tmp_path / 'new.yaml').exists()
