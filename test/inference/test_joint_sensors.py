# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Encoders and torque constants of joints: waves, windings, clearances and warmth."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_once import diagnose
from made_up_arm import FRICTION, motion, real_arm
from model_recordings import with_effects
from numpy.testing import assert_allclose
from planar_arm import planar_arm

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.current_gain import CurrentGain
from pprs_dynamics.physics.effects.laws.lost_motion import LostMotion, behind_play

JOINT = 1  # swing, which carries weight
GEAR = 20.0
PITCH = 2 * np.pi / GEAR


@pytest.fixture(scope='module')
def arm(tmp_path_factory):
    return real_arm(tmp_path_factory.mktemp('arm'), **{
        'robot.gear_ratio': (1.0, GEAR, 1.0)})


def with_effect(arm, name, **values):
    return with_effects(arm, {name: {f'swing.{key}': value for key, value in values.items()}})


def with_wave(arm, amplitude=0.002, phase=0.7, pitch=PITCH):
    return with_effect(arm, 'eccentric_encoder', amplitude=amplitude, phase=phase, pitch=pitch)


def disc(q: np.ndarray, beside: float, turns: float, phase: float) -> np.ndarray:
    """Return what the head of a disc beside its axis reads, turned as fast as the joint or more."""
    x = turns * q + phase
    return q + np.arctan2(beside * np.sin(x), 1 - beside * np.cos(x)) / turns


def recorded(arm, read=lambda q: q, model=None, seed=1):
    """Record a motion whose encoder on the swing reads otherwise, by a model's forces."""
    moved = motion(20.0)
    model = arm if model is None else model
    forces = model.measured(model.drive_forces(moved)).total
    position = moved.position + model.position_error(moved.position)
    position[:, JOINT] = read(position[:, JOINT])
    noise = np.random.default_rng(seed)
    return Recording.from_arrays(
        'run', moved.time, position + 2e-5 * noise.uniform(-0.5, 0.5, position.shape), None,
        forces + 0.2 * noise.normal(size=forces.shape), arm.drives)


def test_a_wave_is_read_too_much_and_no_force(arm):
    moved = motion(5.0)
    model = with_wave(arm)
    error = model.position_error(moved.position)
    assert_allclose(error[:, JOINT], 0.002 * np.sin(GEAR * moved.position[:, JOINT] + 0.7),
                    atol=1e-15)
    assert not error[:, [0, 2]].any()
    assert_allclose(model.drive_forces(moved).total, arm.drive_forces(moved).total)


@pytest.mark.parametrize(('turns', 'beside'), [(1.0, 0.02), (GEAR, 0.06)])
def test_a_disc_beside_its_axis_is_found(arm, turns, beside):
    found = diagnose(arm, [recorded(arm, lambda q: disc(q, beside, turns, 0.5))])
    assert [(e.name, e.drives) for e in found.effects] == [('eccentric_encoder', ('swing',))]
    told = found.effects[0].parameters
    assert told['swing.pitch'].value == pytest.approx(2 * np.pi / turns, rel=0.1)
    assert told['swing.amplitude'].value == pytest.approx(beside / turns, rel=0.15)


@pytest.mark.parametrize(('name', 'values'), [
    ('homing_error', {'zero': 0.015}),
    ('force_ripple', {'force': 1.5, 'phase': 0.4, 'pitch': PITCH}),
    ('hysteresis', {'force': 2.0, 'coefficient': 0.0, 'distance': 0.02})])
def test_what_waves_and_clearances_are_taken_for_stays_what_it_is(arm, name, values):
    model = with_effect(arm, name, **values)
    found = diagnose(arm, [recorded(arm, model=model)])
    assert [effect.name for effect in found.effects] == [name]


# Torque constants that go with temperature and position: what sensors show, and its columns.

VALUES = {'temperature': 0.002, 'ripple': 0.05, 'phase': 0.3, 'reference': 30.0, 'pitch': 0.2}


@pytest.fixture(scope='module')
def geared(tmp_path_factory):
    return real_arm(tmp_path_factory.mktemp('arm'), **{'robot.gear_ratio': (50.0, 50.0, 1.0)})


def warm(at: JointMotion) -> JointMotion:
    """Return a motion of drives that warm by a kelvin a second from 20 degrees on."""
    assert at.time is not None
    return at.with_channels({'temperature': np.tile(20 + at.time, (3, 1)).T})


