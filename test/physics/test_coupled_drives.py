# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction of motors that turn with several joints, and cylinders between two links."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_arm import motion, write_arm
from model_recordings import with_effects
from numpy.testing import assert_allclose

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import ModelError

MAP = '{wrist: {turn: -0.5, swing: 2.0}}'


@pytest.fixture
def arm(tmp_path):
    return DriveModel.load(write_arm(tmp_path, friction__motors=MAP))


def added(model, name, at, **values):
    return with_effects(model, {name: {key.replace('__', '.'): value for key, value in
                                       values.items()}}).drive_forces(at).parts[name]


def test_friction_at_the_motor_does_the_same_work_as_in_its_joints(arm):
    at = motion()
    force = added(arm, 'coupled_drives', at, wrist__viscous=0.7, wrist__coulomb=3.0)
    speed = -0.5 * at.velocity[:, 0] + 2.0 * at.velocity[:, 1]
    fast = np.abs(speed) > 0.3  # far from where it turns over
    assert fast.mean() > 0.5
    rubbed = 0.7 * speed ** 2 + 3.0 * np.abs(speed)
    assert_allclose(np.sum(force * at.velocity, axis=1)[fast], rubbed[fast], rtol=1e-9)
    # Each joint by its share of the map, the third not at all.
    assert_allclose(force[:, 0] * 2.0, force[:, 1] * -0.5)
    assert not force[:, 2].any()


@pytest.mark.parametrize(('motors', 'sentence'), [
    ('{wrist: {turn: 1.0, elbow: 1.0}}', 'elbow'),
    ('{wrist: {turn: 1.0}}', 'move two joints or more'),
    ('{wrist: {turn: 1.0, swing: fast}}', 'friction.motors.wrist.swing')])
def test_a_map_that_cannot_be_is_told(tmp_path, motors, sentence):
    with pytest.raises(ModelError, match=sentence):
        DriveModel.load(write_arm(tmp_path, friction__motors=motors))


def stretched(q, nearer, farther, place):
    """Return the distance of two points, one of which turns."""
    return np.linalg.norm(nearer * np.stack([np.cos(q - place), np.sin(q - place)])
                          - [[farther], [0.0]], axis=0)


def test_a_spring_between_links_has_the_torque_of_its_energy(arm):
    q = np.linspace(-1.2, 1.4, 400)
    at = motion(duration=4.0)
    position = at.position.copy()
    position[:, 1] = q
    still = type(at)(position, 0 * position, 0 * position, at.time)
    # 80 mm and 0.4 m from the axis, 3000 N/m, 0.15 m long where it pulls nothing.
    nearer, farther, stiffness, free, place = 0.08, 0.4, 3000.0, 0.15, 0.5
    force = added(arm, 'counterbalance', still, swing__force=-stiffness * free * farther,
                  swing__stiffness=stiffness * farther ** 2, swing__ratio=nearer / farther,
                  swing__position=place)
    step = 1e-5
    energy = [stiffness / 2 * (stretched(q + side * step, nearer, farther, place) - free) ** 2
              for side in (-1, 1)]
    assert_allclose(force[:, 1], (energy[1] - energy[0]) / (2 * step), rtol=1e-6, atol=1e-6)
    assert not force[:, [0, 2]].any()


def test_a_cylinder_pulls_with_the_pressure_that_was_measured(arm):
    at = motion(duration=4.0)
    pressure = 5e6 + 1e6 * np.sin(at.time)
    measured = at.with_channels({'pressure': np.tile(pressure, (3, 1)).T})
    shape = {'swing__ratio': 0.2, 'swing__position': 0.5, 'swing__force': 0.0}
    force = added(arm, 'counterbalance', measured, swing__area=3e-5, **shape)
    # The same as a constant pull of that size at every moment.
    unit = added(arm, 'counterbalance', at, **{**shape, 'swing__force': 1.0})
    assert_allclose(force[:, 1], 3e-5 * pressure * unit[:, 1])
    assert not added(arm, 'counterbalance', at, swing__area=3e-5, **shape).any()
