# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Random files of a slide and of a two-link arm: read as they were written, or a question.

Motion and efforts come from equations of their own, not from the package.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_files import ARM, arm_efforts, drawn, motion

from pprs_dynamics.app.api.first_model import first_model
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.files.bag_files import write_bag
from pprs_dynamics.measurement.files.recording import read_recording
from pprs_dynamics.measurement.files.samples import Samples
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import parse_parameters


def outcome(folder: Path, seed: int) -> str:
    """Return `right`, `asked`, `asked in vain` or what is wrong of a random file."""
    file = drawn(folder, seed)
    time, q, effort = file.truth
    asked = 'asked' if file.needs_question else 'asked in vain'
    try:
        first = first_model(folder / 'robot.urdf', [file.path], folder / 'robot.yaml',
                            rate=file.rate)
    except PprsError:
        return asked
    if first.questions or not first.has_efforts:
        return asked
    found = read_recording(file.path, first.model.recorded)
    if not np.allclose(found.time, time, atol=1e-5):
        return 'time'
    if not np.allclose(found.position, q, atol=max(file.tolerance, 1e-3)):
        return 'position'
    # Efforts of a file are right where their unit is.
    return 'right' if np.allclose(found.effort, effort, rtol=1e-3, atol=0.01) else 'effort'


@pytest.mark.parametrize('suffix', ['csv', 'mcap'])
@pytest.mark.parametrize('names', ['position effort', 'effort', 'position'])
def test_the_line_for_exchanged_drives_reads_them_rightly(names: str, suffix: str, tmp_path: Path,
                                                          ) -> None:
    time, q, v, a = motion(np.random.default_rng(3), 2, 1.0)
    effort = arm_efforts(q, v, a) + np.random.default_rng(4).normal(0, 0.03, q.shape)
    (tmp_path / 'robot.urdf').write_text(ARM)
    joints = ('shoulder', 'elbow')
    position, other = (values[:, ::-1] if quantity in names else values
                       for quantity, values in (('position', q), ('effort', effort)))
    path = tmp_path / f'run.{suffix}'
    if suffix == 'mcap':
        write_bag(path, {'/joint_states': Samples(joints, time, position, None, other)})
    else:
        np.savetxt(path, np.column_stack([time, position, other]), delimiter=',', comments='',
                   header=','.join(('time', *(f'{joint}/{quantity}' for quantity in (
                       'position', 'effort') for joint in joints))))
    first = first_model(tmp_path / 'robot.urdf', [path], tmp_path / 'robot.yaml')
    line = first.questions[0].partition('write ')[2]
    model = DriveModel.from_parameters(parse_parameters(
        f'{first.text}    {line}\n', 'robot.yaml'), source=str(tmp_path / 'robot.yaml'))
    found = read_recording(path, model.recorded)
    np.testing.assert_allclose(found.position, q)
    np.testing.assert_allclose(found.effort, effort)


@pytest.mark.parametrize(('first', 'count'), [
    (0, 10), pytest.param(10, 140, marks=pytest.mark.slow)])
def test_random_files_are_read_rightly_or_asked_about(first: int, count: int, tmp_path: Path,
                                                      ) -> None:
    found = {seed: outcome(tmp_path, seed) for seed in range(first, first + count)}
    assert {seed: what for seed, what in found.items()
            if what not in ('right', 'asked', 'asked in vain')} == {}
    assert sum(what == 'asked in vain' for what in found.values()) <= max(1, 0.05 * count)


DEGREE = 180 / np.pi
TITLES = {  # of a quantity: its columns, and their multiple of SI
    'kuka': {'q': ('A{}_Ist [Grad]', DEGREE), 'x': ('A{}_Soll [Grad]', DEGREE), 'tau': (
        'M{}_Ist [Nm]', 1.0)},
    'letters': {'q': ('phi{}[rad]', 1.0), 'v': ('n{}[rpm]', 30 / np.pi), 'tau': ('T{}[Nm]', 1.0)},
    'scope': {'q': ('Axis{}.fActPos', DEGREE), 'v': ('Axis{}.fActVelo', DEGREE), 'tau': (
        'Axis{}.fActTorque', 1.0)},
    'suffixes': {'q': ('pos{}_deg', DEGREE), 'tau': ('torque{}_mNm', 1e3)},
    'inches': {'q': ('Joint {} Angle, deg', DEGREE), 'tau': ('Joint {} Torque, lbf-in', 8.8507458)},
    'both sides of a gear': {'x': ('motor_pos_{}', 100.0), 'q': ('joint_pos_{}', 1.0),
                             'tau': ('joint_torque_{}', 1.0)},
    'measured': {'q': ('qm{}', 1.0), 'v': ('qdm{}', 1.0), 'tau': ('taum{}', 1.0)},
}


