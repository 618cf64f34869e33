# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What effects of other packages do wrong is one error, which names effect, method and reason."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from failing_effects import FAULTS, LOADED, fail, model_file
from feedforward_bench import random_motion

from pprs_dynamics import DriveModel, JointMotion, PlatformMotion
from pprs_dynamics.errors import EffectError
from pprs_dynamics.physics.effects.catalogue import check_columns, guard
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples

ONE = random_motion(np.random.default_rng(11), 3)[:1]


@pytest.mark.parametrize(('fault', 'told'), FAULTS.items())
def test_a_failing_drive_effect_is_one_error_with_its_name(
    package: ModuleType, tmp_path: Path, fault: str, told: str,
) -> None:
    model = DriveModel.load(model_file(tmp_path, 'worn_brake'))
    fail(package, 'columns', fault)
    with pytest.raises(EffectError) as raised:
        model.drive_forces(ONE)
    assert raised.value.effect == 'worn_brake'
    assert str(raised.value).startswith(f'effect worn_brake: {told}')
    if told.endswith('('):
        assert 'worn_brake.py, line ' in str(raised.value)


@pytest.mark.parametrize(('place', 'fault', 'told'), [
    ('load', 'raises', 'load raised ZeroDivisionError'),
    ('load', 'longer', 'must be (1, 6)'),
    ('changed', 'raises', 'changed raised ZeroDivisionError'),
])
def test_a_failing_effect_on_the_bodies_is_one_error_with_its_name(
    package: ModuleType, tmp_path: Path, place: str, fault: str, told: str,
) -> None:
    model = DriveModel.load(model_file(tmp_path, 'hose'))
    fail(package, place, fault)
    with pytest.raises(EffectError, match='effect hose: ') as raised:
        model.drive_forces(ONE)
    assert told in str(raised.value)


def hexapod_with(effect: str, **block: float) -> DriveModel:
    added = {f'effects.{effect}.{key}': value for key, value in block.items()}
    values = {**DriveModel.load('config/hexapod.yaml').values, 'effects.active': [effect], **added}
    return DriveModel.from_parameters(values, 'config/hexapod.yaml')


def test_an_effect_on_the_bodies_acts_on_a_robot_with_loops_as_well(package: ModuleType) -> None:
    """Its friction included, as that of the catalogue's wrench of 2 N does."""
    found = hexapod_with('hose', force=2.0)
    wrench = hexapod_with('external_wrench', force_x=0.0, force_y=0.0, force_z=2.0)
    rest = np.zeros((3, 6))
    motion = JointMotion(rest + 0.48, rest + np.arange(3)[:, None] * 0.01, rest)
    ours, theirs = found.drive_forces(motion), wrench.drive_forces(motion)
    assert ours.parts['hose'] == pytest.approx(theirs.parts['external_wrench'], abs=1e-12)
    assert ours.total == pytest.approx(theirs.total, abs=1e-12)
    assert np.max(np.abs(ours.parts['hose'])) > 0.1


@pytest.mark.parametrize(('fault', 'told'), LOADED.items())
def test_wrong_columns_are_found_when_the_package_is_loaded(
    package: ModuleType, fault: str, told: str,
) -> None:
    fail(package, 'columns', fault)
    with pytest.raises(EffectError, match=re.escape(told)):
        check_columns(package.WornBrake)


@pytest.mark.parametrize('method', ['may_show', 'deviations', 'bound'])
def test_whatever_a_diagnosis_asks_is_one_error_with_the_name(method: str) -> None:
    def fails(cls: type, _: Any) -> None:
        raise ZeroDivisionError('by a foreign effect')
    fails.__name__ = method

    def columns(cls: type, drive: DriveSamples) -> tuple[Any, ...]:
        return (drive.velocity,)

    effect: Any = type('Drag', (DriveEffect,), {
        'name': 'drag', 'linear': (), 'columns': classmethod(columns), method: classmethod(fails)})
    guard(effect)
    with pytest.raises(EffectError, match=f'effect drag: {method} raised ZeroDivisionError'):
        getattr(effect, method)(DriveRange(1.0, 0.1, 0.2, 0.3))


def test_what_the_mechanism_refuses_is_not_put_down_to_the_effect(
    package: ModuleType, tmp_path: Path,
) -> None:
    model = DriveModel.load(model_file(tmp_path, 'hose', 'worn_brake'))
    absurd = PlatformMotion(ONE.position, ONE.orientation, np.full((1, 3), 1e200),
                            *(np.zeros((1, 3)) for _ in range(3)))
    assert not np.isfinite(model.drive_forces(absurd).total).all()


def test_an_effect_whose_memory_cannot_be_copied_is_told(
    package: Any, tmp_path: Path,
) -> None:
    package.WornBrake.drive_memory = classmethod(lambda cls: {'samples': 0, 'log': (x for x in ())})
    model = DriveModel.load(model_file(tmp_path, 'worn_brake'))
    with pytest.raises(EffectError, match='effect worn_brake: its memory cannot be copied'):
        model.initial_state().copy()


@pytest.mark.parametrize('place', ['__init__', 'changed'])
def test_a_model_file_with_an_effect_that_cannot_be_built_is_refused(
    package: ModuleType, tmp_path: Path, place: str,
) -> None:
    fail(package, place)
    name = 'hose' if place == 'changed' else 'worn_brake'
    with pytest.raises(EffectError, match=f'effect {name}: {place} raised ZeroDivisionError'):
        DriveModel.load(model_file(tmp_path, name))