def test_an_effort_is_measured_in_proportion_to_itself_warmth_and_wave(geared):
    at = warm(motion(20.0))
    model = with_effect(geared, 'current_gain', **VALUES)
    forces = model.drive_forces(at)
    seen = model.measured(forces).total
    factor = 1 + 0.002 * (at.time - 10) + 0.05 * np.sin(2 * np.pi * at.position[:, 1] / 0.2 + 0.3)
    assert_allclose(seen[:, JOINT], factor * forces.total[:, JOINT])
    assert_allclose(seen[:, [0, 2]], forces.total[:, [0, 2]])
    # It is no force: what is commanded does not have it.
    assert_allclose(forces.total, geared.drive_forces(at).total)


def warm_run(geared, model):
    at = warm(motion(20.0))
    return Recording.from_arrays('x', at.time, at.position, None,
                                 model.measured(model.drive_forces(at)).total, geared.drives,
                                 at.channels)


def test_columns_are_differences_of_models(geared):
    design = Design.of(geared, [warm_run(geared, geared)])
    shape = {'reference': 30.0, 'pitch': 0.2}
    rows = design.drive_rows(CurrentGain, JOINT, shape)
    for values, c in (({'temperature': 1e-3, 'ripple': 0.0}, np.array([1e-3, 0, 0])),
                      ({'temperature': 0.0, 'ripple': 0.01, 'phase': 0.0}, np.array([0, 0.01, 0])),
                      ({'temperature': 0.0, 'ripple': 0.01, 'phase': np.pi / 2},
                       np.array([0, 0, 0.01]))):
        other = with_effect(geared, 'current_gain', **{**VALUES, **values})
        changed = Design.of(other, [warm_run(geared, geared)])
        assert_allclose(changed.forces[:, JOINT] - design.forces[:, JOINT], c @ rows, atol=1e-9)


# Encoders that are not where the link is: clearances that loads or reversals cross.

TIME = np.arange(0, 12, 0.005)
NOISE = 0.05  # [N m]


def noisy_run(model: DriveModel, position: Array, effort: Array, time: Array) -> Recording:
    noise = NOISE * np.random.default_rng(3).normal(size=effort.shape)
    grain = 1e-5 * np.random.default_rng(4).normal(size=position.shape)
    return Recording.from_arrays('run', time, position + grain, None, effort + noise, model.drives)


def with_play(model: DriveModel, play: float, width: float = 0.05) -> Recording:
    """Record a motor that crosses a play while the link turns over: faster than the link."""
    moved = motion(20.0)
    position = moved.position.copy()
    position[:, JOINT] += play / 2 * np.tanh(moved.velocity[:, JOINT] / width)
    return noisy_run(model, position, model.drive_forces(moved).total, moved.time)


def with_backlash(model: Any, backlash: float) -> Recording:
    """Record a motor that moves smoothly while the link falls to the side of its load."""
    moved = motion(20.0)
    load = model.drive_forces(moved).mechanism.transmitted[:, JOINT]
    position = moved.position.copy()
    position[:, JOINT] -= backlash / 2 * np.sign(load)
    forces = model.drive_forces(replace(moved, position=position)).total
    return noisy_run(model, moved.position, forces, moved.time)


def found_on(model: DriveModel, recording: Recording) -> tuple[Diagnosis, list[object]]:
    found = diagnose(model, [recording])
    return found, [(effect.name, effect.drives) for effect in found.effects]


def test_behind_a_play_is_the_link() -> None:
    """The encoder leads by tanh; the law knows neither the tanh nor how fast it turns over."""
    play = 0.02
    link, speed = 0.4 * np.sin(2 * TIME), 0.8 * np.cos(2 * TIME)
    encoder = link + play / 2 * np.tanh(speed / 0.05)
    found = behind_play(encoder, play)
    assert np.abs(encoder - link).max() == pytest.approx(play / 2, rel=1e-3)
    inside = slice(100, -100)
    assert np.abs(found - link)[inside].max() < 0.2 * play
    before, after = (np.gradient(angle - link, TIME)[inside] for angle in (encoder, found))
    assert np.abs(after).max() < 0.25 * np.abs(before).max()


def test_loads_choose_the_flank() -> None:
    effect = LostMotion({'lift_1': {'backlash': 0.004, 'play': 0.01}})
    load = np.array([[5.0, -30.0], [5.0, 10.0]])
    error = effect.loaded_position_error(('slide_1', 'lift_1'), load)
    np.testing.assert_allclose(error, [[0.0, -0.002], [0.0, 0.002]], rtol=1e-12)


@pytest.mark.parametrize('size', [0.008, pytest.param(0.03, marks=pytest.mark.slow)])
def test_play_at_reversals_is_lost_motion(tmp_path: Path, size: float) -> None:
    model = real_arm(tmp_path)
    found, named = found_on(model, with_play(model, size))
    assert named[0] == ('lost_motion', ('swing',))
    assert found.effects[0].parameters['swing.play'].value == pytest.approx(size, rel=0.15)


