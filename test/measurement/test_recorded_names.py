# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings by the machine's own names: mapped joints, columns, several messages, controllers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import ModelError, UnreadableFileError
from pprs_dynamics.measurement.files.merged_states import CONTROLLER, JOINT_STATE
from pprs_dynamics.measurement.files.recording import read_recording
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.recorded_names import joint_names, recorded_columns

RATE, EPOCH = 100, 1_700_000_000
POINT = """float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
"""
BREAK = '=' * 80 + '\n'
# The interface definitions as a bag carries them.
DEFINITIONS = {
    CONTROLLER: f"""std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint feedback
trajectory_msgs/JointTrajectoryPoint error
trajectory_msgs/JointTrajectoryPoint output
{BREAK}MSG: trajectory_msgs/JointTrajectoryPoint
{POINT}"""}


@pytest.fixture(scope='module')
def run() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, positions and efforts."""
    motion = Excitation(4.0, seed=2).motion(np.arange(0, 4.0, 1 / RATE))
    forces = DriveModel.load().drive_forces(motion)
    return np.arange(len(motion)) / RATE, forces.mechanism.position, forces.total


def with_keys(**keys: Any) -> DriveModel:
    """Return the paper's robot with keys in its file."""
    return DriveModel.from_parameters({**DriveModel.load().values, **keys})


class Bag:
    """A bag, written message by message."""

    def __init__(self, path: Path) -> None:
        self.path, self.store = path, get_typestore(Stores.ROS2_KILTED)
        for name, text in DEFINITIONS.items():
            self.store.register({key: fields for key, fields in get_types_from_msg(
                text, name).items() if key not in self.store.types})
        self.writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        self.writer.open()
        self.topics: dict[str, Any] = {}

    def type(self, name: str) -> Any:
        return self.store.types[name]

    def header(self, time: float) -> Any:
        stamp = round(time * 1e9)
        return self.type('std_msgs/msg/Header')(
            self.type('builtin_interfaces/msg/Time')(EPOCH + stamp // 10**9, stamp % 10**9), '')

    def write(self, topic: str, kind: str, time: float, message: Any) -> None:
        if topic not in self.topics:
            self.topics[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        self.writer.write(self.topics[topic], EPOCH * 10**9 + round(time * 1e9),
                          self.store.serialize_cdr(message, kind))

    def state(self, topic: str, time: float, names: tuple[str, ...], position: Any = (),
              effort: Any = ()) -> None:
        numbers = (np.array(values, dtype=float) for values in (position, (), effort))
        self.write(topic, JOINT_STATE, time, self.type(JOINT_STATE)(
            self.header(time), list(names), *numbers))

    def point(self, position: Any = (), effort: Any = ()) -> Any:
        numbers = (np.array(values, dtype=float) for values in (position, (), (), effort))
        return self.type('trajectory_msgs/msg/JointTrajectoryPoint')(
            *numbers, self.type('builtin_interfaces/msg/Duration')(0, 0))


def spread(bag: Bag, time: float, q: np.ndarray, tau: np.ndarray) -> None:
    for part in (slice(0, 3), slice(3, 6)):
        bag.state('/joint_states', time, DRIVES[part], q[part], tau[part])


def controller(bag: Bag, time: float, q: np.ndarray, tau: np.ndarray) -> None:
    bag.write('/arm_controller/controller_state', CONTROLLER, time, bag.type(CONTROLLER)(
        bag.header(time), list(DRIVES), bag.point(), bag.point(q), bag.point(),
        bag.point((), tau)))


@pytest.mark.parametrize('write', [spread, controller])
def test_states_of_other_messages_are_read(
    run: Any, tmp_path: Path, write: Callable[..., None],
) -> None:
    time, position, effort = run
    bag = Bag(tmp_path / 'bag')
    for k, moment in enumerate(time):
        write(bag, float(moment), position[k], effort[k])
    bag.writer.close()
    recording = read_recording(bag.path, DriveModel.load().recorded)
    np.testing.assert_allclose(recording.position, position, atol=1e-12)
    np.testing.assert_allclose(recording.effort, effort, atol=1e-12)
    np.testing.assert_allclose(recording.time - recording.time[0], time, atol=1e-9)
    kinds = {finding.kind for finding in recording.findings}
    assert 'merged' in kinds
    assert ('commanded_efforts' in kinds) is (write is controller)


def test_a_slower_message_lies_between_its_neighbours(run: Any, tmp_path: Path) -> None:
    time, position, effort = run
    bag = Bag(tmp_path / 'bag')
    for k, moment in enumerate(time):
        bag.state('/joint_states', float(moment), DRIVES[:3], position[k, :3], effort[k, :3])
        if k % 2 == 0:
            bag.state('/joint_states', float(moment), DRIVES[3:], position[k, 3:], effort[k, 3:])
    bag.writer.close()
    recording = read_recording(bag.path, DriveModel.load().recorded)
    between = (position[:-2:2, 3:] + position[2::2, 3:]) / 2
    np.testing.assert_allclose(recording.position[1:len(between) * 2:2, 3:], between, atol=1e-9)


def test_joints_have_the_names_of_the_machine(run: Any, tmp_path: Path) -> None:
    time, position, effort = run
    model = with_keys(joint_prefix='left_', **{'joint_map.slide_1': 'x_axis'})
    names = joint_names(model.values, DRIVES)
    assert names == ('x_axis', 'left_slide_2', 'left_slide_3', 'left_lift_1', 'left_lift_2',
                     'left_lift_3')
    bag = Bag(tmp_path / 'bag')
    for k, moment in enumerate(time):
        bag.state('/joint_states', float(moment), names, position[k], effort[k])
    bag.writer.close()
    recording = read_recording(bag.path, model.recorded)
    assert recording.drives == DRIVES
    np.testing.assert_array_equal(recording.effort, effort)
    with pytest.raises(UnreadableFileError, match='slide_1'):
        read_recording(bag.path, DriveModel.load().recorded)


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
