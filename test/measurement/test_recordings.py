# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings: one reader for bags and CSV, and every file told that is none."""

from __future__ import annotations

import contextlib
import random
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import made_up_recordings as made
import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pprs_command import pprs
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin
from sensor_msgs.msg import JointState

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.joint_states import deserialized
from pprs_dynamics.measurement.files.merged_states import States
from pprs_dynamics.measurement.files.recording import (
    Recording,
    describe,
    read_recording,
    write_recording,
)
from pprs_dynamics.measurement.files.repeats import shared_samples

# ---------------------------------------------------------------------------------- formats


def by_rosbags(storage: StoragePlugin) -> Callable[[Path, made.Arrays], Path]:
    return lambda folder, arrays: made.write_plain_bag(
        folder / 'bag', {'/pprs/joint_states': made.states_of(arrays)}, storage)


def by_pandas(folder: Path, arrays: made.Arrays) -> Path:
    made.table(arrays).to_csv(folder / 'pandas.csv', index=False)
    return folder / 'pandas.csv'


WRITERS = {**{f'own{suffix}': made.by_own_writer(suffix) for suffix in made.SUFFIXES},
           'rosbags_mcap': by_rosbags(StoragePlugin.MCAP),
           'rosbags_sqlite3': by_rosbags(StoragePlugin.SQLITE3), 'pandas': by_pandas}


@pytest.mark.parametrize('write', WRITERS.values(), ids=WRITERS)
def test_every_writer_gives_the_same_arrays_and_nothing_to_tell(
    write: Callable[[Path, made.Arrays], Path], tmp_path: Path,
) -> None:
    arrays = made.measured(700)
    recording = read_recording(write(tmp_path, arrays))
    made.assert_same(recording, arrays)
    assert recording.findings == ()
    assert recording.segments == (slice(0, 700),)
    assert recording.drives == DRIVES


@pytest.mark.parametrize('suffix', ['.mcap', '.db3', ''])
def test_bags_keep_nanoseconds_of_a_clock_that_counts_from_1970(
    suffix: str, tmp_path: Path,
) -> None:
    arrays = made.measured(300)
    stamps = 1_763_000_123_456_789_123 + made.STEP_NS * np.arange(300)
    source = made.write_plain_bag(tmp_path / 'source', {
        '/joint_states': [made.message(int(stamp), DRIVES, *(
            arrays[name][k] for name in made.QUANTITIES)) for k, stamp in enumerate(stamps)]})
    recording = read_recording(source)
    assert recording.epoch == 1_763_000_123
    # As floats of seconds since 1970 they would be 120 ns off.
    np.testing.assert_array_equal(np.rint(1e9 * recording.time).astype(int),
                                  stamps - 1_763_000_123 * 10**9)
    write_recording(tmp_path / f'copy{suffix}', recording)
    copy = read_recording(tmp_path / f'copy{suffix}')
    assert copy.epoch == recording.epoch
    np.testing.assert_array_equal(copy.time, recording.time)