def test_backlash_by_the_side_of_the_load_is_lost_motion(tmp_path: Path) -> None:
    model = planar_arm(tmp_path, 3)  # it hangs: loads change sign
    found, named = found_on(model, with_backlash(model, 0.03))
    assert named[0] == ('lost_motion', ('j2',))
    assert found.effects[0].parameters['j2.backlash'].value == pytest.approx(0.03, rel=0.15)


# Joints that wind up between two encoders.

QUIET = 0.02  # [N m]
COMPLIANCE, LOSS = 1.5e-3, 0.02  # [rad/(N m)], [s]


def wound_up(model: DriveModel, compliance: float, loss: float = 0.0, second: bool = True,
             shift: float = 0.0) -> Recording:
    """Record a motor that leads a link which moves smoothly, and the link.

    k w + d dw/dt = tau, step by step; friction turns over with the motor.
    """
    moved = motion(20.0)
    assert moved.time is not None
    forces = model.drive_forces(moved)
    load = forces.mechanism.transmitted[:, JOINT]
    step = moved.time[1] - moved.time[0]
    windup = np.empty_like(load)
    windup[0] = compliance * load[0]
    kept = np.exp(-step / loss) if loss else 0.0
    for k in range(1, len(load)):
        windup[k] = kept * windup[k - 1] + (1 - kept) * compliance * load[k]
    width = float(model.reversal.widths(3)[JOINT])
    link = moved.velocity[:, JOINT]
    motor_speed = link + np.gradient(windup, step)
    viscous, dry = (FRICTION[f'friction.{name}'][JOINT]
                    for name in ('viscous', 'coulomb'))
    forces.total[:, JOINT] += viscous * (motor_speed - link) + dry * (
        np.tanh(motor_speed / width) - np.tanh(link / width))
    random = np.random.default_rng(3)

    def read(position: Array) -> Array:
        return position + 1e-5 * random.normal(size=position.shape)

    motor = moved.position.copy()
    motor[:, JOINT] += windup + shift
    effort = forces.total + QUIET * random.normal(size=forces.total.shape)
    return Recording.from_arrays('run', moved.time, read(motor), None, effort, model.drives, {
        'link_position': read(moved.position + 0.01)} if second else {})


def test_an_elastic_joint_is_found_with_its_compliance(tmp_path: Path) -> None:
    model = real_arm(tmp_path)
    found = diagnose(model, [wound_up(model, COMPLIANCE, LOSS)])
    assert [(e.name, e.drives) for e in found.effects] == [('elastic_joint', ('swing',))]
    told = found.effects[0].parameters
    assert told['swing.compliance'].value == pytest.approx(COMPLIANCE, rel=0.1)
    assert told['swing.loss'].value == pytest.approx(LOSS, abs=0.01)


def test_what_efforts_do_not_show_the_second_encoder_tells(tmp_path: Path) -> None:
    model = real_arm(tmp_path)
    found = diagnose(model, [wound_up(model, 2e-5, LOSS)])
    assert found.verdict != 'effect'
    assert 'elastic_joint' not in [effect.name for effect in found.effects]
    said, = (warning for warning in found.warnings if 'second encoder' in warning)
    assert 'encoder of swing' in said
    number = re.search(r'wind-up of (\S+) rad/\(N m\), (\S+) ms', said)
    assert number is not None
    assert float(number[1]) == pytest.approx(2e-5, rel=0.1)
    assert 1e-3 * float(number[2]) == pytest.approx(LOSS, rel=0.3)


@pytest.mark.parametrize(('of', 'drive'), [('motion', JOINT), ('load', 0)])
def test_a_clearance_that_the_second_encoder_tells_is_lost_motion(
        tmp_path: Path, of: str, drive: int) -> None:
    """The efforts are those of the motor's motion: 0.2 mrad would hardly change them."""
    model = real_arm(tmp_path)
    moved, plain = motion(20.0), wound_up(model, 0.0)
    side = (moved.velocity if of == 'motion'
            else model.drive_forces(moved).mechanism.transmitted)[:, drive]
    link = plain.channels['link_position'].copy()
    link[:, drive] -= 1e-4 * np.sign(side)
    said, = (warning for warning in diagnose(model, [replace(plain, channels={
        'link_position': link})]).warnings if 'second encoder' in warning)
    number = re.search(r'clearance of (\S+) rad .*whose side the (\S+) chooses', said)
    assert number is not None
    assert float(number[1]) == pytest.approx(2e-4, rel=0.15)
    assert number[2] == of
