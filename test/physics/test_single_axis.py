# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A single axis: its forces, its files, and the same commands on recordings of one drive."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pprs_command import pprs
from single_axis import AXIS, TIME, axis, axis_motion, axis_recording

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import ModelError
from pprs_dynamics.measurement.files.recording import write_recording
from pprs_dynamics.physics.model.model_writer import write_model

VALUES = dict(axis().values)
SPRING = 55.0  # [N/m]: hidden
NOISE = 0.05  # [N]
EQUAL = 1e-12


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a model file and two recordings of an axis with a hidden spring."""
    folder = tmp_path_factory.mktemp('axis')
    write_model(folder / 'axis.yaml', VALUES)
    worn = axis({'drive_spring': {'stiffness': SPRING, 'position': 0.03}})
    for seed, name in enumerate(('run.csv', 'other.mcap')):
        write_recording(folder / name, axis_recording(worn, seed, NOISE))
    return folder


@pytest.mark.parametrize('gravity', [0.0, -9.81])
def test_the_force_is_the_textbooks(gravity: float) -> None:
    moved = axis_motion(TIME)
    forces = axis(**{'robot.gravity': (0.0, 0.0, gravity)}).drive_forces(moved)
    textbook = (20.0 * (moved.acceleration - gravity) + 40.0 * moved.velocity
                + 6.0 * np.tanh(moved.velocity / 0.001) - 2.0)
    np.testing.assert_allclose(forces.total, textbook, rtol=0, atol=1e-9)
    np.testing.assert_allclose(sum(forces.parts.values()), forces.total, rtol=0, atol=EQUAL)


@pytest.mark.parametrize(('change', 'sentence'), [
    ({'links.mass': [0.0]}, 'move a body: no link that it moves has a mass'),
    ({'friction.coulomb': [-1.0]}, 'friction.coulomb is [-1.0]'),
    ({'effects.payload_mass.mass': 0.1}, 'be an effect that acts in a single axis'),
    ({'effects.viscous_friction.lift_1.coefficient': 1.0}, 'unknown drive lift_1 (known: axis)'),
])
def test_a_mistake_in_a_file_is_one_sentence(change: dict[str, float], sentence: str) -> None:
    with pytest.raises(ModelError) as caught:
        DriveModel.from_parameters({**VALUES, **change})
    assert sentence in str(caught.value)


def test_diagnose_names_the_hidden_effect_and_writes_a_model_that_has_it(folder: Path) -> None:
    done = pprs('diagnose', 'run.csv', '--validate', 'other.mcap', '--model', 'axis.yaml',
                '--adopt-all', '--output', 'better.yaml', '--json', 'result.json', cwd=folder)
    assert done.returncode == 0, done.stderr
    found = json.loads((folder / 'result.json').read_text())
    assert [one['name'] for one in found['effects']] == ['drive_spring']
    assert found['effects'][0]['drives'] == [AXIS]
    values = found['effects'][0]['parameters']
    stiffness = values['axis.stiffness']
    assert abs(stiffness['value'] - SPRING) < 4 * stiffness['std'] + 0.01 * SPRING
    better = DriveModel.load(folder / 'better.yaml')
    assert better.kind == 'slide'
    assert better.values['effects.active'] == ('drive_spring',) or better.values[
        'effects.active'] == ['drive_spring']
    after = pprs('compare', 'other.mcap', '--model', 'better.yaml', '--json', 'after.json',
                 cwd=folder)
    assert after.returncode == 0, after.stderr
    floor = NOISE / np.sqrt(2)  # means over 10 ms of white noise
    assert json.loads((folder / 'after.json').read_text())['overall']['rms'] < 1.3 * floor