@settings(max_examples=40,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(values=st.lists(st.floats(-1e3, 1e3), min_size=25, max_size=60, unique=True),
       steps=st.floats(1e-4, 0.3))
def test_a_csv_keeps_every_bit(tmp_path: Path, values: list[float], steps: float) -> None:
    time = 0.1 + steps * np.arange(len(values))
    effort = np.array(values)[:, None]
    recording = Recording.from_arrays('x', time, np.sin(time)[:, None], effort / 7, effort,
                                      ('axis',))
    write_recording(tmp_path / 'x.csv', recording)
    made.assert_same(read_recording(tmp_path / 'x.csv', ('axis',)),
                {'time': time, 'position': np.sin(time)[:, None], 'velocity': effort / 7,
                 'effort': effort})


# ------------------------------------------------------------------------------------- bags


def test_drives_are_found_by_name_among_other_joints_in_any_order(tmp_path: Path) -> None:
    arrays = made.measured(600)
    names = ('gripper', *DRIVES[::-1], 'door')
    wide = {name: np.column_stack((np.ones(600), arrays[name][:, ::-1], np.zeros(600)))
            for name in made.QUANTITIES}
    path = made.write_plain_bag(tmp_path / 'bag', {
        '/joint_states': made.states_of({'time': arrays['time'], **wide}, names)})
    recording = read_recording(path)
    made.assert_same(recording, arrays)
    assert made.the(recording, 'ignored_joints').count == 2
    assert 'door, gripper' in made.the(recording, 'ignored_joints').text


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), orders=st.integers(1, 40), big_endian=st.booleans())
def test_collected_messages_agree_with_rosbags(seed: int, orders: int, big_endian: bool) -> None:
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
                  for _ in made.QUANTITIES]
        state = made.message(shuffle.randrange(2**31 * 10**9), names, *arrays)
        little = not (big_endian and k % 3 == 0)
        data.append(bytes(made.STORE.serialize_cdr(state, made.STATE, little_endian=little)))
    blocks = States(DRIVES)
    for k, raw in enumerate(data):
        blocks.add('/a', made.STATE, deserialized(made.STORE, raw, made.STATE), k)
    states = [made.STORE.deserialize_cdr(raw, made.STATE) for raw in data]
    whole = [k for k, state in enumerate(states)
             if {*DRIVES} <= {*state.name} and len(state.position) == len(state.name)]
    stamps, columns, _ = blocks.together(blocks.signals('/a', Path()))
    assert stamps.tolist() == [states[k].header.stamp.sec * 10**9 + states[k].header.stamp.nanosec
                               for k in whole]
    for quantity in made.QUANTITIES:
        found = np.stack([columns[drive, quantity] for drive in DRIVES], axis=1)
        values = [getattr(states[k], quantity) for k in whole]
        np.testing.assert_array_equal(found, np.array([
            [numbers[list(states[k].name).index(drive)] for drive in DRIVES] if len(numbers) else
            [np.nan] * 6 for k, numbers in zip(whole, values, strict=True)]).reshape(-1, 6))


@pytest.mark.parametrize('absent', [(), ('velocity',), ('effort',), ('velocity', 'effort')])
@pytest.mark.parametrize('frame', ['', 'base'])
def test_bytes_of_ros_itself_are_understood(absent: tuple[str, ...], frame: str) -> None:
    # rmw_fastrtps leaves bytes behind the message where a sequence is empty.
    values = {name: [] if name in absent else [1.5, -2.5, 3.5] for name in made.QUANTITIES}
    state = JointState(name=['b', 'other', 'a'], **values)
    state.header.stamp.sec, state.header.stamp.nanosec = 12, 345
    state.header.frame_id = frame
    blocks = States(('a', 'b'))
    blocks.add('/a', made.STATE, deserialized(made.STORE, serialize_message(state), made.STATE), 0)
    stamps, columns, _ = blocks.together(blocks.signals('/a', Path()))
    assert stamps.tolist() == [12 * 10**9 + 345]
    for name in made.QUANTITIES:
        expected = [] if name in absent else [3.5, 1.5]
        assert [columns[joint, name] for joint in 'ab' if (joint, name) in columns] == expected


@settings(max_examples=200)
@given(data=st.binary(max_size=200), start=st.booleans())
def test_no_bytes_break_the_reader_of_messages(data: bytes, start: bool) -> None:
    raw = b'\x00\x01\x00\x00' + data if start else data
    state = deserialized(made.STORE, raw, made.STATE)
    assert state is None or not (len(state.position) and {*DRIVES} <= {*state.name})


def test_messages_without_all_drives_are_ignored_and_told(tmp_path: Path) -> None:
    arrays = made.measured(60)
    states = made.states_of(arrays)
    half = [made.message(k, DRIVES[:3], np.ones(3), [], []) for k in range(20)]
    mixed = [state for pair in zip(states, half, strict=False) for state in pair] + states[20:]
    recording = read_recording(made.write_plain_bag(tmp_path / 'bag', {'/joint_states': mixed}))
    made.assert_same(recording, arrays)
    assert made.the_one(recording, 'incomplete_messages').count == 20


