# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated arm: an engine of its own, hidden effects, and what the diagnosis makes of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest

from pprs_dynamics import DriveModel
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.structure_load import StructureLoad
from pprs_dynamics.simulation.injected_effect import InjectedEffectError
from pprs_dynamics.simulation.joint_forms import FORMS
from pprs_dynamics.simulation.mechanism_engine import MechanismEngine
from pprs_dynamics.simulation.mechanism_run import NAMES, draw_motion, simulate_mechanism


@pytest.fixture(scope='module')
def model(tmp_path_factory: pytest.TempPathFactory) -> DriveModel:
    """Return an arm whose links are not those of its URDF, and with joints in another order."""
    described = arm.real_arm(tmp_path_factory.mktemp('arm'))
    mass = np.array(described.robot.inertial) * np.array([1.3, 0.9, 1.1])[:, None]
    found = DriveModel.from_parameters({
        **described.values, 'links.mass': tuple(mass[:, 0]),
        'links.moment': tuple(mass[:, 1:4].ravel()),
        'links.inertia': tuple(mass[:, 4:][:, [0, 2, 5, 1, 3, 4]].ravel()),
        'robot.armature': (0.4, 0.2, 1.0)}, described.source)
    assert isinstance(found, DriveModel)
    return found


def test_the_engine_moves_the_bodies_of_the_model(model: DriveModel) -> None:
    motion = draw_motion(model, 10.0, 0)
    engine = MechanismEngine(model)
    assert engine.torques(motion) == pytest.approx(
        model.drive_forces(motion).parts['rigid_body']
        - np.array(model.values['robot.armature']) * motion.acceleration, abs=1e-8)


def test_the_engine_moves_an_arm_whose_last_joint_stands(tmp_path: Path) -> None:
    arm.write_arm(tmp_path, joints=arm.JOINTS[:2])
    standing = DriveModel.load(tmp_path / 'arm.yaml')
    motion = draw_motion(standing, 10.0, 0)
    assert MechanismEngine(standing).torques(motion) == pytest.approx(
        standing.drive_forces(motion).parts['rigid_body'], abs=1e-8)


def test_a_hidden_payload_is_a_point_at_the_tool(model: DriveModel) -> None:
    motion = draw_motion(model, 10.0, 1)
    engine = MechanismEngine(model)
    before = engine.torques(motion)
    engine.add_payload(1.5, np.zeros(3))
    loaded = DriveModel.from_parameters({**model.values, 'effects.active': ['payload_mass'],
                          'effects.payload_mass.mass': 1.5}, model.source)
    assert engine.torques(motion) - before == pytest.approx(
        loaded.drive_forces(motion).parts['payload_mass'], abs=1e-8)


@pytest.mark.parametrize('of', ['arm', 'hexapod'])
def test_a_wrench_at_the_tool_is_that_of_the_engine(model: DriveModel, of: str) -> None:
    robot = model if of == 'arm' else DriveModel.load('config/hexapod.yaml')
    motion = draw_motion(robot, 2.0, 1)
    engine = MechanismEngine(robot)
    before = engine.torques(motion)
    engine.wrench = np.array([30.0, -20.0, 500.0, 1.0, 2.0, -3.0])
    state = robot.mechanism(motion)
    loaded = state.with_load(robot.robot, StructureLoad(np.tile(engine.wrench, (len(motion), 1))))
    assert engine.torques(motion) - before == pytest.approx(
        loaded.rigid_force - state.rigid_force, abs=1e-8)


def test_a_hidden_link_mass_is_that_of_the_model(model: DriveModel) -> None:
    motion = draw_motion(model, 10.0, 1)
    engine = MechanismEngine(model)
    before = engine.torques(motion)
    engine.add_to_link(1, 0.7)
    loaded = DriveModel.from_parameters({**model.values, 'effects.active': ['link_mass'],
                          'effects.link_mass.beam.mass': 0.7}, model.source)
    assert engine.torques(motion) - before == pytest.approx(
        loaded.drive_forces(motion).parts['link_mass'], abs=1e-8)


@pytest.mark.parametrize('name', ['slider', 'nowhere'])
def test_a_link_that_is_the_payloads_or_not_there_is_refused(
    model: DriveModel, name: str,
) -> None:
    with pytest.raises(ModelError, match=f'unknown key effects.link_mass.{name}.mass'):
        DriveModel.from_parameters({**model.values, 'effects.active': ['link_mass'],
                     f'effects.link_mass.{name}.mass': 0.7}, model.source)


def test_without_effects_the_model_leaves_noise(model: DriveModel) -> None:
    run = simulate_mechanism(model, (), 0, noise=0.3)
    error = run.effort - model.drive_forces(run.motion).total
    assert np.std(error, axis=0) == pytest.approx(np.full(3, 0.3), rel=0.1)


def test_an_arm_has_no_passive_joint_that_could_rub(model: DriveModel) -> None:
    with pytest.raises(InjectedEffectError, match='needs a passive joint'):
        simulate_mechanism(model, ('joint_friction',), 4, duration=10.0)


@pytest.fixture(scope='module')
def plain_of(wrist: DriveModel) -> Callable[[float], Any]:
    """Return how to get what is recorded where nothing is hidden, by duration [s]."""
    return cache(lambda duration: simulate_mechanism(wrist, (), 4, noise=0.0, duration=duration))


