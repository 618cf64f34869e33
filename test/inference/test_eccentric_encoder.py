# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Encoders beside their axis: the wave, its columns, and what it is told apart from."""

from __future__ import annotations

import made_up_arm
import numpy as np
import pytest
from numpy.testing import assert_allclose

from pprs_dynamics import DriveModel
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.measurement.files.recording import Recording

JOINT = 1
GEAR = 20.0
PITCH = 2 * np.pi / GEAR


@pytest.fixture(scope='module')
def arm(tmp_path_factory):
    return made_up_arm.real_arm(tmp_path_factory.mktemp('arm'), **{
        'robot.gear_ratio': (1.0, GEAR, 1.0)})


def with_effect(arm, name, **values):
    found = DriveModel.from_parameters({**arm.values, 'effects.active': [name], **{
        f'effects.{name}.swing.{key}': value for key, value in values.items()}}, arm.source)
    return found


def with_wave(arm, amplitude=0.002, phase=0.7, pitch=PITCH):
    return with_effect(arm, 'eccentric_encoder', amplitude=amplitude, phase=phase, pitch=pitch)


def disc(q: np.ndarray, beside: float, turns: float, phase: float) -> np.ndarray:
    """Return what the head of a disc beside its axis reads, turned as fast as the joint or more."""
    x = turns * q + phase
    return q + np.arctan2(beside * np.sin(x), 1 - beside * np.cos(x)) / turns


def recorded(arm, read=lambda q: q, model=None, seed=1):
    """Record a motion whose encoder on the swing reads otherwise, by a model's forces."""
    moved = made_up_arm.motion(20.0)
    model = arm if model is None else model
    forces = model.measured(model.drive_forces(moved)).total
    position = moved.position + model.position_error(moved.position)
    position[:, JOINT] = read(position[:, JOINT])
    noise = np.random.default_rng(seed)
    return Recording.from_arrays(
        'run', moved.time, position + 2e-5 * noise.uniform(-0.5, 0.5, position.shape), None,
        forces + 0.2 * noise.normal(size=forces.shape), arm.drives)


def test_a_wave_is_read_too_much_and_no_force(arm):
    moved = made_up_arm.motion(5.0)
    model = with_wave(arm)
    error = model.position_error(moved.position)
    assert_allclose(error[:, JOINT], 0.002 * np.sin(GEAR * moved.position[:, JOINT] + 0.7),
                    atol=1e-15)
    assert not error[:, [0, 2]].any()
    assert_allclose(model.drive_forces(moved).total, arm.drive_forces(moved).total)


@pytest.mark.parametrize(('turns', 'beside'), [(1.0, 0.02), (GEAR, 0.06)])
def test_a_disc_beside_its_axis_is_found(arm, turns, beside):
    found = diagnose(arm, [recorded(arm, lambda q: disc(q, beside, turns, 0.5))])
    assert [(one.name, one.drives) for one in found.effects] == [('eccentric_encoder', ('swing',))]
    told = found.effects[0].parameters
    assert told['swing.pitch'].value == pytest.approx(2 * np.pi / turns, rel=0.1)
    assert told['swing.amplitude'].value == pytest.approx(beside / turns, rel=0.15)


@pytest.mark.parametrize(('name', 'values'), [
    ('homing_error', {'zero': 0.015}),
    ('force_ripple', {'force': 1.5, 'phase': 0.4, 'pitch': PITCH})])
def test_what_it_is_taken_for_stays_what_it_is(arm, name, values):
    model = with_effect(arm, name, **values)
    found = diagnose(arm, [recorded(arm, model=model)])
    assert [one.name for one in found.effects] == [name]
