# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings by the machine's own names: mapped joints, columns, several messages, controllers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_recordings import CONTROLLER, STORE, header, message, states_of, write_plain_bag

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES, RecordedDrives
from pprs_dynamics.errors import ModelError, UnreadableFileError
from pprs_dynamics.inference.readings.columns import guess_columns
from pprs_dynamics.measurement.files.contents import Series
from pprs_dynamics.measurement.files.recording import (
    Recording,
    describe,
    read_recording,
    write_recording,
)
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.recorded_names import joint_names, recorded_columns

RATE, EPOCH = 100, 1_700_000_000


@pytest.fixture(scope='module')
def run() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, positions and efforts."""
    motion = Excitation(4.0, seed=2).motion(np.arange(0, 4.0, 1 / RATE))
    forces = DriveModel.load().drive_forces(motion)
    return np.arange(len(motion)) / RATE, forces.mechanism.position, forces.total


def with_keys(**keys: Any) -> DriveModel:
    """Return the paper's robot with keys in its file."""
    return DriveModel.from_parameters({**DriveModel.load().values, **keys})


def point(position: Any = (), effort: Any = ()) -> Any:
    numbers = (np.array(values, dtype=float) for values in (position, (), (), effort))
    return STORE.types['trajectory_msgs/msg/JointTrajectoryPoint'](
        *numbers, STORE.types['builtin_interfaces/msg/Duration'](0, 0))


def spread(stamp: int, q: np.ndarray, tau: np.ndarray) -> dict[str, list[Any]]:
    return {'/joint_states': [message(stamp, DRIVES[part], q[part], (), tau[part])
                              for part in (slice(0, 3), slice(3, 6))]}


def controller(stamp: int, q: np.ndarray, tau: np.ndarray) -> dict[str, list[Any]]:
    return {'/arm_controller/controller_state': [STORE.types[CONTROLLER](
        header(stamp), list(DRIVES), point(), point(q), point(), point((), tau))]}


def written(path: Path, run: Any, write: Callable[..., dict[str, list[Any]]]) -> Path:
    """Write a bag of what a function returns for the stamp and values of each sample."""
    topics: dict[str, list[Any]] = {}
    for time, q, tau in zip(*run, strict=True):
        for topic, messages in write(EPOCH * 10**9 + round(time * 1e9), q, tau).items():
            topics.setdefault(topic, []).extend(messages)
    return write_plain_bag(path, topics)


@pytest.mark.parametrize('write', [spread, controller])
def test_states_of_other_messages_are_read(
    run: Any, tmp_path: Path, write: Callable[..., dict[str, list[Any]]],
) -> None:
    time, position, effort = run
    recording = read_recording(written(tmp_path / 'bag', run, write), DriveModel.load().recorded)
    np.testing.assert_allclose(recording.position, position, atol=1e-12)
    np.testing.assert_allclose(recording.effort, effort, atol=1e-12)
    np.testing.assert_allclose(recording.time - recording.time[0], time, atol=1e-9)
    kinds = {finding.kind for finding in recording.findings}
    assert ('merged' in kinds) is (write is spread)
    assert ('commanded_efforts' in kinds) is (write is controller)


def test_a_slower_message_lies_between_its_neighbours(run: Any, tmp_path: Path) -> None:
    _, position, _ = run
    later = iter(range(len(position)))

    def seldom(*sample: Any) -> dict[str, list[Any]]:
        both = spread(*sample)['/joint_states']
        return {'/joint_states': both if next(later) % 2 == 0 else both[:1]}

    recording = read_recording(written(tmp_path / 'bag', run, seldom), DriveModel.load().recorded)
    between = (position[:-2:2, 3:] + position[2::2, 3:]) / 2
    np.testing.assert_allclose(recording.position[1:len(between) * 2:2, 3:], between, atol=1e-9)


