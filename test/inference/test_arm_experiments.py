# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motions that excite an arm: within its limits, at rest at both ends, and worth their time."""

from __future__ import annotations

import json
from pathlib import Path

import made_up_arm as arm
import numpy as np
import pandas as pd
import pytest

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.experiments.next_experiment import COMMISSION, next_experiment
from pprs_dynamics.measurement.files.recording import read_recording, write_recording
from pprs_dynamics.physics.model.model_writer import write_model

DURATION = 12.0
CORNER = 0.03  # share of a period in which the speed changes
NOISE = 1.5  # [N m, N], white: so much that the corners do not tell


@pytest.fixture(scope='module')
def model(tmp_path_factory: pytest.TempPathFactory) -> DriveModel:
    return arm.real_arm(tmp_path_factory.mktemp('arm'))


@pytest.fixture(scope='module')
def found(model: DriveModel):
    return next_experiment(model, (), COMMISSION, duration=DURATION, seed=1)


def test_it_keeps_the_limits_with_their_margin(model: DriveModel, found) -> None:
    motion = found.motion(np.linspace(0, DURATION, 5001))
    tree = model.robot.structure
    assert np.all(np.abs(motion.position) <= 0.901 * np.minimum(tree.upper, np.pi))
    assert np.all(np.abs(motion.velocity) <= 0.901 * tree.speed)
    assert np.all(np.abs(motion.acceleration) <= 0.901 * 5.0)
    assert np.all(np.abs(model.drive_forces(motion).total) <= 0.91 * tree.effort)
    assert max(found.limits.values()) <= 1.001


def test_the_command_writes_what_a_controller_can_play(tmp_path: Path) -> None:
    path = str(arm.write_arm(tmp_path))
    output, answer = str(tmp_path / 'next.csv'), tmp_path / 'next.json'
    assert main(['next-experiment', '--model', path, '--purpose', 'commission', '--output', output,
                 '--json', str(answer)]) == 0
    table = pd.read_csv(output)
    assert len(table) == 2001
    assert {f'{joint}/{name}' for joint in arm.JOINTS
            for name in ('position', 'velocity', 'acceleration')} < set(table.columns)
    told = json.loads(answer.read_text())
    assert 0 < told['determined'] <= told['total']


@pytest.fixture(scope='module')
def one_speed(model: DriveModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording in which swing hardly changes its speed: what lacks there is open."""
    folder = tmp_path_factory.mktemp('one_speed')
    period, rate = 8.0, 100.0
    time = np.arange(0, 40, 1 / rate)
    phase = (time / period) % 1
    # There and back at constant speed, with rounded corners: viscous friction looks like dry.
    corner = CORNER
    speed = np.tanh((np.minimum(phase, 1 - phase)) / (corner / 3)) * np.tanh(
        (0.5 - phase) / (corner / 3))
    q = np.zeros((3, len(time), 3))
    for joint, size in enumerate((0.3, 0.3, 0.05)):
        v = size * speed
        q[0, :, joint] = np.concatenate(([0.0], np.cumsum((v[1:] + v[:-1]) / 2 / rate)))
        q[1, :, joint], q[2, :, joint] = v, np.gradient(v, 1 / rate)
    viscous = list(model.values['friction.viscous'])
    viscous[1] += 6.0
    real = DriveModel.from_parameters(
        {**model.values, 'friction.viscous': tuple(viscous)}, model.source)
    path = folder / 'run.csv'
    write_recording(path, arm.record(real, JointMotion(*q, time), NOISE))
    return path


def test_a_motion_is_designed_that_tells_rivals_apart(
    model: DriveModel, one_speed: Path, tmp_path: Path,
) -> None:
    path, answer = tmp_path / 'arm.yaml', tmp_path / 'next.json'
    write_model(path, model.values, model.source)
    output, page = tmp_path / 'next.csv', tmp_path / 'next.html'
    assert main(['next-experiment', str(one_speed), '--model', str(path), '--output', str(output),
                 '--json', str(answer), '--report', str(page)]) == 0
    told = json.loads(answer.read_text())
    assert told['question'] == 'separate'
    asked = {frozenset(pair) for pair in told['separates'] + told['does_not_separate']}
    assert any('viscous_friction' in pair for pair in asked)
    assert told['separates']
    assert told['expected_evidence'] > 20
    assert max(told['limits'].values()) <= 1.001
    assert 'N m' in page.read_text()
    # The promise is kept: the rival falls behind in a diagnosis of both runs.
    table = pd.read_csv(output)
    moved = JointMotion(*(table[[f'{joint}/{name}' for joint in arm.JOINTS]].to_numpy()
                          for name in ('position', 'velocity', 'acceleration')),
                        table['time'].to_numpy())
    real = DriveModel.from_parameters({**model.values, 'friction.viscous': tuple(
        np.add(model.values['friction.viscous'], (0, 6.0, 0)))}, model.source)
    second = tmp_path / 'second.csv'
    write_recording(second, arm.record(real, moved, NOISE, seed=1))
    found = diagnose(model, [read_recording(one_speed, model.drives),
                             read_recording(second, model.drives)])
    assert [one.name for one in found.effects] == ['viscous_friction']
    assert found.indistinguishable == ()
