# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Torque constants that go with temperature and position: what sensors show, and its columns."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_arm import motion, real_arm
from numpy.testing import assert_allclose

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.current_gain import CurrentGain

JOINT = 1
VALUES = {'temperature': 0.002, 'ripple': 0.05, 'phase': 0.3, 'reference': 30.0, 'pitch': 0.2}


@pytest.fixture(scope='module')
def arm(tmp_path_factory):
    return real_arm(tmp_path_factory.mktemp('arm'), **{'robot.gear_ratio': (50.0, 50.0, 1.0)})


def with_gain(arm, **values):
    found = DriveModel.from_parameters({**arm.values, 'effects.active': ['current_gain'], **{
        f'effects.current_gain.swing.{key}': value for key, value in {**VALUES, **values}.items()}},
        arm.source)
    return found


def warm(at: JointMotion) -> JointMotion:
    """Return a motion of drives that warm by a kelvin a second from 20 degrees on."""
    assert at.time is not None
    return at.with_channels({'temperature': np.tile(20 + at.time, (3, 1)).T})


def test_an_effort_is_measured_in_proportion_to_itself_warmth_and_wave(arm):
    at = warm(motion(20.0))
    model = with_gain(arm)
    forces = model.drive_forces(at)
    seen = model.measured(forces).total
    factor = 1 + 0.002 * (at.time - 10) + 0.05 * np.sin(2 * np.pi * at.position[:, 1] / 0.2 + 0.3)
    assert_allclose(seen[:, JOINT], factor * forces.total[:, JOINT])
    assert_allclose(seen[:, [0, 2]], forces.total[:, [0, 2]])
    # It is no force: what is commanded does not have it.
    assert_allclose(forces.total, arm.drive_forces(at).total)


def recorded(arm, model):
    at = warm(motion(20.0))
    return Recording.from_arrays('x', at.time, at.position, None,
                                 model.measured(model.drive_forces(at)).total, arm.drives,
                                 at.channels)


def test_columns_are_differences_of_models(arm):
    design = Design.of(arm, [recorded(arm, arm)])
    shape = {'reference': 30.0, 'pitch': 0.2}
    rows = design.drive_rows(CurrentGain, JOINT, shape)
    for values, c in (({'temperature': 1e-3, 'ripple': 0.0}, np.array([1e-3, 0, 0])),
                      ({'temperature': 0.0, 'ripple': 0.01, 'phase': 0.0}, np.array([0, 0.01, 0])),
                      ({'temperature': 0.0, 'ripple': 0.01, 'phase': np.pi / 2},
                       np.array([0, 0, 0.01]))):
        changed = Design.of(with_gain(arm, **values), [recorded(arm, arm)])
        assert_allclose(changed.forces[:, JOINT] - design.forces[:, JOINT], c @ rows, atol=1e-9)
