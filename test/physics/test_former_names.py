# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Names that effects of a 3-PPRS had before every robot had them are read, and told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.mujoco_robot import MujocoRobot
from random_states import random_motion

from pprs_dynamics import DriveModel
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.adoption.request import EffectRequest, requested
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.former_names import FORMER
from pprs_dynamics.physics.model.ledger import read_steps, without_last_step
from pprs_dynamics.physics.model.model_file import load_model
from pprs_dynamics.simulation.hidden_effects import draw_effect

OLD = {
    'platform_drag': {'coefficient': 7.0, 'rotational': 0.05},
    'revolute_friction': {'viscous': 0.03, 'torque': 0.0},
    'revolute_stiffness': {'stiffness': 0.8, 'angle': 1.3},
    'rod_mass': {'mass': 0.1},
    'spherical_friction': {'viscous': 0.02, 'torque': 0.0}}
STEP = {
    'effect': 'spherical_friction', 'error_before': 1.0, 'error_after': 0.5, 'held_out_before': 1.0,
    'held_out_after': 0.5, 'held_out_on': 'blocks', 'noise_floor': 0.1, 'recordings': ['run.csv'],
    'sha256': ['0'], 'spans': [0.0, 1.0], 'date': '2026-01-01', 'version': '1', 'forced': False,
    'parameters': ['viscous', 'torque'], 'values': [0.02, 0.0], 'std': [0.001, 0.001],
    'units': ['N m s/rad', 'N m'], 'rivals': ['rod_mass', 'base_tilt'],
    'added': ['effects.spherical_friction.viscous', 'effects.spherical_friction.torque',
              'uncertainties.spherical_friction.viscous'],
    'previous.effects.active': [name for name in OLD if name != 'spherical_friction']}


def old_values() -> dict[str, Any]:
    values: dict[str, Any] = {**DriveModel.load().values, 'effects.active': list(OLD),
                              'uncertainties.spherical_friction.viscous': 0.001}
    values.update({f'effects.{name}.{key}': value for name, block in OLD.items()
                   for key, value in block.items()})
    return values | {f'history.step_01.{key}': value for key, value in STEP.items()}


def old_model() -> DriveModel:
    with pytest.warns(FutureWarning) as told:
        model = DriveModel.from_parameters(old_values())
    assert {str(one.message) for one in told} == {
        'platform_drag is called tool_drag now',
        'revolute_friction is called joint_friction now, of revolute',
        'revolute_stiffness is called joint_spring now, of revolute',
        'rod_mass is called link_mass now, of rods',
        'spherical_friction is called joint_friction now, of spherical'}
    return model


def test_a_file_with_names_of_old_is_the_model_that_it_was() -> None:
    """Its joints and rods as an engine has them that knows no names of effects."""
    model = old_model()
    plain = DriveModel.load()
    assert [one.name for one in model.effects[2:]] == [
        'tool_drag', 'joint_friction', 'joint_spring', 'link_mass']
    motion = random_motion(np.random.default_rng(3), 20)
    parts = model.drive_forces(motion).parts
    engine = MujocoRobot(plain.robot)
    friction = engine.solve(motion, 0.03, 0.02).passive
    assert parts['joint_friction'] == pytest.approx(friction, abs=1e-9)
    for i in range(3):
        body = engine.bodies[f'rod_{i}']
        engine.model.body_mass[body] *= 1.5  # 0.2 kg and 0.1 kg more
        engine.model.body_inertia[body] *= 1.5
    heavier = engine.solve(motion).force - MujocoRobot(plain.robot).solve(motion).force
    assert parts['link_mass'] == pytest.approx(heavier, abs=1e-9)
    assert model.values['effects.joint_spring.revolute.position'] == 1.3
    assert not any(f'.{name}.' in key for key in model.values for name in OLD)


def test_a_ledger_of_old_is_read_and_taken_back() -> None:
    step, = read_steps(old_model().values)
    assert step.effect == 'joint_friction'
    assert step.parameters == ('spherical.viscous', 'spherical.torque')
    assert step.rivals == ('link_mass', 'base_tilt')
    before, _ = without_last_step(old_model().values)
    model = DriveModel.from_parameters(before)
    friction = next(one for one in model.effects if one.name == 'joint_friction')
    assert friction.to_file() == {'revolute': {'viscous': 0.03}}  # type: ignore[attr-defined]


def test_what_is_written_of_a_file_of_old_has_names_of_today(tmp_path: Path) -> None:
    old, new = tmp_path / 'old.yaml', tmp_path / 'new.yaml'
    text = (Path(__file__).parents[2] / 'config/paper.yaml').read_text()
    old.write_text(text + '    effects:\n      active: [rod_mass]\n      rod_mass: {mass: 0.1}\n'
                   + '    history:\n      step_01:\n' + ''.join(
                       f'        {key}: {json.dumps(value)}\n' for key, value in {
                           **STEP, 'effect': 'rod_mass', 'parameters': ['mass'], 'values': [0.1],
                           'std': [0.01], 'units': ['kg'], 'rivals': ['spherical_friction'],
                           'added': ['effects.active', 'effects.rod_mass.mass']}.items()
                       if not key.startswith('previous')))
    assert main(['history', str(old), '--undo', '--output', str(new)]) == 0
    assert [one.name for one in load_model(new).effects] == ['active_friction', 'passive_friction']


@pytest.mark.parametrize('name', FORMER)
def test_requests_and_hidden_effects_by_names_of_old(name: str) -> None:
    with pytest.warns(FutureWarning, match=f'{name} is called {FORMER[name].effect} now'):
        assert requested(name, DriveModel.load()).name == FORMER[name].effect
    with pytest.warns(FutureWarning, match='is called'):
        hidden = draw_effect(name, np.random.default_rng(0))
    assert hidden.name == FORMER[name].effect
    if name.endswith('friction'):
        assert set(hidden.truth()['parameters']) == {
            f'{FORMER[name].place}.{key}' for key in hidden.ranges}
    assert name not in CATALOGUE


@pytest.mark.parametrize('name', ['joint_friction', 'joint_spring', 'link_mass', 'payload_mass'])
def test_a_request_is_of_the_joints_and_links_of_the_model(name: str) -> None:
    paper, hexapod = DriveModel.load(), load_model('config/hexapod.yaml')
    for model in (paper, hexapod):
        placed = EffectRequest.of(name).placed(model)
        assert placed.effect.coefficients
        assert placed.effect is model.bound(CATALOGUE[name])
        # What was of another robot is of this one then.
        assert EffectRequest.of(name).placed(hexapod).placed(paper).effect is paper.bound(
            CATALOGUE[name])


def test_a_name_of_old_does_not_hide_a_wrong_value() -> None:
    values = {**DriveModel.load().values, 'effects.active': ['rod_mass'],
              'effects.rod_mass.mass': 'heavy'}
    with pytest.warns(FutureWarning), pytest.raises(
            ModelError, match=r'effects\.link_mass\.rods\.mass is .*heavy.*must be a number'):
        DriveModel.from_parameters(values)
