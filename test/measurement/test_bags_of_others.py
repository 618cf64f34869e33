# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Bags of ROS 1, packed and split bags, and messages that are no joint states."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_recordings import DYNAMIC, STATE, STORE, message, with_definitions, write_plain_bag
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Writer
from rosbags.typesys import Stores, get_typestore

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
ARRAY = 'std_msgs/msg/Float64MultiArray'


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


def header(k: int, types: Any = STORE, *first: int) -> Any:
    time = types.types['builtin_interfaces/msg/Time'](*divmod(stamp(k), 10**9))
    return types.types['std_msgs/msg/Header'](*first, time, '')


def state(k: int, types: Any = STORE, *first: int) -> Any:
    return types.types[STATE](header(k, types, *first), list(JOINTS), POSITION[k], np.zeros(0),
                              EFFORT[k])


def currents(k: int, interface: str, types: Any = STORE, *first: int) -> Any:
    value = types.types['control_msgs/msg/InterfaceValue']
    return types.types[DYNAMIC](header(k, types, *first), list(JOINTS), [
        value([interface, 'position'], np.array([EFFORT[k, j], POSITION[k, j]]))
        for j in range(2)])


def array(values: np.ndarray) -> Any:
    layout = STORE.types['std_msgs/msg/MultiArrayLayout']([], 0)
    return STORE.types[ARRAY](layout, values)


def ros1(path: Path, part: slice = slice(None), dynamic: bool = False) -> Path:
    types = with_definitions(get_typestore(Stores.ROS1_NOETIC))
    with Writer1(path) as writer:
        kind = DYNAMIC if dynamic else STATE
        connection = writer.add_connection('/joint_states', kind, typestore=types)
        for k in range(N)[part]:
            message = currents(k, 'effort', types, k) if dynamic else state(k, types, k)
            writer.write(connection, stamp(k), types.serialize_ros1(message, kind))
    return path


def ros2(path: Path, messages: Callable[[int], dict[str, Any]],
         pack: Callable[[Writer], None] = lambda writer: None) -> Path:
    """Write a bag of what a function returns for each sample, by topic."""
    every = [messages(k) for k in range(N)]
    return write_plain_bag(path, {topic: [s[topic] for s in every] for topic in every[0]},
                           received=stamp, pack=pack)


def states(k: int) -> dict[str, Any]:
    return {'/joint_states': state(k)}


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
def test_a_packed_bag_is_read_also_without_its_metadata(
    mode: CompressionMode, tmp_path: Path,
) -> None:
    path = ros2(tmp_path / 'bag', states, lambda writer: writer.set_compression(
        mode, CompressionFormat.ZSTD))
    assert_read(read(path))
    (path / 'metadata.yaml').unlink()
    assert_read(read(path))


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
    path = ros2(tmp_path / 'bag', lambda k: {'/dynamic_joint_states': currents(k, interface)})
    assert_read(read(path), scale)


def test_fields_of_any_message_are_columns(tmp_path: Path) -> None:
    path = ros2(tmp_path / 'bag', lambda k: {
        '/positions': array(POSITION[k]), '/torques': array(np.array([7.0, *EFFORT[k]]))})
    keys = {f'{joint}.{quantity}': name for j, joint in enumerate(JOINTS) for quantity, name in (
        ('position', f'/positions[{j}]'), ('effort', f'/torques.data[{j + 1}]'))}
    assert_read(read(path, keys))
    with pytest.raises(UnreadableFileError, match=r'no topic of the column /torque\[0\].*/torques'):
        read(path, {**keys, 'a.effort': '/torque[0]'})
    with pytest.raises(UnreadableFileError, match=r'columns: \{DRIVE: \{position: "/positions'):
        read(path)


def test_efforts_of_another_message_join_the_joint_states(tmp_path: Path) -> None:
    def both(k: int) -> dict[str, Any]:
        return {'/joint_states': message(stamp(k), JOINTS, POSITION[k]),
                '/torques': array(EFFORT[k])}

    path = ros2(tmp_path / 'bag', both)
    recording = read(path, {f'{joint}.effort': f'/torques[{j}]' for j, joint in enumerate(JOINTS)})
    assert_read(recording)


LATE = 3_000_000  # [ns] by which another topic comes after /joint_states


def beside(name: str, position: tuple[float, ...] | None, has_efforts: bool, folder: Path,
           ) -> Recording:
    """Read a bag with efforts on another topic, where angles are half the true ones, or 0."""
    def two(k: int) -> dict[str, Any]:
        other = message(stamp(k) + LATE, JOINTS, () if position is None else (
            position + 0.5 * POSITION[k]), (), EFFORT[k])
        return {name: other, '/joint_states': message(
            stamp(k), JOINTS, POSITION[k], (), EFFORT[k] if has_efforts else ())}

    return read(ros2(folder / 'bag', two))


@pytest.mark.parametrize(('name', 'position', 'has_efforts'), [
    ('/a_first', None, False), ('/joint_commands', (0.5, 0.5), False), ('/a_first', (0.5, 0), True),
])
def test_positions_are_those_of_joint_states_where_no_other_topic_has_all_that_is_needed(
    name: str, position: tuple[float, ...] | None, has_efforts: bool, tmp_path: Path,
) -> None:
    recording = beside(name, position, has_efforts, tmp_path)
    stamps = np.rint(recording.time * 1e9).astype(int) + (recording.epoch - EPOCH) * 10**9
    at = np.searchsorted(np.rint(TIME * 1e9).astype(int), stamps)
    np.testing.assert_array_equal(recording.position, POSITION[at])
    known = np.isfinite(recording.effort).all(axis=1)
    assert known.sum() >= N - 2
    np.testing.assert_allclose(recording.effort[known], EFFORT[at][known], atol=0.02)


def test_the_only_topic_with_positions_and_efforts_is_read_alone(tmp_path: Path) -> None:
    recording = beside('/robot/torque_states', (0.5, 0.5), False, tmp_path)
    np.testing.assert_allclose(recording.position, 0.5 + 0.5 * POSITION)
    np.testing.assert_array_equal(recording.effort, EFFORT)
    assert 'merged' not in {finding.kind for finding in recording.findings}


def test_efforts_on_two_other_topics_are_a_question(tmp_path: Path) -> None:
    def three(k: int) -> dict[str, Any]:
        return {'/joint_states': message(stamp(k), JOINTS, POSITION[k]), '/asked': state(k),
                '/felt': state(k)}

    with pytest.raises(UnreadableFileError, match='/asked, /felt each have the effort of a'):
        read(ros2(tmp_path / 'bag', three))


def test_dynamic_states_beside_those_of_other_hardware_are_read(tmp_path: Path) -> None:
    path = ros2(tmp_path / 'bag', lambda k: {
        '/dynamic_joint_states': currents(k, 'effort'), '/tool/states': currents(k, 'effort')})
    assert_read(read(path))


@pytest.mark.filterwarnings('error')
def test_a_position_that_is_not_finite_is_dropped_without_a_warning(tmp_path: Path) -> None:
    def one(k: int) -> dict[str, Any]:
        q = POSITION[k] if k != 5 else np.array([np.inf, 0.0])
        return {'/joint_states': message(stamp(k), JOINTS, q, (), EFFORT[k])}

    assert len(read(ros2(tmp_path / 'bag', one)).time) == N - 1
