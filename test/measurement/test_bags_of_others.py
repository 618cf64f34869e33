# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Bags of ROS 1, packed and split bags, and messages that are no joint states."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pprs_dynamics.drives import RecordedDrives
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.csv_files import zstd
from pprs_dynamics.measurement.files.recording import Recording, read_recording
from pprs_dynamics.physics.model.recorded_names import recorded_columns

JOINTS = ('a', 'b')
N = 200
EPOCH = 1_700_000_000
TIME = np.arange(N) * 0.01
POSITION = np.sin(TIME[:, None] * [1.0, 1.3])
EFFORT = 2.0 * np.cos(TIME[:, None] * [1.0, 1.3])
STATE, ARRAY = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'
DYNAMIC = 'control_msgs/msg/DynamicJointState'
DYNAMIC_TEXT = '''std_msgs/Header header
string[] joint_names
control_msgs/InterfaceValue[] interface_values
================================================================================
MSG: control_msgs/InterfaceValue
string[] interface_names
float64[] values
'''


def stamp(k: int) -> int:
    return EPOCH * 10**9 + round(TIME[k] * 1e9)


def read(path: Path, keys: dict[str, Any] | None = None) -> Recording:
    columns = recorded_columns({f'columns.{key}': value for key, value in (keys or {}).items()},
                               JOINTS)
    return read_recording(path, RecordedDrives(JOINTS, columns=columns, gain=(2.0, 2.0)))


def assert_read(recording: Recording, scale: float = 1.0) -> None:
    np.testing.assert_allclose(recording.time - recording.time[0], TIME, atol=1e-9)
    np.testing.assert_array_equal(recording.position, POSITION)
    np.testing.assert_allclose(recording.effort, scale * EFFORT, rtol=1e-12)


def store(kind: Stores = Stores.ROS2_KILTED) -> Any:
    types = get_typestore(kind)
    found = get_types_from_msg(DYNAMIC_TEXT, DYNAMIC)
    types.register({name: fields for name, fields in found.items() if name not in types.types})
    return types


def header(types: Any, k: int, *first: int) -> Any:
    time = types.types['builtin_interfaces/msg/Time'](*divmod(stamp(k), 10**9))
    return types.types['std_msgs/msg/Header'](*first, time, '')


def state(types: Any, k: int, *first: int) -> Any:
    return types.types[STATE](header(types, k, *first), list(JOINTS), POSITION[k], np.zeros(0),
                              EFFORT[k])


def array(types: Any, values: np.ndarray) -> Any:
    layout = types.types['std_msgs/msg/MultiArrayLayout']([], 0)
    return types.types[ARRAY](layout, values)


def ros1(path: Path, part: slice = slice(None), dynamic: bool = False) -> Path:
    types = store(Stores.ROS1_NOETIC)
    with Writer1(path) as writer:
        kind = DYNAMIC if dynamic else STATE
        connection = writer.add_connection('/joint_states', kind, typestore=types)
        for k in range(N)[part]:
            message = currents(types, k, 'effort', k) if dynamic else state(types, k, k)
            writer.write(connection, stamp(k), types.serialize_ros1(message, kind))
    return path


def ros2(path: Path, messages: Callable[[Any, int], dict[str, tuple[str, Any]]],
         pack: Callable[[Writer], None] = lambda writer: None, part: slice = slice(None)) -> Path:
    types = store()
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    pack(writer)
    with writer:
        connections: dict[str, Any] = {}
        for k in range(N)[part]:
            for topic, (kind, message) in messages(types, k).items():
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=types)
                writer.write(connections[topic], stamp(k), types.serialize_cdr(message, kind))
    return path


def states(types: Any, k: int) -> dict[str, tuple[str, Any]]:
    return {'/joint_states': (STATE, state(types, k))}


def currents(types: Any, k: int, interface: str, *first: int) -> Any:
    value = types.types['control_msgs/msg/InterfaceValue']
    return types.types[DYNAMIC](header(types, k, *first), list(JOINTS), [
        value([interface, 'position'], np.array([EFFORT[k, j], POSITION[k, j]]))
        for j in range(2)])


def test_a_bag_of_ros_1_is_read(tmp_path: Path) -> None:
    assert_read(read(ros1(tmp_path / 'run.bag')))


def test_messages_that_a_bag_of_ros_1_defines_itself_are_read(tmp_path: Path) -> None:
    assert_read(read(ros1(tmp_path / 'run.bag', dynamic=True)))


def test_a_folder_of_split_bags_is_one_recording(tmp_path: Path) -> None:
    (tmp_path / 'one').mkdir()
    ros1(tmp_path / 'one' / 'run_0.bag', slice(0, 80))
    ros1(tmp_path / 'one' / 'run_1.bag', slice(80, N))
    assert_read(read(tmp_path / 'one'))