@pytest.mark.parametrize('name', [name for name in NAMES if name != 'joint_friction'])
def test_every_hidden_effect_shows(
    wrist: DriveModel, plain_of: Callable[[float], Any], name: str,
) -> None:
    # A slow motion turns the joints farther, as a cylinder needs.
    duration = 30.0 if name == 'counterbalance' else 10.0
    plain = plain_of(duration)
    hidden = simulate_mechanism(wrist, (name,), 4, noise=0.0, duration=duration)
    moved, pushed = (np.abs(getattr(hidden, one) - getattr(plain, one)).max()
                     for one in ('position', 'effort'))
    # The control follows an eccentric encoder.
    if name in ('homing_error', 'lost_motion', 'elastic_joint'):
        assert moved > 0.005 or (pushed > 0.05 and name == 'lost_motion')
    else:
        assert pushed > 0.05
    assert hidden.effects[0]['name'] == name
    assert (hidden.effects[0]['drives'] is None) == (
        name not in {*FORMS, 'eccentric_encoder', 'effort_gain', 'effort_filter', 'time_delay',
                     'homing_error', 'lost_motion', 'current_gain',
                     'elastic_joint'})


AXIS = DriveModel.load('config/single_axis.yaml')
NOT_ON_AN_AXIS = ('counterbalance', 'link_mass', 'base_tilt', 'external_wrench',
                  'eccentric_encoder', 'joint_friction', 'coupled_drives')


def test_a_simulated_axis_moves_its_mass_against_the_friction_of_its_file() -> None:
    run = simulate_mechanism(AXIS, (), 0, noise=0.0, duration=8.0)
    values, v = AXIS.values, run.motion.velocity
    width = values['friction.reversal_velocity']
    assert run.effort == pytest.approx(
        values['axis.mass'] * run.motion.acceleration + values['axis.viscous'] * v
        + values['axis.coulomb'] * np.tanh(v / width) + values['axis.offset'], abs=1e-8)


@pytest.mark.parametrize('name', NAMES)
def test_effects_are_injected_into_an_axis_or_refused(name: str) -> None:
    if name in NOT_ON_AN_AXIS:
        with pytest.raises(InjectedEffectError, match=name):
            simulate_mechanism(AXIS, (name,), 4, duration=8.0)
        return
    plain, run = (simulate_mechanism(AXIS, names, 4, noise=0.0, duration=8.0)
                  for names in ((), (name,)))
    assert run.effects[0]['name'] == name
    assert (np.abs(run.effort - plain.effort).max() > 0.1
            or np.abs(run.position - plain.position).max() > 1e-3)


def test_motors_without_a_map_rub_nowhere(model: DriveModel) -> None:
    with pytest.raises(InjectedEffectError, match=r'friction: \{motors:'):
        simulate_mechanism(model, ('coupled_drives',), 4, duration=10.0)


@pytest.fixture(scope='module')
def wrist(model: DriveModel) -> DriveModel:
    """Return the arm with a motor that turns with two joints."""
    found = DriveModel.from_parameters({**model.values, 'friction.motors.wrist.turn': 1.0,
                         'friction.motors.wrist.swing': 1.0}, model.source)
    assert isinstance(found, DriveModel)
    return found


@pytest.mark.parametrize(('name', 'seed'), [
    ('payload_mass', 1), ('link_mass', 1), ('viscous_friction', 2), ('coulomb_friction', 3),
    ('friction_temperature', 1), ('friction_temperature', 2), ('friction_drift', 1),
    ('counterbalance', 1), ('coupled_drives', 1), ('current_gain', 1), ('effort_gain', 1)])
def test_what_is_hidden_is_named(wrist: DriveModel, name: str, seed: int) -> None:
    model = wrist
    run = simulate_mechanism(model, (name,), seed, thermometers=True)
    assert run.motion.time is not None
    found = diagnose(model, [Recording.from_arrays(
        'run', run.motion.time, run.position, None, run.effort, model.drives, run.channels)])
    named = {found.effects[0].name} | {other for rivals in found.indistinguishable
                                       if rivals[0] == found.effects[0].name for other in rivals}
    assert name in named
    if name in ('payload_mass', 'link_mass'):
        for parameter, value in run.effects[0]['parameters'].items():
            assert found.effects[0].parameters[parameter].value == pytest.approx(value, rel=0.05)


def test_the_command_writes_recording_and_truth(tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    path = str(arm.write_arm(tmp_path))
    output, truth = str(tmp_path / 'run.csv'), tmp_path / 'truth.json'
    assert main(['simulate', '--model', path, '--output', output, '--effect', 'payload_mass',
                 '--duration', '5', '--json', str(truth)]) == 0
    assert json.loads(truth.read_text())['effects'][0]['parameters']['mass'] > 0
    assert main(['simulate', '--model', path, '--output', output + '2.csv', '--effect',
                 'tool_drag']) == 2
    assert 'no injected effect of such a robot' in capsys.readouterr().err


def test_statements_have_the_units_of_joints(model: DriveModel, tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    without = DriveModel.from_parameters(
        {**model.values, 'friction.coulomb': (0.0, 4.0, 0.0)}, model.source)
    from pprs_dynamics.inference.diagnosis.localisation import localise
    from pprs_dynamics.inference.residuals.measuring import measure_residuals
    run = simulate_mechanism(model, (), 0)
    assert run.motion.time is not None
    recording = Recording.from_arrays('run', run.motion.time, run.position, None, run.effort,
                                      model.drives)
    said = {one.drive: one.text for one in localise(
        measure_residuals(without, [recording])[0]).statements if one.kind == 'friction'}
    assert 'N m' in said['turn']
    assert 'N m' not in said['reach']
    assert ' N' in said['reach']
