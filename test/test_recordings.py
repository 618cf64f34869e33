"""Recordings: one reader for bags and CSV, and every defect told."""

from __future__ import annotations

import contextlib
import random
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState

from pprs_dynamics.errors import MissingLibraryError, MotionError, UnreadableFileError
from pprs_dynamics.measurement.joint_state_cdr import Layout, serialised
from pprs_dynamics.measurement.message_blocks import MOST_LAYOUTS, JointStateBlocks
from pprs_dynamics.measurement.recording import (
    Recording,
    describe,
    read_recording,
    write_recording,
)
from pprs_dynamics.measurement.samples import POLICY, Finding
from pprs_dynamics.mechanism.robot import DRIVES

STORE = get_typestore(Stores.ROS2_KILTED)
STATE = 'sensor_msgs/msg/JointState'
STEP = 0.002
# Steps of the plain recordings have exactly these nanoseconds, so that all formats say the same.
STEP_NS = 2_000_000
SUFFIXES = ('.csv', '.mcap', '.db3', '')
QUANTITIES = ('position', 'velocity', 'effort')

Arrays = dict[str, Any]


def measured(count: int = 1000, drives: tuple[str, ...] = DRIVES, seed: int = 0) -> Arrays:
    """Smooth motion seen by encoders of 1 um, velocities and efforts with noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(count) * STEP_NS / 1e9
    phase = 2 * np.pi * (0.5 + 0.2 * np.arange(len(drives))) * time[:, None]
    position = 1e-6 * np.rint(1e6 * (0.1 + 0.05 * np.sin(phase) + rng.normal(0, 1e-6, phase.shape)))
    velocity = 0.05 * np.gradient(np.sin(phase), STEP, axis=0) + rng.normal(0, 1e-4, phase.shape)
    return {'time': time, 'position': position, 'velocity': velocity,
            'effort': 5 * np.cos(phase) + rng.normal(0, 0.1, phase.shape)}


def judged(arrays: Arrays) -> Recording:
    return Recording.from_arrays('planted', **arrays)


def kinds(recording: Recording) -> set[str]:
    return {finding.kind for finding in recording.findings}


def the(recording: Recording, kind: str) -> Finding:
    """The only finding, which is of this kind."""
    assert kinds(recording) == {kind}
    (finding,) = recording.findings
    return finding


def message(stamp: int, names: Any, position: Any, velocity: Any, effort: Any) -> Any:
    types = STORE.types
    return types[STATE](
        types['std_msgs/msg/Header'](
            types['builtin_interfaces/msg/Time'](stamp // 10**9, stamp % 10**9), 'base'),
        list(names), *(np.array(values, dtype=float) for values in (position, velocity, effort)))


def write_plain_bag(
    path: Path, messages: dict[str, list[Any]], storage: StoragePlugin = StoragePlugin.MCAP,
    received: Callable[[int], int] = lambda k: k * STEP_NS, msgtype: str = STATE,
) -> Path:
    """What a recorder of ROS would write: messages, or their bytes, by topic."""
    with Writer(path, version=9, storage_plugin=storage) as writer:
        for topic, states in messages.items():
            connection = writer.add_connection(topic, msgtype, typestore=STORE)
            for k, state in enumerate(states):
                data = (state if isinstance(state, bytes)
                        else STORE.serialize_cdr(state, connection.msgtype))
                writer.write(connection, received(k), data)
    return path


def states_of(arrays: Arrays, names: tuple[str, ...] = DRIVES, **changes: Any) -> list[Any]:
    """Messages of arrays, whose columns belong to the names."""
    values = {**arrays, **changes}
    return [message(round(1e9 * values['time'][k]), names, *(
        [] if values[quantity] is None else values[quantity][k] for quantity in QUANTITIES))
        for k in range(len(values['time']))]


def table(arrays: Arrays, drives: tuple[str, ...] = DRIVES, prefix: str = '') -> pd.DataFrame:
    columns = {'time': arrays['time']}
    for quantity in QUANTITIES:
        for k, drive in enumerate(drives):
            columns[f'{prefix}{drive}/{quantity}'] = arrays[quantity][:, k]
    return pd.DataFrame(columns)


def assert_same(recording: Recording, arrays: Arrays) -> None:
    """Equal to the last bit, NaN as NaN."""
    np.testing.assert_array_equal(recording.time, arrays['time'])
    for quantity in QUANTITIES:
        found, expected = getattr(recording, quantity), arrays[quantity]
        if expected is None:
            assert found is None
        else:
            np.testing.assert_array_equal(found, expected, strict=True)


# ---------------------------------------------------------------------------------- formats


def by_own_writer(suffix: str) -> Callable[[Path, Arrays], Path]:
    def write(folder: Path, arrays: Arrays) -> Path:
        path = folder / f'recording{suffix}'
        write_recording(path, judged(arrays))
        return path
    return write


def by_rosbags(storage: StoragePlugin) -> Callable[[Path, Arrays], Path]:
    return lambda folder, arrays: write_plain_bag(
        folder / 'bag', {'/pprs/joint_states': states_of(arrays)}, storage)


def by_pandas(folder: Path, arrays: Arrays) -> Path:
    table(arrays).to_csv(folder / 'pandas.csv', index=False)
    return folder / 'pandas.csv'


WRITERS = {**{f'own{suffix}': by_own_writer(suffix) for suffix in SUFFIXES},
           'rosbags_mcap': by_rosbags(StoragePlugin.MCAP),
           'rosbags_sqlite3': by_rosbags(StoragePlugin.SQLITE3), 'pandas': by_pandas}


@pytest.mark.parametrize('write', WRITERS.values(), ids=WRITERS)
def test_every_writer_gives_the_same_arrays_and_nothing_to_tell(
    write: Callable[[Path, Arrays], Path], tmp_path: Path,
) -> None:
    arrays = measured(700)
    recording = read_recording(write(tmp_path, arrays))
    assert_same(recording, arrays)
    assert recording.findings == ()
    assert recording.segments == (slice(0, 700),)
    assert recording.drives == DRIVES


@pytest.mark.parametrize('suffix', SUFFIXES)
def test_efforts_that_were_not_measured_and_absent_velocities_survive_a_round_trip(
    suffix: str, tmp_path: Path,
) -> None:
    arrays = {**measured(600), 'velocity': None}
    arrays['effort'][50:60, 2] = np.nan
    path = by_own_writer(suffix)(tmp_path, arrays)
    recording = read_recording(path)
    assert_same(recording, arrays)
    assert kinds(recording) == {'effort_not_measured', 'missing_velocity'}
    again = by_own_writer(suffix)(tmp_path / 'again' if suffix == '' else tmp_path, arrays)
    assert_same(read_recording(again), arrays)


@pytest.mark.parametrize('suffix', ['.mcap', '.db3', ''])
def test_bags_keep_nanoseconds_of_a_clock_that_counts_from_1970(
    suffix: str, tmp_path: Path,
) -> None:
    arrays = measured(300)
    stamps = 1_763_000_123_456_789_123 + STEP_NS * np.arange(300)
    source = write_plain_bag(tmp_path / 'source', {
        '/joint_states': [message(int(stamp), DRIVES, *(arrays[name][k] for name in QUANTITIES))
                          for k, stamp in enumerate(stamps)]})
    recording = read_recording(source)
    assert recording.epoch == 1_763_000_123
    # As floats of seconds since 1970 they would be 120 ns off.
    np.testing.assert_array_equal(np.rint(1e9 * recording.time).astype(int),
                                  stamps - 1_763_000_123 * 10**9)
    write_recording(tmp_path / f'copy{suffix}', recording)
    copy = read_recording(tmp_path / f'copy{suffix}')
    assert copy.epoch == recording.epoch
    np.testing.assert_array_equal(copy.time, recording.time)


@settings(max_examples=40, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(values=st.lists(st.floats(-1e3, 1e3), min_size=25, max_size=60),
       steps=st.floats(1e-4, 0.3))
def test_a_csv_keeps_every_bit(tmp_path: Path, values: list[float], steps: float) -> None:
    time = 0.1 + steps * np.arange(len(values))
    effort = np.array(values)[:, None]
    recording = Recording.from_arrays('x', time, np.sin(time)[:, None], effort / 7, effort,
                                      ('axis',))
    write_recording(tmp_path / 'x.csv', recording)
    assert_same(read_recording(tmp_path / 'x.csv', ('axis',)),
                {'time': time, 'position': np.sin(time)[:, None], 'velocity': effort / 7,
                 'effort': effort})


@settings(max_examples=30, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(order=st.permutations(range(19)))
def test_csv_columns_may_stand_in_any_order(tmp_path: Path, order: list[int]) -> None:
    arrays = measured(30)
    columns = table(arrays)
    columns.iloc[:, order].to_csv(tmp_path / 'x.csv', index=False)
    assert_same(read_recording(tmp_path / 'x.csv'), arrays)


@pytest.mark.parametrize('suffix', SUFFIXES)
def test_a_single_axis_is_read_by_its_own_drive(suffix: str, tmp_path: Path) -> None:
    arrays = measured(200, ('axis',))
    write_recording(tmp_path / f'x{suffix}', Recording.from_arrays('x', **arrays, drives=('axis',)))
    recording = read_recording(tmp_path / f'x{suffix}', drives=('axis',))
    assert_same(recording, arrays)
    with pytest.raises(UnreadableFileError, match=r'slide_1.*axis'):
        read_recording(tmp_path / f'x{suffix}')


@pytest.mark.parametrize('suffix', SUFFIXES)
def test_progress_rises_to_the_total(suffix: str, tmp_path: Path) -> None:
    arrays = measured(9000)
    write_recording(tmp_path / f'x{suffix}', judged(arrays))
    calls: list[tuple[int, int]] = []
    read_recording(tmp_path / f'x{suffix}', progress=lambda *call: calls.append(call))
    done = [call[0] for call in calls]
    assert done == sorted(done)
    assert calls[-1][0] == calls[-1][1] > 0
    assert len({total for _, total in calls}) == 1


# ------------------------------------------------------------------------------------- bags


def test_drives_are_found_by_name_among_other_joints_in_any_order(tmp_path: Path) -> None:
    arrays = measured(600)
    names = ('gripper', *DRIVES[::-1], 'door')
    wide = {name: np.column_stack((np.ones(600), arrays[name][:, ::-1], np.zeros(600)))
            for name in QUANTITIES}
    path = write_plain_bag(tmp_path / 'bag', {
        '/joint_states': states_of({'time': arrays['time'], **wide}, names)})
    recording = read_recording(path)
    assert_same(recording, arrays)
    assert the(recording, 'ignored_joints').count == 2
    assert 'door, gripper' in the(recording, 'ignored_joints').text


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), orders=st.integers(1, 40), big_endian=st.booleans())
def test_reading_bytes_by_layout_agrees_with_rosbags(
    seed: int, orders: int, big_endian: bool,
) -> None:
    # Any number of joints and orders, sequences that are absent, names of any length.
    shuffle = random.Random(seed)
    joints = [*DRIVES, *('x' * k for k in range(1, shuffle.randint(1, 5)))]
    choices = [shuffle.sample(joints, len(joints)) for _ in range(orders)]
    data = []
    for k in range(120):
        names = shuffle.choice(choices)
        if shuffle.random() < 0.1:
            names = names[:-1]
        arrays = [[shuffle.gauss(0, 1) for _ in names] if shuffle.random() < 0.9 else []
                  for _ in QUANTITIES]
        state = message(shuffle.randrange(2**31 * 10**9), names, *arrays)
        little = not (big_endian and k % 3 == 0)
        data.append(bytes(STORE.serialize_cdr(state, STATE, little_endian=little)))
    received = list(range(120))
    fast, slow = JointStateBlocks(DRIVES), JointStateBlocks(DRIVES, use_layouts=False)
    for blocks in (fast, slow):
        blocks.add(data[:70], received[:70])
        blocks.add(data[70:], received[70:])
    assert fast.names == slow.names == set(joints)
    assert 0 < fast.samples == slow.samples < 120 or fast.samples == slow.samples
    for found, expected in zip(fast.arrays(), slow.arrays(), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_more_orders_of_names_than_layouts_are_kept_are_read_all_the_same() -> None:
    orders = [DRIVES[k:] + DRIVES[:k] for k in range(6)]
    orders += [order[::-1] for order in orders] + [(*order, 'x') for order in orders]
    assert len(orders) > MOST_LAYOUTS
    blocks = JointStateBlocks(DRIVES)
    data = [bytes(STORE.serialize_cdr(
        message(k, order, [float(f'{k}.{sorted(order).index(name)}') for name in order],
                [], [1.0] * len(order)), STATE)) for k, order in enumerate(orders * 3)]
    blocks.add(data, range(len(data)))
    stamps, _, position, velocity, effort = blocks.arrays()
    np.testing.assert_array_equal(stamps, np.arange(len(data)))
    place = [float(f'0.{sorted(DRIVES).index(name)}') for name in DRIVES]
    np.testing.assert_allclose(position - np.arange(len(data))[:, None], [place] * len(data),
                               atol=1e-12)
    assert np.all(np.isnan(velocity))
    assert np.all(effort == 1)


@pytest.mark.parametrize('absent', [(), ('velocity',), ('effort',), ('velocity', 'effort')])
@pytest.mark.parametrize('frame', ['', 'a', 'base', 'world_1'])
def test_bytes_of_ros_itself_are_understood(absent: tuple[str, ...], frame: str) -> None:
    # rmw_fastrtps leaves bytes behind the message where a sequence is empty.
    values = {name: [] if name in absent else [1.5, -2.5, 3.5] for name in QUANTITIES}
    state = JointState(name=['b', 'other', 'a'], **values)
    state.header.stamp.sec, state.header.stamp.nanosec = 12, 345
    state.header.frame_id = frame
    blocks = JointStateBlocks(('a', 'b'))
    blocks.add([serialize_message(state)] * 3, [0, 1, 2])
    stamps, _, *arrays = blocks.arrays()
    assert stamps.tolist() == [12 * 10**9 + 345] * 3
    for name, array in zip(QUANTITIES, arrays, strict=True):
        expected = [np.nan, np.nan] if name in absent else [3.5, 1.5]
        np.testing.assert_array_equal(array, [expected] * 3)


@pytest.mark.parametrize('velocity', [True, False])
@pytest.mark.parametrize('names', [('axis',), DRIVES, ('a', 'bb', 'ccc', 'dddd', 'eeeee')])
def test_our_bytes_are_those_of_rosbags(names: tuple[str, ...], velocity: bool) -> None:
    values = np.random.default_rng(3).normal(size=(3, 4, len(names)))
    stamps = np.array([0, 1, 10**9 - 1, 2**31 * 10**9 - 1])
    rows = serialised(names, stamps, values[0], values[1] if velocity else None, values[2])
    for k, stamp in enumerate(stamps):
        state = message(int(stamp), names, values[0, k], values[1, k] if velocity else [],
                        values[2, k])
        state.header.frame_id = ''
        assert rows[k].tobytes() == bytes(STORE.serialize_cdr(state, STATE))


def test_a_layout_is_told_from_another_by_every_byte_that_makes_it() -> None:
    data = bytearray(STORE.serialize_cdr(message(7, DRIVES, *np.ones((3, 6))), STATE))
    layout = Layout.of(bytes(data))
    assert layout is not None
    changeable = set(range(len(data))) - set(layout.fixed.tolist())
    # Stamp 8, options 2, 'base' and its end 5; the rest are the values and their padding.
    assert len(changeable) <= 8 + 2 + 5 + 3 * 6 * 8 + 6 * 3 + 3 * 7
    for place in layout.fixed.tolist():
        changed = data.copy()
        changed[place] ^= 1
        assert not layout.matches(np.frombuffer(bytes(changed), np.uint8)[None])[0]


@settings(max_examples=200, deadline=None)
@given(data=st.binary(max_size=200), start=st.booleans())
def test_no_bytes_break_the_reader_of_messages(data: bytes, start: bool) -> None:
    blocks = JointStateBlocks(DRIVES)
    blocks.add([b'\x00\x01\x00\x00' + data if start else data], [0])
    assert blocks.samples == 0


def test_messages_without_all_drives_are_ignored_and_told(tmp_path: Path) -> None:
    arrays = measured(60)
    states = states_of(arrays)
    half = [message(k, DRIVES[:3], np.ones(3), [], []) for k in range(20)]
    mixed = [state for pair in zip(states, half, strict=False) for state in pair] + states[20:]
    recording = read_recording(write_plain_bag(tmp_path / 'bag', {'/joint_states': mixed}))
    assert_same(recording, arrays)
    assert the_one(recording, 'incomplete_messages').count == 20


def the_one(recording: Recording, kind: str) -> Finding:
    (finding,) = [finding for finding in recording.findings if finding.kind == kind]
    return finding


def test_several_topics_of_joint_states_must_be_chosen_from(tmp_path: Path) -> None:
    left, right = measured(50, seed=1), measured(50, seed=2)
    path = write_plain_bag(tmp_path / 'bag', {
        '/left/joint_states': states_of(left), '/right/joint_states': states_of(right),
        '/silent/joint_states': [], '/left/wanted': states_of(left)})
    with pytest.raises(UnreadableFileError, match='/left/joint_states, /right/joint_st') as told:
        read_recording(path)
    assert 'silent' not in str(told.value)
    assert_same(read_recording(path, topic='/right/joint_states'), right)
    assert_same(read_recording(path, topic='left/wanted'), left)
    with pytest.raises(UnreadableFileError, match='no sensor_msgs/JointState on /nowhere'):
        read_recording(path, topic='/nowhere')
    with pytest.raises(UnreadableFileError, match='no messages'):
        read_recording(path, topic='/silent/joint_states')


def test_one_storage_file_without_metadata_is_read_and_two_are_not(tmp_path: Path) -> None:
    arrays = measured(600)
    path = by_own_writer('')(tmp_path, arrays)
    (path / 'metadata.yaml').unlink()
    recording = read_recording(path)
    assert_same(recording, arrays)
    assert the(recording, 'no_metadata').count == 1
    (path / 'second.mcap').write_bytes((path / 'recording.mcap').read_bytes())
    with pytest.raises(UnreadableFileError, match=r'metadata\.yaml'):
        read_recording(path)


def test_header_stamps_of_0_are_replaced_by_times_of_recording(tmp_path: Path) -> None:
    arrays = measured(600)
    states = states_of(arrays, time=np.zeros(600))
    recording = read_recording(write_plain_bag(tmp_path / 'bag', {'/joint_states': states}))
    assert_same(recording, arrays)
    assert the(recording, 'receive_times').count == 600


def test_without_rosbags_bags_are_refused_in_one_sentence_and_csv_still_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    arrays = measured(100)
    bag, text = by_own_writer('.mcap')(tmp_path, arrays), by_own_writer('.csv')(tmp_path, arrays)
    monkeypatch.setitem(__import__('sys').modules, 'rosbags.rosbag2', None)
    for action in (lambda: read_recording(bag),
                   lambda: write_recording(tmp_path / 'new.db3', judged(arrays))):
        with pytest.raises(MissingLibraryError, match=r'rosbags.*pprs_dynamics\[bags\]'):
            action()
    assert_same(read_recording(text), arrays)


def test_bags_are_not_overwritten_and_files_are_replaced(tmp_path: Path) -> None:
    first, second = measured(100, seed=1), measured(50, seed=2)
    for suffix in ('.csv', '.mcap', '.db3'):
        for arrays in (first, second):
            write_recording(tmp_path / f'x{suffix}', judged(arrays))
        assert_same(read_recording(tmp_path / f'x{suffix}'), second)
    write_recording(tmp_path / 'bag', judged(first))
    with pytest.raises(UnreadableFileError, match='exists already'):
        write_recording(tmp_path / 'bag', judged(second))
    assert_same(read_recording(tmp_path / 'bag'), first)
    assert sorted(file.name for file in tmp_path.iterdir()) == ['bag', 'x.csv', 'x.db3', 'x.mcap']


@pytest.mark.parametrize('suffix', SUFFIXES)
def test_what_cannot_be_written_is_told(suffix: str, tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(UnreadableFileError, match='cannot be written'):
        write_recording(tmp_path / 'file' / f'x{suffix}', judged(measured(30)))


def test_times_before_0_cannot_be_stamps_of_ros(tmp_path: Path) -> None:
    arrays = measured(30)
    arrays['time'] = arrays['time'] - 1
    with pytest.raises(UnreadableFileError, match='-1 to'):
        write_recording(tmp_path / 'x.mcap', judged(arrays))


# -------------------------------------------------------------------------------------- CSV


TEXTS: dict[str, Callable[[str], str]] = {
    'byte order mark': lambda text: '\ufeff' + text,
    'CRLF': lambda text: text.replace('\n', '\r\n'),
    'semicolons': lambda text: text.replace(',', ';'),
    'tabs': lambda text: text.replace(',', '\t'),
    'quotes': lambda text: re.sub(r'[^,\n]+', r'"\g<0>"', text),
    'blanks': lambda text: text.replace(',', ' , '),
    'empty lines': lambda text: text.replace('\n', '\n\n') + '\n \n',
    'no last line end': lambda text: text.rstrip('\n'),
    'time of PlotJuggler': lambda text: text.replace('time', '__time'),
}


@pytest.mark.parametrize('change', TEXTS.values(), ids=TEXTS)
def test_csv_dialects_are_read_alike(change: Callable[[str], str], tmp_path: Path) -> None:
    arrays = measured(40)
    arrays['effort'][3:5] = np.nan
    arrays['effort'][7, 5] = np.nan
    text = change(table(arrays).to_csv(index=False))
    (tmp_path / 'x.csv').write_bytes(text.encode())
    assert_same(read_recording(tmp_path / 'x.csv'), arrays)


def test_other_columns_are_ignored_and_told_even_where_they_hold_words(tmp_path: Path) -> None:
    arrays = measured(40)
    columns = table(arrays)
    columns.insert(0, 'phase', ['up, and "down"'] * 40)
    columns['gripper/position'] = 1.0
    columns.to_csv(tmp_path / 'x.csv')
    recording = read_recording(tmp_path / 'x.csv')
    assert_same(recording, arrays)
    finding = the_one(recording, 'ignored_columns')
    assert finding.count == 3
    assert all(name in finding.text for name in ('(no name)', 'phase', 'gripper/position'))


def test_prefixes_of_other_tools_are_accepted_where_they_are_unambiguous(tmp_path: Path) -> None:
    left, right = measured(40, seed=1), measured(40, seed=2)
    one = table(left, prefix='/joint_states/')
    one.to_csv(tmp_path / 'one.csv', index=False)
    assert_same(read_recording(tmp_path / 'one.csv'), left)
    pd.concat([one, table(right).drop(columns='time')], axis=1).to_csv(
        tmp_path / 'plain.csv', index=False)
    assert_same(read_recording(tmp_path / 'plain.csv'), right)
    two = pd.concat([table(left, prefix='/left/joint_states/'),
                     table(right, prefix='/right/joint_states/').drop(columns='time')], axis=1)
    two.to_csv(tmp_path / 'two.csv', index=False)
    with pytest.raises(UnreadableFileError, match='/left/joint_states, /right/joint_states'):
        read_recording(tmp_path / 'two.csv')
    assert_same(read_recording(tmp_path / 'two.csv', topic='/right/joint_states'), right)


def test_rows_that_belong_to_other_topics_leave_the_motion_as_it_is(tmp_path: Path) -> None:
    # PlotJuggler writes all series into one table, a row per stamp of any of them.
    arrays = measured(600)
    columns = table(arrays)
    other = pd.DataFrame({'time': arrays['time'] + STEP / 3, 'battery': 1.0})
    pd.concat([columns, other]).sort_values('time').to_csv(tmp_path / 'x.csv', index=False)
    recording = read_recording(tmp_path / 'x.csv')
    assert_same(recording, arrays)
    assert the_one(recording, 'non_finite_position').count == 600
    assert kinds(recording) == {'non_finite_position', 'ignored_columns'}


MISTAKES = {
    'no time': (lambda text: text.replace('time', 'zeit', 1), 'must hold time'),
    'no drive': (lambda text: text.replace('lift_2', 'hub_2'), 'no lift_2/position; .*hub_2'),
    'a word': (lambda text: text.replace('\n0.01,', '\nsoon,'), "row 7, column time .*'soon'"),
    'a decimal comma': (
        lambda text: text.replace(',', ';').replace('\n0.01;', '\n0,01;'), 'decimal comma'),
    'a short row': (lambda text: text[:-40], 'row 41 holds 13 cells, but the header 19'),
    'a long row': (lambda text: text.rstrip() + ',1\n', 'row 41 holds 20 cells'),
    'no rows': (lambda text: text.split('\n')[0], 'no samples below the header'),
    'a column twice': (lambda text: text.replace('lift_1/velocity', 'lift_1/position'),
                       "'lift_1/position' stands twice"),
    'time twice': (lambda text: text.replace('slide_1/velocity', 'time'), "'time' stands twice"),
    'no position anywhere': (lambda text: re.sub(r'(?m)^([0-9][^,]*),[^,]*', r'\1,', text),
                             'none of its 40 samples'),
}


@pytest.mark.parametrize(('change', 'words'), MISTAKES.values(), ids=MISTAKES)
def test_mistakes_in_a_csv_are_one_sentence_with_the_place(
    change: Callable[[str], str], words: str, tmp_path: Path,
) -> None:
    arrays = {name: values.round(3) for name, values in measured(40).items()}
    (tmp_path / 'x.csv').write_text(change(table(arrays).to_csv(index=False)))
    with pytest.raises(UnreadableFileError, match=words) as told:
        read_recording(tmp_path / 'x.csv')
    assert '\n' not in str(told.value)
    assert str(told.value).startswith(str(tmp_path / 'x.csv'))


# ---------------------------------------------------------------------------- foreign files


def damaged(suffix: str, share: float) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = by_own_writer(suffix)(folder, measured(5000))
        path.write_bytes(path.read_bytes()[:int(share * path.stat().st_size)])
        return path
    return make


def content(name: str, data: bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name
    return make


def without_joint_states(folder: Path) -> Path:
    text = STORE.types['std_msgs/msg/String']('hello')
    return write_plain_bag(folder / 'bag', {'/joint_states': [
        bytes(STORE.serialize_cdr(text, 'std_msgs/msg/String'))]}, msgtype='std_msgs/msg/String')


def empty_folder(folder: Path) -> Path:
    (folder / 'empty').mkdir()
    return folder / 'empty'


def other_metadata(folder: Path) -> Path:
    return content('metadata.yaml', b'a: [1')(folder).parent


NOISE = random.Random(5).randbytes(4000)
JPEG = b'\xff\xd8\xff\xe0\x00\x10JFIF\x00\x01' + NOISE
FOREIGN = {
    'missing': lambda folder: folder / 'nothing.csv',
    **{f'{kind}{suffix}': content(f'x{suffix}', data) for suffix in ('.csv', '.mcap', '.db3')
       for kind, data in (('noise', NOISE), ('jpeg', JPEG), ('empty', b''), ('zeros', bytes(999)))},
    'text': content('x.csv', b'Dear robot,\nhow are you?\n'),
    'UTF-16': content('x.csv', 'time,axis/position\n1,2\n'.encode('utf-16')),
    'noise after rows': content('x.csv', b'time,' + b','.join(
        f'{drive}/position'.encode() for drive in DRIVES) + b'\n0,1,2,3,4,5,6\n' + NOISE),
    **{f'{share} of {suffix}': damaged(suffix, share) for suffix in ('.mcap', '.db3')
       for share in (0.0001, 0.1, 0.5, 0.9, 0.9999)},
    'header of a db3': content('x.db3', b'SQLite format 3\x00' + NOISE),
    'header of an mcap': content('x.mcap', b'\x89MCAP0\r\n' + NOISE),
    'mcap under another name': content('x.csv', b'\x89MCAP0\r\n' + NOISE),
    'no joint states': without_joint_states,
    'empty folder': empty_folder,
    'other metadata': other_metadata,
}


@pytest.mark.parametrize('make', FOREIGN.values(), ids=FOREIGN)
def test_foreign_and_damaged_files_are_one_sentence(
    make: Callable[[Path], Path], tmp_path: Path,
) -> None:
    path = make(tmp_path)
    with pytest.raises(UnreadableFileError) as told:
        read_recording(path)
    assert str(told.value).startswith(f'{path}: ')
    assert '\n' not in str(told.value)
    assert len(str(told.value)) < len(str(path)) + 300


@settings(max_examples=60, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1), value=st.integers(1, 255), suffix=st.sampled_from(['.mcap', '.db3']))
def test_a_changed_byte_in_a_bag_is_an_error_of_ours_or_none(
    tmp_path: Path, share: float, value: int, suffix: str,
) -> None:
    path = by_own_writer(suffix)(tmp_path, measured(60))
    data = bytearray(path.read_bytes())
    data[int(share * (len(data) - 1))] ^= value
    path.write_bytes(data)
    # Bytes of values are data like any other; only a traceback would be a fault.
    with contextlib.suppress(UnreadableFileError):
        read_recording(path)


# ---------------------------------------------------------------------------------- defects


@pytest.mark.parametrize('seed', range(5))
def test_a_sound_recording_has_nothing_to_tell(seed: int) -> None:
    # Pauses, slow and fast motion, jitter of a tenth of a step.
    arrays = measured(4000, seed=seed)
    rng = np.random.default_rng(seed)
    arrays['time'] = arrays['time'] + rng.uniform(-0.1, 0.1, 4000) * STEP
    pause = slice(1000, 2000)
    arrays['position'][pause] = arrays['position'][1000] + 1e-6 * rng.integers(-1, 2, (1000, 6))
    arrays['position'][2000:] += arrays['position'][1999] - arrays['position'][2000]
    recording = judged(arrays)
    assert recording.findings == ()
    assert recording.segments == (slice(0, 4000),)


def test_non_finite_times_and_positions_are_dropped() -> None:
    arrays = measured()
    arrays['time'][[100, 200]] = np.nan, np.inf
    arrays['position'][300, 0], arrays['position'][[301, 400], 4] = np.nan, -np.inf
    recording = judged(arrays)
    assert the_one(recording, 'non_finite_time').count == 2
    finding = the_one(recording, 'non_finite_position')
    assert finding.count == 3
    assert finding.spans == ((0.6, 0.602), (0.8, 0.8))
    assert finding.drives == ('slide_1', 'lift_2')
    kept = np.setdiff1d(np.arange(1000), [100, 200, 300, 301, 400])
    np.testing.assert_array_equal(recording.effort, arrays['effort'][kept])
    assert the_one(recording, 'lost_samples').count == 5
    assert recording.segments == (slice(0, 995),)


def test_late_stamps_are_sorted_in() -> None:
    arrays = measured()
    order = np.arange(1000)
    order[200:202], order[500:505] = [201, 200], [503, 500, 501, 502, 504]
    recording = judged({name: values[order] for name, values in arrays.items()})
    assert_same(recording, arrays)
    assert the(recording, 'unordered_stamps').count == 4
    assert the(recording, 'unordered_stamps').spans == ((0.4, 0.4), (1.0, 1.004))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), reach=st.integers(1, 5))
def test_any_disorder_within_reach_is_undone(seed: int, reach: int) -> None:
    arrays = measured(200)
    shift = np.random.default_rng(seed).uniform(0, reach, 200)
    order = np.argsort(np.arange(200) + shift, kind='stable')
    recording = judged({name: values[order] for name, values in arrays.items()})
    assert_same(recording, arrays)
    assert recording.segments == (slice(0, 200),)


def test_shuffled_rows_are_sorted() -> None:
    arrays = measured()
    order = np.random.default_rng(0).permutation(1000)
    recording = judged({name: values[order] for name, values in arrays.items()})
    assert_same(recording, arrays)
    assert kinds(recording) == {'unordered_stamps'}
    assert recording.segments == (slice(0, 1000),)


@pytest.mark.parametrize('back', [0.2, 2.0, 1.7e9])
def test_a_clock_that_is_set_back_splits(back: float) -> None:
    arrays = measured()
    arrays['time'] = arrays['time'] + np.where(np.arange(1000) < 600, back, 0.0)
    recording = judged(arrays)
    finding = the(recording, 'clock_reset')
    assert finding.count == 1
    assert finding.spans == ((1.2, 1.2),)
    assert recording.segments == (slice(0, 600), slice(600, 1000))
    np.testing.assert_array_equal(recording.position, arrays['position'])


def test_a_single_stamp_of_another_clock_is_not_sorted_in() -> None:
    arrays = measured()
    arrays['time'][500] -= 5
    recording = judged(arrays)
    assert kinds(recording) == {'clock_reset', 'gap', 'short_segment'}
    assert recording.segments == (slice(0, 500), slice(501, 1000))


def test_segments_stay_in_place_when_samples_before_them_are_dropped() -> None:
    arrays = measured()
    arrays['time'][600:] -= 1
    arrays['time'][100] = arrays['time'][99]
    recording = judged(arrays)
    assert kinds(recording) == {'clock_reset', 'duplicate_stamps', 'lost_samples'}
    assert recording.segments == (slice(0, 599), slice(599, 999))


def test_stamps_from_before_the_clock_was_set_do_not_cost_digits(tmp_path: Path) -> None:
    arrays = measured(600)
    states = states_of(arrays, time=arrays['time'] + 1_700_000_000)
    states[0] = message(0, DRIVES, *(arrays[name][0] for name in QUANTITIES))
    recording = read_recording(write_plain_bag(tmp_path / 'bag', {'/joint_states': states}))
    assert recording.epoch == 1_700_000_000
    assert recording.segments == (slice(1, 600),)
    # The test itself made these stamps from floats of seconds since 1970, good to 0.24 us.
    assert np.abs(np.diff(recording.time[1:]) - STEP).max() < 1e-6
    assert kinds(recording) == {'gap', 'short_segment'}


@pytest.mark.parametrize('suffix', SUFFIXES)
def test_a_clock_that_is_set_back_survives_a_round_trip(suffix: str, tmp_path: Path) -> None:
    arrays = measured(900)
    arrays['time'] = np.tile(arrays['time'][:300], 3)
    path = by_own_writer(suffix)(tmp_path, arrays)
    recording = read_recording(path)
    assert_same(recording, arrays)
    assert the(recording, 'clock_reset').count == 2
    assert recording.segments == (slice(0, 300), slice(300, 600), slice(600, 900))


def test_of_equal_stamps_the_first_sample_is_kept() -> None:
    arrays = measured()
    order = np.sort(np.concatenate((np.arange(1000), [10, 10, 700])))
    doubled = {name: values[order] for name, values in arrays.items()}
    doubled['effort'][[11, 12]] = 99
    recording = judged(doubled)
    assert_same(recording, arrays)
    finding = the(recording, 'duplicate_stamps')
    assert finding.count == 3
    assert finding.spans == ((0.02, 0.02), (1.4, 1.4))


def test_of_equal_stamps_in_shuffled_rows_the_first_of_the_file_is_kept() -> None:
    arrays = measured()
    order = np.random.default_rng(2).permutation(1000)
    shuffled = {name: values[order] for name, values in arrays.items()}
    shuffled['time'] = STEP * (order // 2)
    recording = judged(shuffled)
    place = np.argsort(order)
    first = np.where(place[::2] < place[1::2], np.arange(0, 1000, 2), np.arange(1, 1000, 2))
    np.testing.assert_array_equal(recording.effort, arrays['effort'][first])


@pytest.mark.parametrize('length', [1, 2, 3])
def test_spikes_of_position_are_dropped(length: int) -> None:
    arrays = measured()
    arrays['position'][400:400 + length, 3] += 0.03
    recording = judged(arrays)
    finding = the_one(recording, 'position_spike')
    assert (finding.count, finding.drives) == (length, ('lift_1',))
    assert finding.spans == ((pytest.approx(0.8), pytest.approx(0.8 + STEP * (length - 1))),)
    assert kinds(recording) == {'position_spike', 'lost_samples'}
    assert the_one(recording, 'lost_samples').count == length
    kept = np.setdiff1d(np.arange(1000), np.arange(400, 400 + length))
    np.testing.assert_array_equal(recording.position, arrays['position'][kept])
    assert recording.segments == (slice(0, 1000 - length),)


def test_a_position_that_jumps_splits() -> None:
    arrays = measured()
    arrays['position'][500:, 1] -= 0.03
    recording = judged(arrays)
    finding = the(recording, 'position_jump')
    assert (finding.count, finding.drives) == (1, ('slide_2',))
    assert finding.spans == ((1.0, 1.0),)
    # What the drive moved in that step comes on top.
    size = float(re.search(r'jumps 1 time, by up to (\S+) m', finding.text)[1])    # type: ignore[index]
    assert size == pytest.approx(-0.03, abs=0.001)
    assert recording.segments == (slice(0, 500), slice(500, 1000))


@pytest.mark.parametrize('factor', [0.25, 0.5, 2, 5])
def test_a_rate_that_changes_splits_where_it_changes(factor: float) -> None:
    arrays = measured()
    steps = np.full(1000, STEP)
    steps[450:] *= factor
    arrays['time'] = np.cumsum(steps)
    recording = judged(arrays)
    finding = the(recording, 'changing_rate')
    assert finding.spans == ((arrays['time'][449], arrays['time'][449]),)
    assert f'from 500 Hz to {500 / factor:.4g} Hz' in finding.text
    assert recording.segments == (slice(0, 449), slice(449, 1000))
    assert [round(part.rate) for part in describe(recording).segments] == [500, 500 / factor]


def test_gaps_split_and_lost_samples_do_not() -> None:
    arrays = measured()
    gone = [100, 300, 301, *range(500, 509), *range(700, 710)]
    kept = np.setdiff1d(np.arange(1000), gone)
    recording = judged({name: values[kept] for name, values in arrays.items()})
    assert kinds(recording) == {'gap', 'lost_samples'}
    lost = the_one(recording, 'lost_samples')
    # Nine lost samples make a step of 20 ms, no longer than a cubic can bridge; ten make a gap.
    assert lost.count == 1 + 2 + 9
    np.testing.assert_allclose(lost.spans, [(0.198, 0.202), (0.598, 0.604), (0.998, 1.018)])
    gap = the_one(recording, 'gap')
    assert gap.count == 1
    np.testing.assert_allclose(gap.spans, [(1.398, 1.42)])
    assert recording.segments == (slice(0, 688), slice(688, 978))


def test_one_late_stamp_is_not_a_lost_sample() -> None:
    arrays = measured()
    arrays['time'][500] += 0.7 * STEP
    assert judged(arrays).findings == ()


def test_irregular_steps_are_told() -> None:
    arrays = measured(5000)
    arrays['time'] = arrays['time'] + np.random.default_rng(0).uniform(0, 0.9, 5000) * STEP
    assert 'irregular_steps' in kinds(judged(arrays))
    # Losing samples at random does not make stamps irregular.
    kept = np.sort(np.random.default_rng(1).choice(5000, 4500, replace=False))
    lossy = judged({name: values[kept] for name, values in measured(5000).items()})
    assert the(lossy, 'lost_samples').count == kept[-1] - kept[0] + 1 - 4500


def test_milliseconds_taken_for_seconds_are_told() -> None:
    arrays = measured()
    arrays['time'] = 1000 * arrays['time']
    assert 'one sample in 2 s' in the(judged(arrays), 'slow_rate').text


def test_efforts_that_are_not_finite_count_as_not_measured() -> None:
    arrays = measured()
    arrays['effort'][10:20, 2], arrays['effort'][15:40, 5], arrays['effort'][90, 0] = (
        np.nan, np.inf, -np.inf)
    recording = judged(arrays)
    finding = the(recording, 'effort_not_measured')
    assert finding.count == 10 + 25 + 1
    assert finding.spans == ((0.02, 0.078), (0.18, 0.18))
    assert finding.drives == ('slide_1', 'slide_3', 'lift_3')
    assert 'lift_3 (2.5 % of the samples)' in finding.text
    assert np.isnan(recording.effort).sum() == 36
    np.testing.assert_array_equal(recording.position, arrays['position'])
    assert np.isinf(arrays['effort']).sum() == 26, 'the caller keeps his own array'


def test_missing_velocities_are_told_per_drive() -> None:
    arrays = measured()
    arrays['velocity'][:, 1] = np.nan
    recording = judged(arrays)
    finding = the(recording, 'missing_velocity')
    assert (finding.count, finding.drives) == (1000, ('slide_2',))
    assert 'slide_2 (all)' in finding.text
    assert the(judged({**arrays, 'velocity': None}), 'missing_velocity').count == 1000


@pytest.mark.parametrize('quantity', QUANTITIES)
def test_values_that_never_change_are_told(quantity: str) -> None:
    arrays = measured()
    arrays[quantity][:, 4] = 0.25
    finding = the(judged(arrays), f'constant_{quantity}')
    assert (finding.count, finding.drives) == (1, ('lift_2',))
    assert f'the {quantity} of lift_2 is 0.25' in finding.text


def test_an_effort_that_stands_still_while_its_drive_moves_is_told() -> None:
    arrays = measured()
    arrays['effort'][200:600, 3] = 1.5
    finding = the(judged(arrays), 'constant_effort')
    assert (finding.count, finding.drives) == (1, ('lift_1',))
    assert finding.spans == ((0.4, pytest.approx(1.198)),)
    # At rest a coarse sensor may well say the same for long.
    arrays['position'][200:600, 3] = arrays['position'][200, 3]
    arrays['position'][600:, 3] += arrays['position'][599, 3] - arrays['position'][600, 3]
    assert judged(arrays).findings == ()


def test_repeated_messages_are_told() -> None:
    arrays = measured()
    for name in QUANTITIES:
        arrays[name][300:360] = arrays[name][300]
        arrays[name][700:705] = arrays[name][700]
    recording = judged(arrays)
    finding = the_one(recording, 'frozen_samples')
    assert finding.count == 59
    assert finding.spans == ((0.6, pytest.approx(0.718)),)


def test_a_robot_at_rest_without_efforts_is_not_called_frozen() -> None:
    arrays = {**measured(), 'effort': None, 'velocity': None}
    arrays['position'][300:500] = arrays['position'][300]
    arrays['position'][500:] += arrays['position'][499] - arrays['position'][500]
    assert kinds(judged(arrays)) == {'effort_not_measured', 'missing_velocity'}


def test_segments_too_short_to_filter_are_not_used() -> None:
    arrays = measured()
    arrays['time'][100:119] += 1
    arrays['time'][119:] += 2
    recording = judged(arrays)
    finding = the_one(recording, 'short_segment')
    assert finding.count == 1
    np.testing.assert_allclose(finding.spans, [(1.2, 1.236)])
    assert recording.segments == (slice(0, 100), slice(119, 1000))
    assert len(recording.time) == 1000


def test_a_short_recording_is_told_and_kept() -> None:
    assert the(judged(measured(99)), 'too_short').count == 1
    recording = judged(measured(5))
    assert kinds(recording) >= {'short_segment', 'too_short'}
    assert recording.segments == ()
    assert len(recording.time) == 5


@settings(max_examples=60, deadline=None)
@given(times=st.lists(st.one_of(st.floats(), st.floats(0, 3).map(lambda t: round(t, 2))),
                      min_size=1, max_size=80), seed=st.integers(0, 99))
def test_whatever_the_stamps_segments_are_ordered_and_everything_is_finite(
    times: list[float], seed: int,
) -> None:
    position = np.random.default_rng(seed).choice([0, 0, 1, 1e9, np.nan], (len(times), 1),
                                                  p=[0.4, 0.2, 0.2, 0.15, 0.05])
    try:
        recording = Recording.from_arrays('x', np.array(times), position, drives=('axis',))
    except MotionError:
        assert not np.any(np.isfinite(times) & np.isfinite(position[:, 0]))
        return
    assert np.all(np.isfinite(recording.time))
    assert np.all(np.isfinite(recording.position))
    for part in recording.segments:
        assert np.all(np.diff(recording.time[part]) > 0)
    starts = [part.start for part in recording.segments]
    assert starts == sorted(starts)


def test_every_defect_of_the_policy_is_planted_in_a_test() -> None:
    text = Path(__file__).read_text()
    planted = {kind for kind in POLICY
               if re.search(rf"(the|the_one)\([^'\n]*'{kind}'\)|'{kind}' in kinds", text)}
    planted |= {f'constant_{quantity}' for quantity in QUANTITIES} | {'short_segment'}
    assert planted == set(POLICY)


# ------------------------------------------------------------------------------ description


def test_a_recording_is_described_by_its_rates_ranges_and_findings() -> None:
    arrays = measured()
    arrays['time'][500:] += 10
    arrays['effort'][:250, 0] = np.nan
    summary = describe(judged(arrays))
    assert (summary.samples, summary.used) == (1000, 1000)
    assert (summary.start, summary.end) == (0, pytest.approx(11.998))
    assert summary.duration == pytest.approx(2 * 0.998)
    assert summary.rate == pytest.approx(500)
    assert [part.samples for part in summary.segments] == [500, 500]
    first = summary.drives['slide_1']
    assert first.measured == 0.75
    assert first.position == (arrays['position'][:, 0].min(), arrays['position'][:, 0].max())
    assert first.effort == (arrays['effort'][250:, 0].min(), arrays['effort'][250:, 0].max())
    assert {finding.kind for finding in summary.findings} == {'gap', 'effort_not_measured'}
    bare = describe(judged({**arrays, 'velocity': None, 'effort': None}))
    assert bare.drives['lift_3'].velocity is None
    assert bare.drives['lift_3'].effort is None


def test_findings_are_one_sentence_each() -> None:
    arrays = measured()
    arrays['effort'][:, 0], arrays['position'][4, 0] = np.nan, np.nan
    arrays['time'][500:] -= 0.5
    texts = [finding.text for finding in judged(arrays).findings]
    assert len(texts) == 4
    for text in texts:
        assert '\n' not in text
        assert any(text.endswith(f'; {action}') for action in POLICY.values())


def test_arrays_that_do_not_fit_are_refused() -> None:
    arrays = measured(30)
    with pytest.raises(MotionError, match=r'effort: its shape is \(29, 6\)'):
        judged({**arrays, 'effort': arrays['effort'][1:]})
    with pytest.raises(MotionError, match='no sample is finite'):
        judged({**arrays, 'time': np.full(30, np.nan)})


def test_an_encapsulation_of_another_kind_has_no_layout() -> None:
    data = bytes(STORE.serialize_cdr(message(7, DRIVES, *np.ones((3, 6))), STATE))
    assert Layout.of(data) is not None
    assert Layout.of(b'\x00\x07' + data[2:]) is None
    assert Layout.of(data[:-1]) is None
    assert Layout.of(data[:12] + struct.pack('<I', 2**31) + data[16:]) is None
