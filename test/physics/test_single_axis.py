# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A single axis: its forces, its files, and the same commands on recordings of one drive."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pprs_command import pprs
from single_axis import AXIS, axis_values

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.errors import ModelError, MotionError
from pprs_dynamics.inference.residuals.reconstruction import reconstruct
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.model.model_writer import write_model

MASS, VISCOUS, COULOMB, OFFSET, WIDTH = 20.0, 40.0, 6.0, -2.0, 0.001
VALUES = axis_values(MASS, VISCOUS, COULOMB, OFFSET, width=WIDTH)
SPRING, CENTRE = 55.0, 0.03  # N/m, m: hidden
NOISE, RATE = 0.05, 500.0
EQUAL = 1e-12


def sweep(duration: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return time, position, velocity and acceleration of a sum of sines."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 1 / RATE)
    omega = 2 * np.pi * np.array([0.21, 0.37, 0.83])[:, None]
    phase = omega * time + rng.uniform(0, 2 * np.pi, (3, 1))
    size = np.array([0.08, 0.04, 0.015])[:, None]
    return (time, (size * np.sin(phase)).sum(0), (size * omega * np.cos(phase)).sum(0),
            -(size * omega ** 2 * np.sin(phase)).sum(0))


def textbook_force(q_dot: Any, q_ddot: Any, gravity: float = 0.0) -> Any:
    return (MASS * (q_ddot - gravity) + VISCOUS * q_dot + COULOMB * np.tanh(q_dot / WIDTH)
            + OFFSET)


def bench(seed: int, hidden: bool = True, duration: float = 20.0, offset: float = 0.0,
          ) -> Recording:
    """Return a recording of an axis, with a spring that the model does not know, or not."""
    time, q, q_dot, q_ddot = sweep(duration, seed)
    force = textbook_force(q_dot, q_ddot) + offset + hidden * SPRING * (q - CENTRE)
    rng = np.random.default_rng(seed)
    encoder = 1e-6
    return Recording.from_arrays(
        f'bench_{seed}', time, (encoder * np.round(q / encoder))[:, None], None,
        (force + NOISE * rng.standard_normal(len(time)))[:, None], (AXIS,))


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a model file and two recordings of an axis with a hidden spring."""
    folder = tmp_path_factory.mktemp('axis')
    write_model(folder / 'axis.yaml', VALUES)
    write_recording(folder / 'run.csv', bench(1))
    write_recording(folder / 'other.mcap', bench(2, duration=12.0))
    return folder


@pytest.mark.parametrize('gravity', [0.0, -9.81])
def test_the_force_is_the_textbooks(gravity: float) -> None:
    time, q, q_dot, q_ddot = sweep(3.0)
    model = DriveModel.from_parameters({**VALUES, 'robot.gravity': [0.0, 0.0, gravity]})
    forces = model.drive_forces(JointMotion(q[:, None], q_dot[:, None], q_ddot[:, None], time))
    np.testing.assert_allclose(forces.total[:, 0], textbook_force(q_dot, q_ddot, gravity),
                               rtol=0, atol=1e-9)
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


def test_a_recording_of_other_drives_is_refused_by_name() -> None:
    time = np.arange(0.0, 5.0, 0.01)
    other = Recording.from_arrays('x', time, np.sin(time)[:, None], drives=('lift_1',))
    with pytest.raises(MotionError, match='they are lift_1, must be axis'):
        reconstruct(DriveModel.from_parameters(VALUES), other)


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
    # Means over 10 ms of white noise.
    floor = NOISE / np.sqrt(0.01 * RATE)
    assert json.loads((folder / 'after.json').read_text())['overall']['rms'] < 1.3 * floor
