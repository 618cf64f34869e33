# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated arm: an engine of its own, hidden effects, and what the diagnosis makes of them."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest
from documents import checked
from made_once import diagnose
from model_recordings import with_effects
from planar_arm import planar_arm

from pprs_dynamics import DriveModel, JointMotion, PlatformMotion
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.mechanism.state import StructureLoad
from pprs_dynamics.simulation.engine import MechanismEngine
from pprs_dynamics.simulation.injected_forms import InjectedEffectError
from pprs_dynamics.simulation.injection import (
    NAMES,
    Choice,
    Injection,
    PlainRobot,
    draw_motion,
    named,
    simulate_mechanism,
)


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
    return found


def test_the_engine_moves_the_bodies_of_the_model(model: DriveModel) -> None:
    motion = draw_motion(model, 10.0, 0)
    engine = MechanismEngine(model)
    assert engine.torques(motion) == pytest.approx(
        model.drive_forces(motion).parts['rigid_body']
        - np.array(model.values['robot.armature']) * motion.acceleration, abs=1e-8)


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


def test_without_effects_the_model_leaves_noise(model: DriveModel) -> None:
    run = simulate_mechanism(model, (), 0, noise=0.3)
    error = run.effort - model.drive_forces(run.motion).total
    assert np.std(error, axis=0) == pytest.approx(np.full(3, 0.3), rel=0.1)


AXIS = DriveModel.load('config/single_axis.yaml')


def test_a_simulated_axis_moves_its_mass_against_the_friction_of_its_file() -> None:
    run = simulate_mechanism(AXIS, (), 0, noise=0.0, duration=8.0)
    values, v = AXIS.values, run.motion.velocity
    width = values['friction.reversal_velocity']
    assert run.effort == pytest.approx(
        values['links.mass'][0] * run.motion.acceleration + values['friction.viscous'][0] * v
        + values['friction.coulomb'][0] * np.tanh(v / width) + values['friction.offset'][0],
        abs=1e-8)


@pytest.mark.parametrize('name', [
    'coulomb_friction', 'load_friction', 'gear_efficiency', 'hysteresis', 'friction_drift'])
def test_friction_of_an_axis_that_turns_over_17_times_more_slowly_than_the_models_is_named(
        name: str) -> None:
    run = simulate_mechanism(AXIS, (name,), 2, duration=20.0)
    assert run.motion.time is not None
    found = diagnose(AXIS, [Recording.from_arrays(
        'run', run.motion.time, run.position, None, run.effort, AXIS.drives)])
    assert (found.verdict, [effect.name for effect in found.effects]) == ('effect', [name])


def test_motors_without_a_map_rub_nowhere(model: DriveModel) -> None:
    with pytest.raises(InjectedEffectError, match=r'friction: \{motors:'):
        simulate_mechanism(model, ('coupled_drives',), 4, duration=10.0)


@pytest.fixture(scope='module')
def wrist(model: DriveModel) -> DriveModel:
    """Return the arm with a motor that turns with two joints."""
    found = DriveModel.from_parameters({**model.values, 'friction.motors.wrist.turn': 1.0,
                                        'friction.motors.wrist.swing': 1.0}, model.source)
    return found


@pytest.mark.parametrize(('name', 'seed'), [
    ('payload_mass', 1), ('coupled_drives', 1), *(
        pytest.param(name, 1, marks=pytest.mark.slow)
        for name in ('link_mass', 'friction_temperature', 'friction_drift', 'counterbalance',
                     'current_gain', 'effort_gain'))])
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


def test_the_command_writes_recording_and_truth(tmp_path: Path) -> None:
    path = str(arm.write_arm(tmp_path))
    output, truth = str(tmp_path / 'run.csv'), tmp_path / 'truth.json'
    assert main(['simulate', '--model', path, '--output', output, '--effect', 'payload_mass',
                 '--duration', '5', '--json', str(truth)]) == 0
    assert checked(truth.read_text(), 'simulate')['effects'][0]['parameters']['mass'] > 0


PLATFORM = DriveModel.load('config/paper.yaml')


@pytest.mark.parametrize('change', [
    {}, {'masses.centre': [0.01, -0.02, 0.03], 'masses.rods': [0.1, 0.3, 0.5]},
    {'geometry.elbow': 'down', 'limits.lift_stroke': [-0.1, 1.5]},
], ids=['paper', 'masses', 'elbow down'])
def test_a_simulated_platform_needs_the_forces_of_the_paper(change: dict[str, Any]) -> None:
    model = DriveModel.from_parameters({**PLATFORM.values, **change})
    plain, motion = plain_platform(model, 6.0)
    assert np.abs(plain.effort - model.drive_forces(motion).total).max() < 1e-8


@pytest.mark.parametrize('name', [name for name in NAMES if name not in (
    'counterbalance', 'eccentric_encoder', 'coupled_drives', 'elastic_joint')])
