# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Random files of a slide and of a two-link arm: read as they were written, or a question.

Motion and efforts come from equations of their own, not from the package.
"""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from made_up_files import ARM, SLIDE, arm_efforts, drawn, motion

from pprs_dynamics.app.api.first_model import FirstModel, first_model
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.readings.columns import GuessError
from pprs_dynamics.measurement.files.bag_files import write_bag
from pprs_dynamics.measurement.files.recording import Recording, read_recording
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
    (0, 10), (1556, 1), (5247, 1), pytest.param(10, 140, marks=pytest.mark.slow)])
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
    'feedback': {'x': ('tau_ff_{}', 1.0), 'q': ('fb_pos_{}', 1.0), 'tau': ('fb_eff_{}', 1.0)},
    'joined': {'x': ('jcmd{}', 1.0), 'q': ('jpos{}', 1.0), 'v': ('jvel{}', 1.0),
               'tau': ('jtrq{}', 1.0)},
    'compounds': {'q': ('Gelenkwinkel {}', 1.0), 'tau': ('Gelenkmoment {}', 1.0)},
    'compounds with roles': {'x': ('Lagesollwert {}', 1.0), 'q': ('Lageistwert {}', 1.0),
                             'v': ('Drehzahlistwert {}', 1.0), 'tau': ('Momentenistwert {}', 1.0)},
    'short words with roles': {'x': ('tausoll{}', 1.0), 'q': ('qist{}', 1.0),
                               'tau': ('tauist{}', 1.0)},
    'letters of axes': {'q': ('A{}', DEGREE), 'v': ('B{}', DEGREE), 'tau': ('M{}', 1.0)},
    'blanks and quotes': {'q': (' "q {}"', 1.0), 'tau': (' "tau {}"', 1.0)},
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


@pytest.mark.parametrize('moving', [(1.0, 1.0), (1.0, 0.0)])
def test_without_names_what_was_asked_for_is_not_what_was_measured(
    moving: tuple[float, float], tmp_path: Path,
) -> None:
    random = np.random.default_rng(2)
    q, v, a = (moving * values for values in motion(random, 2, 1.0)[1:])
    late = np.roll(np.arange(len(q)), 2)
    late[:2] = 0
    measured = q[late] + random.normal(0, 2e-5, q.shape)
    asked = arm_efforts(q, v, a)[late]
    effort = asked + random.normal(0, 0.1, q.shape)
    path = tmp_path / 'run.csv'
    rows = np.column_stack([q, measured, v, v[late], a, asked, effort])
    np.savetxt(path, rows, delimiter=',')
    (tmp_path / 'robot.urdf').write_text(ARM)
    first = first_model(tmp_path / 'robot.urdf', [path], tmp_path / 'robot.yaml', rate=100.0)
    found = read_recording(path, first.model.recorded)
    np.testing.assert_allclose(found.position, measured)
    np.testing.assert_allclose(found.effort, effort)


def test_a_log_may_have_columns_of_words(tmp_path: Path) -> None:
    time, q, _, effort = run_of_arm()
    heads = ['%time', 'field.name0', 'field.name1', *(
        f'field.{quantity}{k}' for quantity in ('position', 'effort') for k in range(2))]
    stamps = np.array([f'{1.7e18 + 1e9 * t:.0f}' for t in time])
    found = read_table(tmp_path, ','.join(heads), stamps, np.full(len(time), 'shoulder'),
                       np.full(len(time), 'elbow'), q, effort)
    np.testing.assert_allclose(found.position, q, atol=1e-6)
    np.testing.assert_allclose(found.effort, effort, atol=1e-6)


def test_times_that_are_repeated_are_no_positions(tmp_path: Path) -> None:
    time, q, _, effort = run_of_arm()
    with pytest.raises(GuessError, match='no names of columns say that they are positions'):
        asked_about(tmp_path, 'Time,Force V,Time,Input V', time, effort[:, 0], time, q[:, 0],
                    urdf=SLIDE)


def test_velocities_in_radians_beside_positions_in_degrees_show_the_unit(tmp_path: Path) -> None:
    time, q, v, _ = run_of_arm(2.0)
    effort = np.tanh(20 * v) + np.random.default_rng(1).normal(0, 0.03, q.shape)
    first = asked_about(tmp_path, '', time, np.degrees(q), v, effort)
    assert 'position_scale: 0.01745' in str((first.questions, first.columns))


@pytest.mark.parametrize(('speed', 'times', 'said'), [
    (1.0, 1e-3, 'time_scale: 1000'), (1.0, 1.25, 'time_scale: 0.8'), (51.0, 1.0, '')])
def test_velocities_have_a_unit_of_their_own_or_contradict_the_times(
    speed: float, times: float, said: str, tmp_path: Path,
) -> None:
    time, q, v, effort = run_of_arm()
    first = asked_about(tmp_path, 't,q1,q2,dq1,dq2,tau1,tau2', times * time, q, speed * v, effort)
    assert said in ''.join(first.questions)
    assert bool(said) or first.columns['elbow']['velocity_scale'] == pytest.approx(1 / speed, 1e-3)


def test_efforts_without_a_name_are_what_the_model_explains(tmp_path: Path) -> None:
    time, q, v, effort = run_of_arm()
    other = 30 + np.cumsum(np.random.default_rng(1).normal(0, 1e-3, q.shape), axis=0)
    found = read_table(tmp_path, 'T,th1,th2,x1,x2,w1,w2,M1,M2', time, q, other, v, effort)
    np.testing.assert_allclose(found.effort, effort, atol=1e-6)
    assert not asked_about(tmp_path, 't,q1,q2,x1,x2', time, q, other).has_efforts


@pytest.mark.parametrize('head', ['q1,q2,dq1,dq2,tau1,tau2', ''])
def test_velocities_in_another_unit_than_positions_show_no_rate(head: str, tmp_path: Path) -> None:
    _, q, v, effort = run_of_arm()
    for unit in (DEGREE, DEGREE / 6):
        with pytest.raises(PprsError, match='give --rate HZ'):
            asked_about(tmp_path, head, q, unit * v, effort)


def run_of_arm(size: float = 1.0, middle: float = 0.0) -> tuple[np.ndarray, ...]:
    """Return time, positions, velocities and efforts."""
    random = np.random.default_rng(5)
    time, q, v, a = motion(random, 2, size)
    q = q + middle
    return time, q, v, arm_efforts(q, v, a) + random.normal(0, 0.03, q.shape)


def test_of_two_topics_one_is_chosen_and_two_zeros_are_one_line(tmp_path: Path) -> None:
    time, q, v, a = motion(np.random.default_rng(3), 2, 1.0)
    effort = arm_efforts(q, v, a) + np.random.default_rng(4).normal(0, 0.03, q.shape)
    (tmp_path / 'robot.urdf').write_text(ARM)
    off, joints = np.array([np.pi / 2, -np.pi / 2]), ('shoulder', 'elbow')
    write_bag(tmp_path / 'run.mcap', {
        f'/{name}/joint_states': Samples(joints, time, position, None, effort)
        for name, position in (('first', q), ('second', q - off))})
    given = tmp_path / 'robot.urdf', [tmp_path / 'run.mcap'], tmp_path / 'robot.yaml'
    with pytest.raises(PprsError, match='choose one with --topic'):
        first_model(*given)
    assert not first_model(*given, topic='/first/joint_states').questions
    first = first_model(*given, topic='/second/joint_states')
    (line,) = re.findall('write (columns: .*)', ' '.join(first.questions))
    model = DriveModel.from_parameters(parse_parameters(f'{first.text}    {line}\n', 'robot.yaml'),
                                       source=str(tmp_path / 'robot.yaml'))
    found = read_recording(tmp_path / 'run.mcap', model.recorded, '/second/joint_states')
    np.testing.assert_allclose(found.position, q, atol=1e-6)


@pytest.mark.parametrize('head', ['time,q1,q2,tau1,tau2', 't,q1,q2,tau1,tau2'])
def test_stamps_may_be_coarser_than_samples(head: str, tmp_path: Path) -> None:
    time, q, v, a = motion(np.random.default_rng(5), 2, 1.0)
    stamps = time - np.arange(len(time)) % 2 * time[1]
    assert len(read_table(tmp_path, head, stamps, q, arm_efforts(q, v, a)).time) == len(time) // 2


def test_a_title_with_another_unit_than_the_numbers_is_a_question(tmp_path: Path) -> None:
    time, q, v, a = motion(np.random.default_rng(3), 2, 1.0)
    effort = arm_efforts(q, v, a)
    for title, is_asked in (('deg', True), ('rad', False)):
        first = asked_about(tmp_path, f't,q1 [{title}],q2 [{title}],tau1,tau2', time, q, effort)
        assert ('not in the unit of the title' in ''.join(first.questions)) == is_asked


def test_efforts_that_were_asked_for_may_be_the_measured_ones(tmp_path: Path) -> None:
    time, q, v, a = motion(np.random.default_rng(3), 2, 1.0)
    effort = arm_efforts(q, v, a)
    command = effort + np.array([0.9, 0.3]) * v
    assert len(asked_about(tmp_path, '', time, q, v, command, effort).questions) == 2
    named = asked_about(tmp_path, 't,q1,q2,dq1,dq2,tau_d1,tau_d2,tau_J1,tau_J2', time, q, v,
                        command, effort)
    assert [named.columns[joint]['effort'] for joint in ('shoulder', 'elbow')] == [
        'tau_J1', 'tau_J2']


def read_table(folder: Path, head: str, *columns: np.ndarray, separator: str = ',') -> Recording:
    """Write a table, and return it as a first model reads it, without a question."""
    first = asked_about(folder, head, *columns, separator=separator)
    assert not first.questions
    return read_recording(folder / 'run.csv', first.model.recorded)


def asked_about(folder: Path, head: str, *columns: np.ndarray, separator: str = ',',
                urdf: str = ARM) -> FirstModel:
    """Write a table, and return the first model for it."""
    cells = [column for group in columns for column in (group.T if group.ndim == 2 else [group])]
    lines = [separator.join(cell if isinstance(cell, str) else f'{cell:.10g}' for cell in row)
             for row in zip(*cells, strict=True)]
    (folder / 'run.csv').write_text('\n'.join([head] * bool(head) + lines))
    (folder / 'robot.urdf').write_text(urdf)
    return first_model(folder / 'robot.urdf', [folder / 'run.csv'], folder / 'robot.yaml')


@pytest.mark.parametrize('head', ['t,q1,q2,tau1,tau2', ''])
@pytest.mark.parametrize(('unit', 'lowest'), [
    (1.0, -np.pi), (1.0, 0.0), (np.pi / 180, 0.0), (np.pi / 180, -np.pi), (2 * np.pi, 0.0),
    (np.pi / 2048, 0.0)])
def test_angles_that_begin_again_each_turn_run_on(unit: float, lowest: float, head: str,
                                                  tmp_path: Path) -> None:
    time, q, v, effort = run_of_arm(2.2, lowest)
    recorded = ((q - lowest) % (2 * np.pi) + lowest) / unit
    assert np.abs(np.diff(recorded, axis=0)).max() * unit > 6
    counts = np.round(recorded) if unit == np.pi / 2048 else recorded
    found = read_table(tmp_path, head.replace('tau1', 'dq1,dq2,tau1'), time, counts, v / unit,
                       effort)
    turns = (found.position - q) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=2e-4)
    assert len(found.segments) == 1
    np.testing.assert_allclose(found.effort, effort, atol=1e-6)


@pytest.mark.parametrize('unit', [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize('head', ['t,q1,q2', 't,q1,q2,i1,i2', 't,q1,q2,dq1,dq2'])
def test_stamps_since_boot_are_in_the_unit_that_makes_a_motion(head: str, unit: float,
                                                               tmp_path: Path) -> None:
    time, q, v, effort = run_of_arm()
    more = [values for name, values in (('i1', effort), ('dq', v)) if name in head]
    first = asked_about(tmp_path, head, np.round((417.3 + time) / unit), q, *more)
    assert first.columns['time_scale'] == unit


@pytest.mark.parametrize('head', ['t,qa1,qa2,qb1,qb2,tau1,tau2', 't,x1,x2,y1,y2,tau1,tau2',
                                  't,q1,q2,q1,q2,tau1,tau2'])
def test_a_position_that_follows_the_one_by_name_is_a_question(head: str, tmp_path: Path) -> None:
    time, q, _, effort = run_of_arm()
    late, names = np.vstack([q[:1]] * 6 + [q[:-6]]), head.split(',')
    lines = asked_about(tmp_path, head, time, q, late, effort).questions
    assert [re.findall(r'position: (\w+)', line) for line in lines] == [
        names[3:5] if names[1] != names[3] else ['4', '5'],
        names[1:3] if names[1] != names[3] else ['2', '3']]


@pytest.mark.parametrize('head', ['sec,nanosec', 'field.header.stamp.secs,field.header.stamp.nsecs',
                                  'tv_sec,tv_usec', ''])
def test_seconds_and_their_fractions_may_be_columns_each(head: str, tmp_path: Path) -> None:
    time, q, v, effort = run_of_arm()
    whole, fraction = np.divmod(np.round((time + 0.37) * 1e6), 1e6)
    unit = 1 if 'usec' in head else 1000
    found = read_table(tmp_path, head and f'{head},q1,q2,dq1,dq2,tau1,tau2',
                       1_700_000_000 + whole, unit * fraction, q, v, effort)
    np.testing.assert_allclose(found.time - found.time[0], time, atol=1e-6)
    np.testing.assert_allclose(found.effort, effort, atol=1e-6)


@pytest.mark.parametrize(('form', 'title'), [
    *((form, 'Zeitstempel') for form in (
        '%d.%m.%Y %H:%M:%S.%f', '%d.%m.%y %H:%M:%S,%f', '%Y-%m-%dT%H:%M:%S.%fZ', '%H:%M:%S.%f',
        '%m/%d/%Y %I:%M:%S.%f %p', '%d.%m.%Y;%H:%M:%S.%f')),
    ('%d.%m.%Y;%H:%M:%S.%f', ''), ('%H:%M:%S.%f', '')])
def test_times_may_be_dates(form: str, title: str, tmp_path: Path) -> None:
    time, q, _, effort = run_of_arm()
    start = datetime(2026, 2, 13, 9, 59, 58)
    dates = np.array([(start + timedelta(seconds=s)).strftime(form) for s in time.tolist()])
    head = title and f'{"Datum;" * form.count(";")}{title};q1;q2;tau1;tau2'
    found = read_table(tmp_path, head, dates, q, effort, separator=';')
    np.testing.assert_allclose(found.time - found.time[0], time, atol=1e-6)
    np.testing.assert_allclose(found.effort, effort, atol=1e-6)


@pytest.mark.parametrize(('head', 'columns'), [
    ('', 'q0 q1 e0'), ('', 'q0 q1 v0 v1 e1'), ('', 'q0 q1 v0 v1 e0 t'), ('', 'q0 e0'),
    ('t,q1,q2,tau', 'q0 q1 e0'), ('t,q,tau', 'q0 e0')])
def test_one_effort_of_two_joints_is_a_question(head: str, columns: str, tmp_path: Path) -> None:
    time, q, v, effort = run_of_arm()
    known = {'q': q, 'v': v, 'e': effort, 't': 31 + 0.01 * time[:, None]}
    values = [known[name[0]][:, int(name[1:] or 0)] for name in columns.split()]
    try:
        lines = asked_about(tmp_path, head, time, *values).questions
    except GuessError as error:
        lines = (str(error),)
    assert 'position: 2, ' in ''.join(lines) or '{position: q' in ''.join(lines)


@pytest.mark.parametrize(('head', 'angle', 'unit'), [
    ('t,q1,q2,tau1 [%],tau2 [%]', 1.0, (0.6, 0.3)),
    ('t,q1 [deg],q2 [deg],tau1_permille,tau2_permille', np.pi / 180, (0.1, 0.1)),
    *(('', np.pi / 180, unit) for unit in ((0.6, 0.3), (2.5, 0.9), (0.6, 0.6))),
    # 6.88 A per N m are nearly what turns in place of radians do to the efforts.
    ('', 2 * np.pi, (6.88, 6.88)), ('t,q1,q2,tau1,tau2', 2 * np.pi, (9.0, 9.0)),
    *((f't,q1,q2,{effort}1,{effort}2', 1.0, (0.6, 0.3)) for effort in ('tau', 'i', 'out')),
    ('t,q1,q2,tau1,tau2', 1.0, (0.6, 0.6))])
def test_amperes_and_shares_of_an_unknown_effort_are_a_question(
    head: str, angle: float, unit: tuple[float, float], tmp_path: Path,
) -> None:
    time, q, _, effort = run_of_arm()
    first = asked_about(tmp_path, head, time, q / angle, effort / unit)
    assert any(word in ''.join(first.questions) for word in ('effort_scale', 'gain: [0.6, 0.3]'))
    # Of an unknown force no unit of positions follows.
    assert not set('%_') & {*head} or 'position_scale' not in ''.join(first.questions)


@pytest.mark.parametrize(('mass', 'centre'), [(1.5, 0.375), (3.75, 0.24)])
def test_amperes_are_a_question_with_other_masses(mass: float, centre: float,
                                                  tmp_path: Path) -> None:
    time, q, _, effort = run_of_arm()
    urdf = ARM.replace('"3.0"', '"4.8"').replace('"1.5"', f'"{mass}"').replace(
        '0 0 0.15', f'0 0 {centre}')
    first = asked_about(tmp_path, 't,q1,q2,tau1,tau2', time, q, effort / (12.0, 30.0), urdf=urdf)
    assert 'gain' in ''.join(first.questions)


@pytest.mark.parametrize(('size', 'slow'), [(0.1, 0.05), (2.0, 0.0)])
def test_a_torque_that_holds_no_model_is_a_question_and_no_other_unit(
    size: float, slow: float, tmp_path: Path,
) -> None:
    time, q, _, _ = run_of_arm()
    noise = np.random.default_rng(1).normal(0, size, q.shape)
    first = asked_about(tmp_path, 't,q1,q2,tau1,tau2', time, q,
                        noise + slow * np.cumsum(noise, axis=0))
    assert 'effort_kind: external' in ''.join(first.questions)
    assert 'position_scale' not in first.text


def test_a_velocity_by_its_name_alone_is_not_used(tmp_path: Path) -> None:
    time, q, _, effort = run_of_arm()
    noise = np.random.default_rng(1).normal(0, 1.0, q.shape)
    first = asked_about(tmp_path, 't,q1,q2,dq1,dq2,tau1,tau2', time, q, noise, effort)
    assert any('is not the derivative of q1' in note for note in first.notes)
    assert 'velocity' not in first.text.partition('columns:')[2].replace('called a velocity', '')


@pytest.mark.parametrize('head', ['t,q1,q2,tau_ref1,tau_ref2', 't,q_cmd1,q_cmd2,tau1,tau2'])
def test_commands_alone_are_a_question(head: str, tmp_path: Path) -> None:
    time, q, _, effort = run_of_arm()
    assert 'commands by their names' in ''.join(asked_about(
        tmp_path, head, time, q, effort).questions)


@pytest.mark.parametrize('width', [1e-4, 0.05])
@pytest.mark.parametrize(('stroke', 'position', 'effort'), [
    (0.5, 1e3, 1.0), (0.5, 1.0, 1e-3), (0.5, 1e3, 1e-3), (1e3, 1e3, 1.0), (1e3, 1.0, 1.0)])
def test_units_of_a_slide_without_weight_are_right_or_a_question(
    width: float, stroke: float, position: float, effort: float, tmp_path: Path,
) -> None:
    """Inertia alone gives millimetres and newtons the same likelihood as metres and kN."""
    random = np.random.default_rng(3)
    time, q, v, a = motion(random, 1, 0.15)
    force = 8 * a + 15 * v + 6 * np.tanh(v / width) + random.normal(0, 0.03, q.shape)
    lying = SLIDE.replace('axis xyz="0 0 1"', 'axis xyz="1 0 0"').replace(
        'lower="-0.5" upper="0.5"', f'lower="{-stroke}" upper="{stroke}"')
    first = asked_about(tmp_path, 'time,q,tau', time, position * q, effort * force, urdf=lying)
    found = read_recording(tmp_path / 'run.csv', first.model.recorded)
    is_right = np.allclose(found.position, q, atol=1e-6) and np.allclose(
        found.effort, force, atol=1e-3)
    assert is_right or ' or ' in ''.join(first.questions)
