# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings by the machine's own names: mapped joints, columns, several messages, controllers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_recordings import CONTROLLER, STORE, header, message, write_plain_bag

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import ModelError, UnreadableFileError
from pprs_dynamics.measurement.files.recording import read_recording
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
    assert 'merged' in kinds
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
