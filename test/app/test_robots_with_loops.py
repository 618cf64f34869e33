# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The commands on robots with loops: what is hidden in the engine is named, where it is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from documents import checked

from pprs_dynamics.app.commands.pprs import main

pytestmark = pytest.mark.slow

HEXAPOD = 'config/hexapod.yaml'


def simulated(folder: Path, *effects: str, model: str = HEXAPOD, seed: int = 3) -> Path:
    """Return a recording with effects; what they are is beside it."""
    path = folder / 'run.csv'
    hidden = [word for effect in effects for word in ('--effect', effect)]
    assert main(['simulate', '--model', model, '--output', str(path), '--seed', str(seed),
                 '--json', str(folder / 'truth.json'), *hidden]) == 0
    return path


def truth(folder: Path) -> list[dict]:
    return json.loads((folder / 'truth.json').read_text())['effects']


def test_info_tells_of_bodies_joints_loops_and_mobility(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = tmp_path / 'info.json'
    assert main(['info', '--model', HEXAPOD, '--json', str(found)]) == 0
    said = capsys.readouterr().out
    assert '13 bodies, 10.2 kg in total' in said
    assert '6 degrees of freedom, 6 drives' in said
    robot = checked(found.read_text(), 'info')['robot']
    assert list(robot['loops']) == [f'ball_{k}' for k in range(1, 7)]
    assert set(robot['joints'].values()) == {'driven', 'passive'}
    assert 1 < robot['condition_number'] < 100


def test_friction_of_one_passive_joint_is_named_and_adopted(tmp_path: Path) -> None:
    run = simulated(tmp_path, 'joint_friction')
    (key, hidden), = truth(tmp_path)[0]['parameters'].items()
    joint, _, _ = key.rpartition('.')
    answer, model = tmp_path / 'why.json', tmp_path / 'with.yaml'
    assert main(['diagnose', str(run), '--model', HEXAPOD, '--json', str(answer)]) == 0
    found = json.loads(answer.read_text())['effects']
    assert [effect['name'] for effect in found] == ['joint_friction']
    torque = found[0]['parameters'][key]
    assert torque['std'] < 0.03 * hidden
    assert abs(torque['value'] - hidden) < 3 * torque['std']
    # It turns over in less than the model's width, and that is no viscous friction.
    viscous = found[0]['parameters'][f'{joint}.viscous']
    assert abs(viscous['value']) <= 3 * viscous['std']
    assert main(['adopt', 'joint_friction', str(run), '--model', HEXAPOD, '--output',
                 str(model)]) == 0
    block = yaml.safe_load(model.read_text())['/**']['ros__parameters']['effects']
    assert list(block['joint_friction']) == [joint]
    assert main(['compare', str(run), '--model', str(model), '--json', str(answer)]) == 0
    assert json.loads(answer.read_text())['overall']['rms'] < 0.2
