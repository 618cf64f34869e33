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
from pprs_dynamics.inference.adoption.request import EffectRequest, EffectRequestError
from pprs_dynamics.inference.regression.base_columns import ModelNumber
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.residuals.reconstruction import reconstruct
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.model.keys import set_number
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


def test_a_vertical_axis_at_rest_is_held_against_its_weight() -> None:
    model = DriveModel.from_parameters({**VALUES, 'friction.offset': [0.0],
                                        'robot.gravity': [0.0, 0.0, -9.81]})
    rest = np.zeros((1, 1))
    assert model.drive_forces(JointMotion(rest, rest, rest)).total[0, 0] == MASS * 9.81


@pytest.mark.parametrize(('change', 'sentence'), [
    ({'links.mass': [0.0]}, 'move a body: no link that it moves has a mass'),
    ({'friction.coulomb': [-1.0]}, 'friction.coulomb is [-1.0]'),
    ({'links.masss': [1.0]}, 'did you mean links.mass?'),
    ({'masses.platform': 1.0}, 'unknown key masses.platform'),
    ({'tolerances.links.mass': 2.0}, 'between 0 and 1'),
    ({'tolerances.masses.payload': 0.1}, 'unknown key tolerances.masses.payload'),
    ({'effects.payload_mass.mass': 0.1}, 'be an effect that acts in a single axis'),
    ({'effects.homing_error.axis.zero': 0.001}, 'be an effect that acts in a single axis'),
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


def test_columns_of_numbers_are_what_the_model_changes_by() -> None:
    tolerances = {f'tolerances.{key}': 0.1 for key in (
        'links.mass', 'friction.viscous', 'friction.coulomb', 'friction.offset',
        'friction.reversal_velocity')}
    model = DriveModel.from_parameters(
        {**VALUES, 'robot.gravity': [0.0, 0.0, -9.81], 'tolerances.robot.gravity': 0.1,
                         **tolerances})
    design = Design.of(model, [bench(1)])
    for column in design.base:
        if not isinstance(column, ModelNumber):
            continue
        value, moved = column.number.value, 0.001
        # Away from 0 by a share of one standard deviation.
        after = value + np.sign(value) * moved * column.number.deviation
        values = dict(model.values)
        set_number(values, column.number.key, column.number.element, float(after))
        other = Design.of(DriveModel.from_parameters(values), [bench(1)])
        change = (other.residuals.model - design.residuals.model)[:, 0] / moved
        np.testing.assert_allclose(column.rows[0], change, rtol=0,
                                   atol=2e-3 * np.abs(change).max())


def test_an_offset_that_is_known_roughly_is_found_within_its_tolerance() -> None:
    model = DriveModel.from_parameters({**VALUES, 'tolerances.friction.offset': 1.0})
    design = Design.of(model, [bench(3, hidden=False, offset=-0.5)])
    found = FittedSets(design, DECISIONS).evaluate(())
    place, number = next((k, column.number) for k, column in enumerate(design.base)
                         if isinstance(column, ModelNumber))
    assert OFFSET - found.fit.coefficients[place] * number.deviation == pytest.approx(
        -2.5, abs=0.02)


def test_effects_of_a_platform_are_not_offered_to_an_axis() -> None:
    with pytest.raises(EffectRequestError, match='payload_mass does not act in a single axis'):
        EffectRequest.of('payload_mass').placed(DriveModel.from_parameters(VALUES))
    with pytest.raises(EffectRequestError, match='one of axis'):
        EffectRequest.of('viscous_friction:lift_1', (AXIS,))


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
    history = pprs('history', 'better.yaml', '--json', 'history.json', cwd=folder)
    assert history.returncode == 0, history.stderr
    assert [one['effect'] for one in json.loads((folder / 'history.json').read_text())['steps']
            ] == ['drive_spring']
    undone = pprs('history', 'better.yaml', '--undo', '--output', 'undone.yaml', cwd=folder)
    assert undone.returncode == 0, undone.stderr
    assert {key: DriveModel.load(folder / 'undone.yaml').values[key] for key in VALUES} == VALUES