def written(folder: Path, titles: dict[str, tuple[str, float]]) -> tuple[Path, dict[str, object]]:
    """Write a run of the arm under titles, and return its file and the truth."""
    random = np.random.default_rng(7)
    time, q, v, a = motion(random, 2, 1.0)
    truth = {'q': q, 'v': v, 'x': q + 0.01,
             'tau': arm_efforts(q, v, a) + random.normal(0, 0.03, q.shape)}
    columns = {title.format(k + 1): factor * truth[key][:, k]
               for key, (title, factor) in titles.items() for k in range(2)}
    path = folder / 'run.csv'
    np.savetxt(path, np.column_stack([time, *columns.values()]), delimiter=';', comments='',
               header=';'.join(('t [s]', *columns)), fmt='%.9g')
    (folder / 'robot.urdf').write_text(ARM)
    return path, truth


@pytest.mark.parametrize('program', TITLES)
def test_units_in_titles_say_what_a_column_is(program: str, tmp_path: Path) -> None:
    path, truth = written(tmp_path, TITLES[program])
    first = first_model(tmp_path / 'robot.urdf', [path], tmp_path / 'robot.yaml')
    found = read_recording(path, first.model.recorded)
    assert not first.questions
    np.testing.assert_allclose(found.position, truth['q'], atol=1e-6)
    np.testing.assert_allclose(found.effort, truth['tau'], rtol=1e-5, atol=1e-5)
    if 'v' in TITLES[program]:
        assert found.velocity is not None
        np.testing.assert_allclose(found.velocity, truth['v'], atol=1e-6)


@pytest.mark.parametrize('other', ['target_moment_{}', 'Dist Torq {} [Nm]'])
def test_measured_currents_come_before_efforts_that_are_none(other: str, tmp_path: Path) -> None:
    path, truth = written(tmp_path, {'x': ('target_q_{}', 1.0), 'q': ('actual_q_{}', 1.0),
                                     'v': (other, 1.0), 'tau': ('actual_current_{}', 0.1)})
    first = first_model(tmp_path / 'robot.urdf', [path], tmp_path / 'robot.yaml')
    found = read_recording(path, first.model.recorded)
    assert found.gain is not None
    np.testing.assert_allclose(found.effort, 0.1 * truth['tau'], atol=1e-6)


def test_without_names_what_was_asked_for_is_not_what_was_measured(tmp_path: Path) -> None:
    random = np.random.default_rng(2)
    _, q, v, a = motion(random, 2, 1.0)
    late = np.roll(np.arange(len(q)), 2)
    late[:2] = 0
    measured = q[late] + random.normal(0, 2e-5, q.shape)
    effort = (arm_efforts(q, v, a) + random.normal(0, 0.03, q.shape))[late]
    path = tmp_path / 'run.csv'
    np.savetxt(path, np.column_stack([q, measured, v, v[late], a, effort]), delimiter=',')
    (tmp_path / 'robot.urdf').write_text(ARM)
    first = first_model(tmp_path / 'robot.urdf', [path], tmp_path / 'robot.yaml', rate=100.0)
    found = read_recording(path, first.model.recorded)
    np.testing.assert_allclose(found.position, measured)
    np.testing.assert_allclose(found.effort, effort)


def test_a_log_may_have_columns_of_words(tmp_path: Path) -> None:
    time, q, v, a = motion(np.random.default_rng(3), 2, 1.0)
    effort = arm_efforts(q, v, a) + np.random.default_rng(4).normal(0, 0.03, q.shape)
    heads = ['%time', 'field.name0', 'field.name1', *(
        f'field.{quantity}{k}' for quantity in ('position', 'effort') for k in range(2))]
    rows = [f'{1.7e18 + 1e9 * t:.0f},shoulder,elbow,' + ','.join(f'{x:.9g}' for x in (*p, *e))
            for t, p, e in zip(time, q, effort, strict=True)]
    path = tmp_path / 'run.csv'
    path.write_text('\n'.join([','.join(heads), *rows]))
    (tmp_path / 'robot.urdf').write_text(ARM)
    first = first_model(tmp_path / 'robot.urdf', [path], tmp_path / 'robot.yaml')
    found = read_recording(path, first.model.recorded)
    np.testing.assert_allclose(found.position, q, atol=1e-6)
    np.testing.assert_allclose(found.effort, effort, atol=1e-6)


def test_velocities_contradict_the_unit_of_times(tmp_path: Path) -> None:
    path, _ = written(tmp_path, {'q': ('q{}', 1.0), 'v': ('dq{}', 1.0), 'tau': ('tau{}', 1.0)})
    path.write_text(path.read_text().replace('t [s]', 't [ms]'))
    first = first_model(tmp_path / 'robot.urdf', [path], tmp_path / 'robot.yaml')
    assert any('time_scale: 1' in question for question in first.questions)