def test_joints_have_the_names_of_the_machine(run: Any, tmp_path: Path) -> None:
    model = with_keys(joint_prefix='left_', **{'joint_map.slide_1': 'x_axis'})
    names = joint_names(model.values, DRIVES)
    assert names == ('x_axis', 'left_slide_2', 'left_slide_3', 'left_lift_1', 'left_lift_2',
                     'left_lift_3')
    bag = written(tmp_path / 'bag', run, lambda stamp, q, tau: {
        '/joint_states': [message(stamp, names, q, (), tau)]})
    recording = read_recording(bag, model.recorded)
    assert recording.drives == DRIVES
    np.testing.assert_array_equal(recording.effort, run[2])
    with pytest.raises(UnreadableFileError, match='slide_1'):
        read_recording(bag, DriveModel.load().recorded)


COLUMNS = {'columns.time': 't', **{
    f'columns.{drive}.{quantity}': f'{short}{k}' for k, drive in enumerate(DRIVES)
    for quantity, short in (('position', 'q'), ('effort', 'tau'))}}


@pytest.mark.parametrize('keys', [
    {'joint_map.slide_9': 'x'}, {'joint_map.slide_1': ''}, {'joint_prefix': 3},
    {'joint_map.slide_1': 'lift_1'}, {'columns.slide_1.position': 0},
    {'columns.time': True}, {'columns.rate': -100.0}, {'columns.decimal': ';'},
    {'columns.files.effort': 'tau.csv'}, {'columns.files.torque': 'tau.csv'},
    {**COLUMNS, 'columns.slide_1.colour': 'c'}, {**COLUMNS, 'columns.slide_1.effort_scale': 0.0}])
def test_names_that_are_none_are_refused(keys: dict[str, Any]) -> None:
    values = {**DriveModel.load().values, **keys}
    read = joint_names if any(key.startswith('joint') for key in keys) else recorded_columns
    with pytest.raises(ModelError):
        read(values, DRIVES)


# What is measured of drives beside motion and effort, from files of several kinds.

JOINTS = ('j1', 'j2')
TIME = np.arange(200) * 0.01
POSITION = np.sin(TIME[:, None] * [1.0, 1.7])
EFFORT = 2 * np.cos(TIME[:, None] * [1.0, 1.7])
WARM = 30 + TIME  # what j2's thermometer says, every tenth sample
SELDOM = np.where(np.arange(200) % 10 == 0, WARM, np.nan)


def table(path: Path, **more: np.ndarray) -> Path:
    """Write a table of our format with further columns."""
    columns = {'time': TIME, **{f'{joint}/{name}': values[:, k] for name, values in (
        ('position', POSITION), ('effort', EFFORT)) for k, joint in enumerate(JOINTS)}, **more}
    rows = zip(*columns.values(), strict=True)
    path.write_text(','.join(columns) + '\n' + ''.join(
        ','.join('' if np.isnan(x) else repr(float(x)) for x in row) + '\n' for row in rows))
    return path


def read(path: Path, **keys: Any) -> Recording:
    columns = recorded_columns({f'columns.{key.replace("__", ".")}': value
                                for key, value in keys.items()}, JOINTS)
    return read_recording(path, RecordedDrives(JOINTS, columns=columns))


def test_a_column_of_a_drive_is_its_channel_and_gaps_stay_gaps(tmp_path):
    recording = read(table(tmp_path / 'a.csv', **{'j2/temperature': SELDOM}))
    found = recording.channels['temperature']
    np.testing.assert_array_equal(found[:, 1], SELDOM)
    assert np.isnan(found[:, 0]).all()
    assert set(recording.channels) == {'temperature'}
    assert describe(recording).drives['j2'].channels == {
        'temperature': (WARM[0], pytest.approx(WARM[190]))}
    assert describe(recording).drives['j1'].channels == {}
    assert not [finding for finding in recording.findings if finding.kind == 'ignored_columns']