@pytest.mark.parametrize('offset', [None, 0.02, 0.5])
def test_two_publishers_on_one_topic_are_no_recording(offset: float | None, tmp_path: Path) -> None:
    arrays = made.measured(200)
    other = made.measured(200, seed=1)['position'] + offset if offset else np.zeros((200, 6))
    mixed = [state for pair in zip(made.states_of(arrays), made.states_of(
        arrays, time=arrays['time'] + 0.0007, position=other), strict=True) for state in pair]
    with pytest.raises(UnreadableFileError, match='two nodes publish there'):
        read_recording(made.write_plain_bag(tmp_path / 'bag', {'/joint_states': mixed}))


def test_a_message_that_names_a_drive_twice_is_not_used(tmp_path: Path) -> None:
    arrays = made.measured(60)
    double = [made.message(1, [*DRIVES, DRIVES[0]], np.ones(7), np.ones(7), np.ones(7))] * 20
    mixed = read_recording(made.write_plain_bag(
        tmp_path / 'mixed', {'/joint_states': [*made.states_of(arrays), *double]}))
    made.assert_same(mixed, arrays)
    assert made.the_one(mixed, 'incomplete_messages').count == 20
    with pytest.raises(UnreadableFileError, match=f'name {DRIVES[0]} twice'):
        read_recording(made.write_plain_bag(tmp_path / 'double', {'/joint_states': double}))


def test_several_topics_of_joint_states_must_be_chosen_from(tmp_path: Path) -> None:
    left, right = made.measured(50, seed=1), made.measured(50, seed=2)
    path = made.write_plain_bag(tmp_path / 'bag', {
        '/left/joint_states': made.states_of(left), '/right/joint_states': made.states_of(right),
        '/silent/joint_states': [], '/left/wanted': made.states_of(left)})
    with pytest.raises(UnreadableFileError, match='/left/joint_states, /right/joint_st') as told:
        read_recording(path)
    assert 'silent' not in str(told.value)
    made.assert_same(read_recording(path, topic='/right/joint_states'), right)
    made.assert_same(read_recording(path, topic='left/wanted'), left)
    with pytest.raises(UnreadableFileError, match='no sensor_msgs/JointState on /nowhere'):
        read_recording(path, topic='/nowhere')
    with pytest.raises(UnreadableFileError, match='no messages'):
        read_recording(path, topic='/silent/joint_states')


def test_header_stamps_of_0_are_replaced_by_times_of_recording(tmp_path: Path) -> None:
    arrays = made.measured(600)
    states = made.states_of(arrays, time=np.zeros(600))
    recording = read_recording(made.write_plain_bag(tmp_path / 'bag', {'/joint_states': states}))
    made.assert_same(recording, arrays)
    assert made.the(recording, 'receive_times').count == 600


def test_bags_are_not_overwritten_and_files_are_replaced(tmp_path: Path) -> None:
    first, second = made.measured(100, seed=1), made.measured(50, seed=2)
    for suffix in ('.csv', '.mcap', '.db3'):
        for arrays in (first, second):
            write_recording(tmp_path / f'x{suffix}', made.judged(arrays))
        made.assert_same(read_recording(tmp_path / f'x{suffix}'), second)
    write_recording(tmp_path / 'bag', made.judged(first))
    with pytest.raises(UnreadableFileError, match='exists already'):
        write_recording(tmp_path / 'bag', made.judged(second))
    made.assert_same(read_recording(tmp_path / 'bag'), first)
    assert sorted(file.name for file in tmp_path.iterdir()) == ['bag', 'x.csv', 'x.db3', 'x.mcap']


# -------------------------------------------------------------------------------------- CSV