@pytest.mark.parametrize('mode', [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_a_packed_bag_is_read(mode: CompressionMode, tmp_path: Path) -> None:
    assert_read(read(ros2(tmp_path / 'bag', states, lambda writer: writer.set_compression(
        mode, CompressionFormat.ZSTD))))


def test_a_packed_storage_file_alone_is_read(tmp_path: Path) -> None:
    whole = next(ros2(tmp_path / 'bag', states).glob('*.mcap'))
    packed = tmp_path / 'run.mcap.zstd'
    packed.write_bytes(zstd().compress(whole.read_bytes()))
    assert_read(read(packed))
    packed.write_bytes(packed.read_bytes()[:-200])
    with pytest.raises(UnreadableFileError, match='cannot be unpacked'):
        read(packed)


@pytest.mark.parametrize(('interface', 'scale'), [('current', 2.0), ('torque', 1.0)])
def test_currents_of_hardware_interfaces_become_efforts(
    interface: str, scale: float, tmp_path: Path,
) -> None:
    path = ros2(tmp_path / 'bag', lambda types, k: {
        '/dynamic_joint_states': (DYNAMIC, currents(types, k, interface))})
    assert_read(read(path), scale)


def test_fields_of_any_message_are_columns(tmp_path: Path) -> None:
    path = ros2(tmp_path / 'bag', lambda types, k: {
        '/positions': (ARRAY, array(types, POSITION[k])),
        '/torques': (ARRAY, array(types, np.array([7.0, *EFFORT[k]])))})
    keys = {f'{joint}.{quantity}': name for j, joint in enumerate(JOINTS) for quantity, name in (
        ('position', f'/positions[{j}]'), ('effort', f'/torques.data[{j + 1}]'))}
    assert_read(read(path, keys))
    with pytest.raises(UnreadableFileError, match=r'no topic of the column /torque\[0\].*/torques'):
        read(path, {**keys, 'a.effort': '/torque[0]'})
    with pytest.raises(UnreadableFileError, match=r'columns: \{DRIVE: \{position: "/positions'):
        read(path)


def test_efforts_of_another_message_join_the_joint_states(tmp_path: Path) -> None:
    def both(types: Any, k: int) -> dict[str, tuple[str, Any]]:
        empty = types.types[STATE](header(types, k), list(JOINTS), POSITION[k], np.zeros(0),
                                   np.zeros(0))
        return {'/joint_states': (STATE, empty), '/torques': (ARRAY, array(types, EFFORT[k]))}

    path = ros2(tmp_path / 'bag', both)
    recording = read(path, {f'{joint}.effort': f'/torques[{j}]' for j, joint in enumerate(JOINTS)})
    assert_read(recording)


@pytest.mark.parametrize('seed', range(3))
def test_positions_are_those_of_the_chosen_topic_whatever_else_is_in_the_bag(
    seed: int, tmp_path: Path,
) -> None:
    random = np.random.default_rng(seed)
    late, offset = int(random.integers(0, 5_000_000)), float(random.choice([0.0, 0.5]))
    has_velocity, has_effort = random.random(2) < 0.5
    name = str(random.choice(['/joint_commands', '/a_first', '/robot/torque_states']))

    def two(types: Any, k: int) -> dict[str, tuple[str, Any]]:
        measured = state(types, k)
        measured.effort = np.zeros(0) if has_effort else EFFORT[k]
        time = types.types['builtin_interfaces/msg/Time'](*divmod(stamp(k) + late, 10**9))
        other = types.types[STATE](
            types.types['std_msgs/msg/Header'](time, ''), list(JOINTS),
            offset * POSITION[k] + offset, np.ones(2) if has_velocity else np.zeros(0), EFFORT[k])
        return {name: (STATE, other), '/joint_states': (STATE, measured)}

    recording = read(ros2(tmp_path / 'bag', two))
    stamps = np.rint(recording.time * 1e9).astype(int) + (recording.epoch - EPOCH) * 10**9
    at = np.searchsorted(np.rint(TIME * 1e9).astype(int), stamps)
    assert len(recording.time) >= N - 2
    np.testing.assert_array_equal(recording.position, POSITION[at])
    known = np.isfinite(recording.effort).all(axis=1)
    assert known.sum() >= N - 2
    np.testing.assert_allclose(recording.effort[known], EFFORT[at][known], atol=0.02)


def test_efforts_on_two_other_topics_are_a_question(tmp_path: Path) -> None:
    def three(types: Any, k: int) -> dict[str, tuple[str, Any]]:
        measured = state(types, k)
        measured.effort = np.zeros(0)
        return {'/joint_states': (STATE, measured), '/asked': (STATE, state(types, k)),
                '/felt': (STATE, state(types, k))}

    with pytest.raises(UnreadableFileError, match='/asked, /felt each have the effort of a'):
        read(ros2(tmp_path / 'bag', three))