def test_columns_of_a_model_file_and_of_the_whole_machine(tmp_path):
    file = table(tmp_path / 'a.csv', T2=WARM, oil=WARM + 5, hall=np.full(200, 1e5))
    found = read(file, temperature='oil', j2__temperature='T2', pressure='hall').channels
    np.testing.assert_allclose(found['temperature'], np.column_stack([WARM + 5, WARM]))
    np.testing.assert_allclose(found['pressure'], 1e5)


@pytest.mark.parametrize('name', ['run.csv', 'run.mcap', 'bag'])
def test_what_is_written_is_read_again(tmp_path, name):
    channels = {'temperature': np.column_stack([np.full(200, np.nan), SELDOM]),
                'link_position': np.column_stack([POSITION[:, 0] + 0.01, np.full(200, np.nan)])}
    written = Recording.from_arrays('x', TIME, POSITION, None, EFFORT, JOINTS, channels)
    write_recording(tmp_path / name, written)
    found = read(tmp_path / name).channels
    for channel, values in channels.items():
        np.testing.assert_allclose(found[channel], values)


def test_dropped_samples_take_their_temperature_with_them():
    broken = POSITION.copy()
    broken[3] = np.nan
    recording = Recording.from_arrays('x', TIME, broken, None, EFFORT, JOINTS,
                                      {'temperature': np.column_stack([WARM, WARM])})
    np.testing.assert_array_equal(recording.channels['temperature'][:, 0], np.delete(WARM, 3))


def bag(path: Path, topic: str, messages: list[Any]) -> Path:
    """Write joint states, and messages on another topic."""
    return write_plain_bag(path / 'bag', {'/joint_states': states_of(
        {'time': TIME, 'position': POSITION, 'velocity': None, 'effort': EFFORT}, JOINTS),
        topic: messages})


@pytest.mark.parametrize(('topic', 'frame', 'drives'), [
    ('/drives/j2/temperature', '', (1,)), ('/motor_temperature', 'j2', (1,)),
    ('/j2_temperature', '', (1,)), ('/gearbox/temperature', 'base', (0, 1))])
def test_a_thermometer_belongs_to_the_drive_that_it_names(tmp_path, topic, frame, drives):
    found = read(bag(tmp_path, topic, [STORE.types['sensor_msgs/msg/Temperature'](
        header(round(t * 1e9), frame), 40 + t, 0.0) for t in (0.0, 0.5, 1.0)]))
    temperature = found.channels['temperature']
    for d in (0, 1):
        known = np.flatnonzero(np.isfinite(temperature[:, d]))
        assert list(found.time[known] - found.time[0]) == (
            pytest.approx([0.0, 0.5, 1.0]) if d in drives else [])
        np.testing.assert_allclose(temperature[known, d], [40, 40.5, 41][:len(known)])


def test_joint_states_on_a_topic_of_temperatures(tmp_path):
    found = read(bag(tmp_path, '/joint_temperatures', [
        message(round(t * 1e9), ['j2', 'j1'], [50 + t, 20.0]) for t in (0.2, 0.4)]))
    np.testing.assert_allclose(found.channels['temperature'][[20, 40]], [[20, 50.2], [20, 50.4]])
    np.testing.assert_allclose(found.effort, EFFORT)


def test_temperatures_are_guessed_by_their_names():
    rng = np.random.default_rng(0)
    names = [f'{kind}_{k}' for kind in ('q', 'tau', 'joint_temperature', 'target_temp')
             for k in (0, 1)]
    series = [Series('t', 't', np.arange(50) * 0.01),
              *(Series(name, name, rng.normal(size=50)) for name in names)]
    columns = guess_columns(series, JOINTS).columns
    assert columns['j1', 'temperature'] == 'joint_temperature_0'
    assert columns['j2', 'temperature'] == 'joint_temperature_1'
    assert columns['j2', 'effort'] == 'tau_1'
