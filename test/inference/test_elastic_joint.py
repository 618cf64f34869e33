# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Joints that wind up between two encoders."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import made_up_arm
import numpy as np
import pytest

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel

SWING, NOISE = 1, 0.02  # [N m]
COMPLIANCE, LOSS = 1.5e-3, 0.02  # [rad/(N m)], [s]


def wound_up(model: DriveModel, compliance: float, loss: float = 0.0, second: bool = True,
             shift: float = 0.0) -> Recording:
    """Record a motor that leads a link which moves smoothly, and the link.

    k w + d dw/dt = tau, step by step; friction turns over with the motor.
    """
    moved = made_up_arm.motion(20.0)
    assert moved.time is not None
    forces = model.drive_forces(moved)
    load = forces.mechanism.transmitted[:, SWING]
    step = moved.time[1] - moved.time[0]
    windup = np.empty_like(load)
    windup[0] = compliance * load[0]
    kept = np.exp(-step / loss) if loss else 0.0
    for k in range(1, len(load)):
        windup[k] = kept * windup[k - 1] + (1 - kept) * compliance * load[k]
    width = float(model.reversal.widths(3)[SWING])
    link = moved.velocity[:, SWING]
    motor_speed = link + np.gradient(windup, step)
    viscous, dry = (made_up_arm.FRICTION[f'friction.{name}'][SWING]
                    for name in ('viscous', 'coulomb'))
    forces.total[:, SWING] += viscous * (motor_speed - link) + dry * (
        np.tanh(motor_speed / width) - np.tanh(link / width))
    random = np.random.default_rng(3)

    def read(position: Array) -> Array:
        return position + 1e-5 * random.normal(size=position.shape)

    motor = moved.position.copy()
    motor[:, SWING] += windup + shift
    effort = forces.total + NOISE * random.normal(size=forces.total.shape)
    return Recording.from_arrays('run', moved.time, read(motor), None, effort, model.drives, {
        'link_position': read(moved.position + 0.01)} if second else {})


def test_an_elastic_joint_is_found_with_its_compliance(tmp_path: Path) -> None:
    model = made_up_arm.real_arm(tmp_path)
    found = diagnose(model, [wound_up(model, COMPLIANCE, LOSS)])
    assert [(one.name, one.drives) for one in found.effects] == [('elastic_joint', ('swing',))]
    told = found.effects[0].parameters
    assert told['swing.compliance'].value == pytest.approx(COMPLIANCE, rel=0.1)
    assert told['swing.loss'].value == pytest.approx(LOSS, abs=0.01)


def test_what_efforts_do_not_show_the_second_encoder_tells(tmp_path: Path) -> None:
    model = made_up_arm.real_arm(tmp_path)
    found = diagnose(model, [wound_up(model, 2e-5, LOSS)])
    assert found.verdict != 'effect'
    assert 'elastic_joint' not in [one.name for one in found.effects]
    said, = (one for one in found.warnings if 'second encoder' in one)
    assert 'encoder of swing' in said
    number = re.search(r'wind-up of (\S+) rad/\(N m\), (\S+) ms', said)
    assert number is not None
    assert float(number[1]) == pytest.approx(2e-5, rel=0.1)
    assert 1e-3 * float(number[2]) == pytest.approx(LOSS, rel=0.3)


@pytest.mark.parametrize(('of', 'drive'), [('motion', SWING), ('load', 0)])
def test_a_clearance_that_the_second_encoder_tells_is_lost_motion(
        tmp_path: Path, of: str, drive: int) -> None:
    """The efforts are those of the motor's motion: 0.2 mrad would hardly change them."""
    model = made_up_arm.real_arm(tmp_path)
    moved, plain = made_up_arm.motion(20.0), wound_up(model, 0.0)
    side = (moved.velocity if of == 'motion'
            else model.drive_forces(moved).mechanism.transmitted)[:, drive]
    link = plain.channels['link_position'].copy()
    link[:, drive] -= 1e-4 * np.sign(side)
    said, = (one for one in diagnose(model, [replace(plain, channels={
        'link_position': link})]).warnings if 'second encoder' in one)
    number = re.search(r'clearance of (\S+) rad .*whose side the (\S+) chooses', said)
    assert number is not None
    assert float(number[1]) == pytest.approx(2e-4, rel=0.15)
    assert number[2] == of
