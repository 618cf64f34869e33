# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What follows the load of a drive: gear losses in two quadrants; one load tells nothing."""

from __future__ import annotations

from pathlib import Path

import made_up_arm
import numpy as np
import pytest
from single_axis import axis_values

from pprs_dynamics import DriveModel
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion

TIME = np.arange(0, 30, 0.01)
MASS, GRAVITY = 20.0, -9.81


def with_gear_losses(folder: Path, driving: float, driven_back: float) -> Diagnosis:
    """Diagnose an arm whose second joint has them, computed from its rigid forces alone."""
    model = made_up_arm.real_arm(folder)
    moved = made_up_arm.motion(20.0)
    plain = made_up_arm.record(model, moved, noise=0.05)
    passed_on = model.drive_forces(moved).parts['rigid_body'][:, 1]
    v = moved.velocity[:, 1]
    share = np.where(passed_on * v > 0, driving, driven_back)
    effort = plain.effort.copy()
    width = float(model.reversal.widths(3)[1])
    effort[:, 1] += share * np.abs(passed_on) * v / np.hypot(v, width)
    return diagnose(model, [Recording.from_arrays(
        'run', plain.time, plain.position, plain.velocity, effort, model.drives)])


def test_a_gear_that_loses_more_while_it_drives_is_no_payload(tmp_path: Path) -> None:
    found = with_gear_losses(tmp_path, 0.25, 0.10)
    assert [(one.name, one.drives) for one in found.effects] == [('gear_efficiency', ('swing',))]
    assert found.verdict == 'effect'
    values = found.effects[0].parameters
    assert values['swing.driving'].value == pytest.approx(0.25, abs=0.01)
    assert values['swing.driven_back'].value == pytest.approx(0.10, abs=0.01)


def test_losses_that_are_alike_in_both_quadrants_are_friction_by_load(tmp_path: Path) -> None:
    found = with_gear_losses(tmp_path, 0.15, 0.15)
    assert [one.name for one in found.effects] == ['load_friction']


def axis() -> DriveModel:
    """Return a vertical axis of a screw."""
    return DriveModel.from_parameters(axis_values(20.0, 100.0, 20.0, gravity=-9.81))


def lifting(acceleration: float, losses: tuple[float, float] = (0.08, 0.08)) -> Diagnosis:
    """Diagnose the axis whose screw loses shares of its load, upwards and downwards.

    At about some acceleration; by default 8 % both ways.
    """
    model, w = axis(), 2 * np.pi * 0.4
    size = acceleration / w ** 2
    q, v, a = (f[:, None] * size for f in (
        np.sin(w * TIME) + np.sin(0.37 * w * TIME), w * (np.cos(w * TIME) + 0.37 * np.cos(
            0.37 * w * TIME)),
        -w ** 2 * (np.sin(w * TIME) + 0.37 ** 2 * np.sin(0.37 * w * TIME))))
    force = model.drive_forces(JointMotion(q, v, a, TIME)).total
    turned, (up, down) = np.tanh(v / 0.001), losses
    share = (up + down + (up - down) * turned) / 2
    force = force + share * np.abs(MASS * (a - GRAVITY)) * turned
    noise = 0.3 * np.random.default_rng(5).normal(size=force.shape)
    return diagnose(model, [Recording.from_arrays('run', TIME, q, v, force + noise, ('axis',))])


def test_one_load_asks_for_another_one() -> None:
    found = lifting(0.3)  # the load varies by 2 %
    assert [effect.name for effect in found.effects] == ['load_friction']
    assert any('coulomb_friction' in warning and 'another load' in warning
               for warning in found.warnings)


def test_a_load_that_varies_tells_them_apart() -> None:
    found = lifting(3.0)
    assert (found.verdict, [one.name for one in found.effects]) == ('effect', ['load_friction'])
    assert not any('another load' in warning for warning in found.warnings)
    value = found.effects[0].parameters['axis.coefficient']
    assert abs(value.value - 0.08) < 3 * value.std