def test_an_injected_effect_changes_its_drives_alone_and_repeats(name: str) -> None:
    plain, effect = paper_run(), Choice(name, np.random.default_rng(1))
    first, again = (Injection(plain, [effect], np.random.default_rng(2)) for _ in range(2))
    np.testing.assert_array_equal(first.efforts, again.efforts)
    added = np.abs(first.efforts - plain.effort).max(axis=0)
    shifted = np.abs(first.beside).max(axis=0)
    (truth,) = first.truths
    acts = np.isin(PLATFORM.drives, truth['drives'] or PLATFORM.drives)
    assert added.max() > 0.01 or shifted.max() > 1e-4
    assert np.all(added[~acts] < 1e-9)
    assert np.all(shifted[~acts] == 0)


def plain_platform(model: DriveModel = PLATFORM, start: float = 0.0, rounds: int = 1,
                   ) -> tuple[PlainRobot, PlatformMotion]:
    """Return a platform along 3 s of a path without hidden effects, and that motion."""
    motion = Excitation(seed=3).motion(start + np.arange(300) / 100)
    state = model.mechanism(motion)
    return PlainRobot(model, JointMotion(
        state.position, state.velocity, state.acceleration, motion.time), rounds=rounds), motion


@cache
def paper_run() -> PlainRobot:
    return plain_platform()[0]


@pytest.mark.parametrize(('name', 'file'), [
    ('payload_mass', 'hexapod'), ('external_wrench', 'hexapod'), ('external_wrench', 'paper'),
    ('viscous_friction:slide_1', 'paper')])
def test_an_effect_contains_the_friction_that_its_own_load_causes(name: str, file: str) -> None:
    """The engine's joints rub under loads with friction: 1 % of usual noise remains at most."""
    model = DriveModel.load(f'config/{file}.yaml')
    if not model.robot.plans_poses:
        motion: Any = draw_motion(model, 6.0, 3)
        plain = PlainRobot(model, motion, rounds=4)
    else:
        plain, motion = plain_platform(model, 6.0, rounds=4)
    run = Injection(plain, [named(name, np.random.default_rng(1), 1.0)], np.random.default_rng(2))
    added = run.efforts - plain.effort
    kind, _, drive = name.partition(':')
    if drive:  # the drive pushes against it: no guide carries more
        assert np.abs(added[:, 1:]).max() == 0 < np.abs(added[:, 0]).max()
        return
    values = dict(run.truths[0]['parameters'])
    if kind == 'payload_mass':
        values |= {'x': 0.0, 'y': 0.0, 'z': 0.05}
    else:
        values = dict.fromkeys(('force_x', 'force_y'), 0.0) | values
    lacking = with_effects(model, {kind: values})
    exact = lacking.drive_forces(motion).total - model.drive_forces(motion).total
    noise = 0.005 * np.abs(run.efforts).max(axis=0)
    assert np.all(np.sqrt(np.mean((added - exact) ** 2, axis=0)) < 0.01 * noise)
    assert np.all(np.sqrt(np.mean(exact ** 2, axis=0)) > noise)


@pytest.mark.parametrize('name', ['payload_mass', 'payload_offset'])
def test_an_injected_load_of_a_3_pprs_is_that_of_the_effect_of_its_name(name: str) -> None:
    values = {**PLATFORM.values, 'friction.drives.coulomb': (0.0,) * 6,
              'friction.revolute.coulomb': 0.0, 'friction.spherical.coulomb': 0.0}
    model = DriveModel.from_parameters(values)
    plain, motion = plain_platform(model)
    run = Injection(plain, [named(name, np.random.default_rng(1), 1.0)], np.random.default_rng(2))
    other = with_effects(model, {name: run.truths[0]['parameters']})
    exact = other.drive_forces(motion).total - model.drive_forces(motion).total
    assert run.efforts - plain.effort == pytest.approx(exact, abs=1e-8)


def test_given_drives_have_the_effect() -> None:
    plain = paper_run()
    run = Injection(plain, [named('effort_offset:lift_1,slide_2', np.random.default_rng(0), 1.0)],
                    np.random.default_rng(2))
    assert run.truths[0]['drives'] == ['lift_1', 'slide_2']
    for words, text in (('viscous', 'did you mean'), ('base_tilt:lift_1', 'does not act in'),
                        ('effort_offset:x', 'does not act in')):
        with pytest.raises(InjectedEffectError, match=text):
            Injection(plain, [named(words, np.random.default_rng(0), 1.0)],
                      np.random.default_rng(2))


def test_a_tool_on_the_axis_of_its_joint_has_no_drag(tmp_path: Path) -> None:
    with pytest.raises(InjectedEffectError, match='tool_drag needs a tool that is off the axes'):
        simulate_mechanism(planar_arm(tmp_path, 1), ('tool_drag',), 0, duration=4.0)