TEXTS: dict[str, Callable[[str], str]] = {
    'byte order mark': lambda text: '\ufeff' + text,
    'semicolons': lambda text: text.replace(',', ';'),
    'quotes': lambda text: re.sub(r'[^,\n]+', r'"\g<0>"', text),
    'empty lines': lambda text: text.replace('\n', '\n\n') + '\n \n',
    'no last line end': lambda text: text.rstrip('\n'),
    'time of PlotJuggler': lambda text: text.replace('time', '__time'),
}


@pytest.mark.parametrize('change', TEXTS.values(), ids=TEXTS)
def test_csv_dialects_are_read_alike(change: Callable[[str], str], tmp_path: Path) -> None:
    arrays = made.measured(40)
    arrays['effort'][3:5] = np.nan
    arrays['effort'][7, 5] = np.nan
    text = change(made.table(arrays).to_csv(index=False))
    (tmp_path / 'x.csv').write_bytes(text.encode())
    made.assert_same(read_recording(tmp_path / 'x.csv'), arrays)


def test_other_columns_are_ignored_and_told_even_where_they_hold_words(tmp_path: Path) -> None:
    arrays = made.measured(40)
    columns = made.table(arrays)
    columns.insert(0, 'phase', ['up, and "down"'] * 40)
    columns['gripper/position'] = 1.0
    columns.to_csv(tmp_path / 'x.csv')
    recording = read_recording(tmp_path / 'x.csv')
    made.assert_same(recording, arrays)
    finding = made.the_one(recording, 'ignored_columns')
    assert finding.count == 3
    assert all(name in finding.text for name in ('(no name)', 'phase', 'gripper/position'))


def test_rows_that_belong_to_other_topics_leave_the_motion_as_it_is(tmp_path: Path) -> None:
    # PlotJuggler writes all series into one table, a row per stamp of any of them.
    arrays = made.measured(600)
    columns = made.table(arrays)
    other = pd.DataFrame({'time': arrays['time'] + made.STEP / 3, 'battery': 1.0})
    pd.concat([columns, other]).sort_values('time').to_csv(tmp_path / 'x.csv', index=False)
    recording = read_recording(tmp_path / 'x.csv')
    made.assert_same(recording, arrays)
    assert made.the_one(recording, 'non_finite_position').count == 600
    assert made.kinds(recording) == {'non_finite_position', 'ignored_columns'}


MISTAKES = {
    'no time': (lambda text: text.replace('time', 'zeit', 1), 'must contain time'),
    'no drive': (lambda text: text.replace('lift_2', 'hub_2'), 'no lift_2/position; .*hub_2'),
    'an underscore': (lambda text: re.sub(r'\n0.01,[^,]*', '\n0.01,1_0', text),
                      'row 7, column slide_1/position must contain'),
    'a digit of another script': (lambda text: re.sub(r'\n0.01,[^,]*', '\n0.01,\u0663', text),
                                  'row 7, column slide_1/position must contain'),
    'a word below a cell without a value': (
        lambda text: text.replace('\n0.01,', '\nsoon,').replace('\n0.008,', '\nN/A,'),
        "row 7, column time .*'soon'"),
    'a decimal comma': (
        lambda text: text.replace(',', ';').replace('\n0.01;', '\n0,01;'), 'decimal comma'),
    'a short row': (lambda text: text[:-40], 'row 41 contains 13 cells, but the header 19'),
    'a column twice': (lambda text: text.replace('lift_1/velocity', 'lift_1/position'),
                       "2 columns have the name 'lift_1/position'"),
    'no position anywhere': (lambda text: re.sub(r'(?m)^([0-9][^,]*),[^,]*', r'\1,', text),
                             'none of its 40 samples'),
}


@pytest.mark.parametrize(('change', 'words'), MISTAKES.values(), ids=MISTAKES)
def test_mistakes_in_a_csv_are_one_sentence_with_the_place(
    change: Callable[[str], str], words: str, tmp_path: Path,
) -> None:
    arrays = {name: values.round(3) for name, values in made.measured(40).items()}
    (tmp_path / 'x.csv').write_text(change(made.table(arrays).to_csv(index=False)))
    with pytest.raises(UnreadableFileError, match=words) as told:
        read_recording(tmp_path / 'x.csv')
    assert '\n' not in str(told.value)
    assert str(told.value).startswith(str(tmp_path / 'x.csv'))


# ---------------------------------------------------------------------------- foreign files


def damaged(suffix: str, share: float) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = made.by_own_writer(suffix)(folder, made.measured(5000))
        path.write_bytes(path.read_bytes()[:int(share * path.stat().st_size)])
        return path
    return make


def content(name: str, data: bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name
    return make


def without_joint_states(folder: Path) -> Path:
    text = made.STORE.types['std_msgs/msg/String']('hello')
    return made.write_plain_bag(folder / 'bag', {'/joint_states': [
        bytes(made.STORE.serialize_cdr(text, text.__msgtype__))]}, msgtype=text.__msgtype__)


def empty_folder(folder: Path) -> Path:
    (folder / 'empty').mkdir()
    return folder / 'empty'


def other_metadata(folder: Path) -> Path:
    return content('metadata.yaml', b'a: [1')(folder).parent


NOISE = random.Random(5).randbytes(4000)
JPEG = b'\xff\xd8\xff\xe0\x00\x10JFIF\x00\x01' + NOISE
FOREIGN = {
    'missing': lambda folder: folder / 'nothing.csv',
    **{f'{kind}{suffix}': content(f'x{suffix}', data) for kind, data in (
        ('noise', NOISE), ('jpeg', JPEG), ('empty', b''), ('zeros', bytes(999)))
       for suffix in ('.csv', '.mcap', '.db3', '.npz', '.mat', '.parquet', '.csv.zst')},
    'text': content('x.csv', b'Dear robot,\nhow are you?\n'),
    'UTF-16': content('x.csv', 'time,axis/position\n1,2\n'.encode('utf-16')),
    'noise after rows': content('x.csv', b'time,' + b','.join(
        f'{drive}/position'.encode() for drive in DRIVES) + b'\n0,1,2,3,4,5,6\n' + NOISE),
    **{f'{share} of {suffix}': damaged(suffix, share) for suffix in ('.mcap', '.db3')
       for share in (0.0001, 0.5, 0.9999)},
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


@settings(max_examples=60,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1), value=st.integers(1, 255), suffix=st.sampled_from(['.mcap', '.db3']))
@example(share=0.8071297632369854, value=1, suffix='.mcap')  # the seconds of a stamp
def test_a_changed_byte_in_a_bag_is_an_error_of_ours_or_none(
    tmp_path: Path, share: float, value: int, suffix: str,
) -> None:
    path = made.by_own_writer(suffix)(tmp_path, made.measured(60))
    data = bytearray(path.read_bytes())
    data[int(share * (len(data) - 1))] ^= value
    path.write_bytes(data)
    recording = None
    with contextlib.suppress(UnreadableFileError):
        recording = read_recording(path)
    # Bytes of values are data like any other, but a recording is one nevertheless.
    if recording is not None:
        assert 0 < len(recording.time) <= 60
        assert np.isfinite(recording.time).all()
        # A stamp may be the byte: the clock is then set back there, between two segments.
        for segment in recording.segments:
            assert (np.diff(recording.time[segment]) > 0).all()
        assert recording.position.shape == recording.effort.shape == (len(recording.time), 6)
        assert np.isfinite(recording.position).all()


# ------------------------------------------------------------------------------ description


def test_a_recording_is_described_by_its_rates_ranges_and_findings() -> None:
    arrays = made.measured()
    arrays['time'][500:] += 10
    arrays['effort'][:250, 0] = np.nan
    summary = describe(made.judged(arrays))
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
    bare = describe(made.judged({**arrays, 'velocity': None, 'effort': None}))
    assert bare.drives['lift_3'].velocity is None
    assert bare.drives['lift_3'].effort is None


# ------------------------------------------------------------- rows that are no rows of a table


def rows_with(tmp_path: Path, change: Callable[[list[str]], None]) -> Path:
    """Write 4000 rows with a last column of words that nobody asked for, some changed."""
    lines = made.table(made.measured(4000)).assign(note='ok').to_csv(index=False).split('\n')
    change(lines)
    (tmp_path / 'x.csv').write_text('\n'.join(lines))
    return tmp_path / 'x.csv'


@pytest.mark.parametrize('others', [(), (2500,)])
def test_a_quote_without_its_pair_loses_no_row_in_silence(
    others: tuple[int, ...], tmp_path: Path,
) -> None:
    def spoil(lines: list[str]) -> None:
        for row in (2002, *others):
            lines[row - 1] = lines[row - 1].replace('ok', '"5 inch pipe')

    with pytest.raises(UnreadableFileError, match='row 2002 has a quote'):
        read_recording(rows_with(tmp_path, spoil))


@pytest.mark.parametrize('word', ['5" pipe', '"5"" pipe"', 'a\u2028b'])
def test_words_of_ignored_columns_take_no_row_away(word: str, tmp_path: Path) -> None:
    def write(lines: list[str]) -> None:
        lines[2001] = lines[2001].replace('ok', word)

    assert len(read_recording(rows_with(tmp_path, write)).time) == 4000


# The same samples under two names: told by info, refused where they would count twice.

@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('repeats')
    run = made.judged(made.measured())
    for name in ('run.csv', 'copy.csv', 'same.mcap', 'same.db3'):
        write_recording(folder / name, run)
    write_recording(folder / 'other.csv', made.judged(made.measured(seed=1)))
    return folder


def part_of(recording: Recording, samples: slice) -> Recording:
    return Recording.from_arrays('part', recording.time[samples], recording.position[samples],
                                 None, recording.effort[samples])


@pytest.mark.parametrize('name', ['copy.csv', 'same.mcap', 'same.db3'])
def test_the_same_samples_in_another_file_or_format_are_found(folder: Path, name: str) -> None:
    first, second = read_recording(folder / 'run.csv'), read_recording(folder / name)
    assert shared_samples(first, second) == len(second.time)


def test_clocks_and_cuts_hide_nothing(folder: Path) -> None:
    run = read_recording(folder / 'run.csv')
    later = replace(run, time=run.time + 5.0, epoch=1_700_000_000)
    assert shared_samples(run, later) == len(run.time)
    assert shared_samples(run, part_of(run, slice(200, 500))) == 300
    assert shared_samples(part_of(run, slice(200, 500)), run) == 300


def test_the_same_motion_with_other_noise_is_another_recording(folder: Path) -> None:
    run, other = read_recording(folder / 'run.csv'), read_recording(folder / 'other.csv')
    assert shared_samples(run, other) == 0
    noise = np.random.default_rng(3).normal(0, 0.01, run.effort.shape)
    assert shared_samples(run, replace(run, effort=run.effort + noise)) == 0
    # The two halves of one recording share nothing.
    assert shared_samples(part_of(run, slice(0, 500)), part_of(run, slice(500, 1000))) == 0


def test_recordings_of_a_robot_at_rest_are_alike_and_no_repeats() -> None:
    time = np.arange(500) * 0.002
    still = np.full((500, 6), 0.1)
    first, other = (Recording.from_arrays(name, time, still, None, np.ones((500, 6)))
                    for name in 'ab')
    assert shared_samples(first, other) == 0


def test_info_says_what_repeats(folder: Path) -> None:
    done = pprs('info', 'run.csv', 'same.db3', cwd=folder)
    assert done.returncode == 0
    assert ('! same.db3: all of its 1000 samples are those of run.csv, too'
            in ' '.join(done.stdout.split()))
