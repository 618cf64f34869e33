# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Tables as other programs write them, each against the arrays that were written."""

from __future__ import annotations

import gzip
import json
import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from pprs_dynamics import DriveModel, ModelError
from pprs_dynamics.drives import RecordedDrives
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.recording import Recording, read_recording, write_recording
from pprs_dynamics.physics.model.recorded_names import recorded_columns

JOINTS = ('j1', 'j2', 'j3')
N, STEP = 300, 0.01
EPOCH = 1_700_000_000
TIME = np.arange(N) * STEP
POSITION = np.sin(TIME[:, None] * [1.0, 1.3, 1.7])
VELOCITY = np.cos(TIME[:, None] * [1.0, 1.3, 1.7]) * [1.0, 1.3, 1.7]
EFFORT = 3.0 * np.cos(TIME[:, None] * [2.0, 0.7, 1.1]) + [0.1, 0.2, 0.3]


def read(path: Path, keys: dict[str, Any]) -> Recording:
    """Read with what stands below `columns` of a model file."""
    columns = recorded_columns({f'columns.{key}': value for key, value in keys.items()}, JOINTS)
    return read_recording(path, RecordedDrives(JOINTS, columns=columns))


def assert_read(recording: Recording, tolerance: float = 1e-9) -> None:
    np.testing.assert_allclose(recording.time - recording.time[0], TIME, atol=tolerance)
    np.testing.assert_allclose(recording.position, POSITION, atol=tolerance)
    np.testing.assert_allclose(recording.effort, EFFORT, atol=tolerance)


def numbered(*blocks: str, first: int = 2) -> dict[str, Any]:
    """Return columns of blocks of three that stand one after another."""
    return {f'{joint}.{quantity}': first + 3 * b + k
            for b, quantity in enumerate(blocks) for k, joint in enumerate(JOINTS)}


def text(array: np.ndarray, separator: str = ',', header: str = '') -> str:
    return header + '\n'.join(separator.join(map(repr, row)) for row in array.tolist()) + '\n'


WHOLE = np.column_stack([TIME, POSITION, EFFORT])
ALL = {'time': 1, **numbered('position', 'effort')}
NAMED = {'time': 't', **{f'{joint}.{quantity}': f'{short}{k}' for k, joint in enumerate(JOINTS)
                         for quantity, short in (('position', 'q'), ('effort', 'tau'))}}
HEADER = 't,' + ','.join(f'q{k}' for k in range(3)) + ',' + ','.join(f'tau{k}' for k in range(3))
DATES, LATE = ([datetime.fromtimestamp(start + t, UTC).isoformat() for t in TIME]
               for start in (EPOCH, 86400 - STEP))
TEXTS: dict[str, tuple[str, dict[str, Any]]] = {
    'no header': (text(WHOLE), ALL),
    'blanks between': (text(WHOLE, '   '), ALL),
    'tabs': (text(WHOLE, '\t'), ALL),
    'decimal comma': (text(WHOLE, ';').replace('.', ','), {**ALL, 'decimal': ','}),
    'numbers with a header': (text(WHOLE, header='some,words,that,no,one,can,spell\n'), ALL),
    'header of numpy': ('# ' + text(WHOLE, header=HEADER + '\n'), NAMED),
    'sep of a spreadsheet': ('sep=;\n' + text(WHOLE, ';', HEADER.replace(',', ';') + '\n'), NAMED),
    'no time': (text(WHOLE[:, 1:]), {'rate': 1 / STEP, **numbered('position', 'effort', first=1)}),
    'milliseconds': (text(WHOLE * ([1e3] + 6 * [1])), {**ALL, 'time_scale': 1e-3}),
    **{kind: ('\n'.join([HEADER, *(','.join([date, *map(repr, row)]) for date, row in zip(
        dates, WHOLE[:, 1:].tolist(), strict=True))]), NAMED) for kind, dates in (
            ('ISO 8601', DATES), ('over midnight', [clock[11:] for clock in LATE]))},
    'time alone is called otherwise': (text(WHOLE, header='stamp,' + ','.join(
        f'{joint}/{quantity}' for quantity in ('position', 'effort') for joint in JOINTS) + '\n'),
        {'time': 'stamp'}),
}


@pytest.mark.parametrize(('content', 'keys'), TEXTS.values(), ids=TEXTS)
def test_a_csv_of_any_program_is_read(content: str, keys: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / 'run.csv').write_text(content)
    assert_read(read(tmp_path / 'run.csv', keys), 1e-6 if keys.get('time') == 't' else 1e-9)


@pytest.mark.parametrize(('per_second', 'word'), [
    (1e3, 'milliseconds'), (1e6, 'microseconds'), (1e9, 'nanoseconds')])
def test_stamps_since_1970_are_told_by_their_size(
    per_second: float, word: str, tmp_path: Path,
) -> None:
    stamps = EPOCH * int(per_second) + np.rint(TIME * per_second).astype(np.int64)
    pd.DataFrame(WHOLE[:, 1:]).assign(stamp=stamps).to_csv(
        tmp_path / 'run.csv', index=False, columns=['stamp', *range(6)])
    recording = read(tmp_path / 'run.csv', ALL)
    assert_read(recording, 1e-6)
    assert recording.epoch == EPOCH
    kinds = {finding.kind: finding.text for finding in recording.findings}
    assert 'epoch_unit' in kinds
    assert kinds['epoch_unit'] == f'the stamps count {word} since 1970; they are read so'
    pd.DataFrame(WHOLE[:, 1:]).rename(columns=str).assign(
        stamp=stamps).to_parquet(tmp_path / 'run.parquet')
    keys = {'time': 'stamp', **{f'{joint}.{quantity}': str(3 * b + k) for b, quantity in enumerate(
        ('position', 'effort')) for k, joint in enumerate(JOINTS)}}
    assert_read(read(tmp_path / 'run.parquet', keys), 1e-9)  # whole numbers lose nothing


@pytest.mark.parametrize(('up', 'per_second'), [
    (3600, 1e9), (30, 1e9), (432000, 1e6), (20, 1e3)])  # since an hour, in nanoseconds, ...
def test_stamps_since_a_machine_started_are_no_dates(
    up: float, per_second: float, tmp_path: Path,
) -> None:
    pd.DataFrame(WHOLE[:, 1:]).assign(
        stamp=np.rint((up + TIME) * per_second).astype(np.int64)).to_csv(
        tmp_path / 'run.csv', index=False, columns=['stamp', *range(6)])
    kinds = {finding.kind: finding.text for finding in read(tmp_path / 'run.csv', ALL).findings}
    assert 'epoch_unit' not in kinds
    assert f'only one sample in {np.median(np.diff(TIME)) * per_second:.4g} s' in kinds['slow_rate']


def test_velocities_have_a_scale_of_their_own(tmp_path: Path) -> None:
    table = np.column_stack([TIME, np.rad2deg(POSITION), VELOCITY, EFFORT])
    (tmp_path / 'run.csv').write_text(text(table))
    keys = {'time': 1, **numbered('position', 'velocity', 'effort'),
            **{f'{joint}.position_scale': np.pi / 180 for joint in JOINTS}}
    recording = read(tmp_path / 'run.csv', {**keys, **{
        f'{joint}.velocity_scale': 1.0 for joint in JOINTS}})
    assert_read(recording)
    np.testing.assert_allclose(recording.velocity, VELOCITY, atol=1e-12)
    # Without one, velocities of positions in degrees are in degrees, too.
    np.testing.assert_allclose(read(tmp_path / 'run.csv', keys).velocity,
                               np.deg2rad(VELOCITY), atol=1e-12)


def as_mat(folder: Path) -> tuple[Path, str, str, str]:
    savemat(folder / 'run.mat', {'rec': {
        't': TIME[:, None], 'act': {'pos': POSITION.T, 'trq': EFFORT}, 'note': 'a word'}})
    return folder / 'run.mat', 'rec.t', 'rec.act.pos', 'rec.act.trq'


def as_numpy(folder: Path) -> tuple[Path, str, str, str]:
    # As TimeSeries of mujoco.sysid saves itself: positions and efforts would be two of them.
    np.savez(folder / 'run.npz', times=TIME, data=POSITION, tau=EFFORT)
    return folder / 'run.npz', 'times', 'data', 'tau'


def as_parquet(folder: Path) -> tuple[Path, str, str, str]:
    pd.DataFrame({'timestamp': TIME, 'observation.state': list(POSITION),
                  'observation.effort': list(EFFORT)}).to_parquet(folder / 'run.parquet')
    return folder / 'run.parquet', 'timestamp', 'observation.state', 'observation.effort'


@pytest.mark.parametrize('write', [as_mat, as_numpy, as_parquet])
def test_elements_of_lists_and_fields_of_structures_are_columns(
    write: Callable[[Path], tuple[Path, str, str, str]], tmp_path: Path,
) -> None:
    path, time, position, effort = write(tmp_path)
    keys = {'time': time, **{f'{joint}.{quantity}': f'{name}[{k}]'
                             for quantity, name in (('position', position), ('effort', effort))
                             for k, joint in enumerate(JOINTS)}}
    assert_read(read(path, keys))
    with pytest.raises(UnreadableFileError, match=re.escape(f'{position}[0] to {position}[2]')):
        read(path, {**keys, 'j1.position': f'{position}[3]'})
    with pytest.raises(UnreadableFileError, match=re.escape(f'{effort}[0] to {effort}[2]')):
        read(path, {**keys, 'j1.effort': effort})
    with pytest.raises(UnreadableFileError, match=re.escape(f'did you mean {position}?')):
        read(path, {**keys, 'j1.position': f'{position}s'})


def lerobot(folder: Path) -> Path:
    (folder / 'meta').mkdir(parents=True)
    (folder / 'meta' / 'info.json').write_text(json.dumps({'features': {
        'observation.state': {'names': {'motors': list(JOINTS)}}, 'timestamp': {'names': None}}}))
    for episode in range(2):
        data = folder / 'data' / 'chunk-000'
        data.mkdir(parents=True, exist_ok=True)
        pd.DataFrame({'timestamp': TIME.astype(np.float32), 'observation.state': list(POSITION),
                      'observation.effort': list(EFFORT)}).to_parquet(
            data / f'episode_{episode:06}.parquet')
    return folder


def test_episodes_of_a_lerobot_dataset_are_stretches_of_one_recording(tmp_path: Path) -> None:
    keys = {'time': 'timestamp', **{f'{joint}.{quantity}': f'observation.{name}[{k}]'
                                    for quantity, name in (('position', 'state'),
                                                           ('effort', 'effort'))
                                    for k, joint in enumerate(JOINTS)}}
    recording = read(lerobot(tmp_path / 'set'), keys)
    assert len(recording.segments) == 2
    for part in recording.segments:
        np.testing.assert_allclose(recording.position[part], POSITION, atol=1e-9)
        np.testing.assert_allclose(recording.effort[part], EFFORT, atol=1e-9)


def written_apart(folder: Path, shift: float = 0.0, before: str = '') -> Path:
    """Write positions, efforts and, without a shift, times to files of their own."""
    (folder / f'{before}q.csv').write_text(text(
        np.column_stack([TIME, POSITION]) if shift else POSITION))
    (folder / f'{before}tau.csv').write_text(text(
        np.column_stack([TIME + shift, EFFORT]) if shift else EFFORT))
    (folder / f'{before}t.csv').write_text(text(TIME[:, None]))
    return folder


def test_one_file_a_quantity_is_one_recording(tmp_path: Path) -> None:
    keys = {'files.time': 't.csv', 'files.position': 'q.csv', 'files.effort': 'tau.csv',
            **{f'{joint}.{quantity}': k + 1 for quantity in ('position', 'effort')
               for k, joint in enumerate(JOINTS)}}
    folder = written_apart(tmp_path)
    assert_read(read(folder, keys))
    assert_read(read(folder / 'tau.csv', keys))
    (folder / 'other.csv').write_text('1\n')
    with pytest.raises(UnreadableFileError, match=r'match one of t\.csv, q\.csv, tau\.csv'):
        read(folder / 'other.csv', keys)
    with pytest.raises(UnreadableFileError, match=r'columns\.files\.effort names'):
        read(folder, {**keys, 'files.effort': 'torque.csv'})


def test_files_with_times_of_their_own_are_held_at_those_of_the_positions(tmp_path: Path) -> None:
    keys = {'time': 1, 'files.position': '*q.csv', 'files.effort': '*tau.csv',
            **{f'{joint}.{quantity}': k + 2 for quantity in ('position', 'effort')
               for k, joint in enumerate(JOINTS)}}
    written_apart(tmp_path, shift=-STEP / 2, before='second_')
    written_apart(tmp_path, shift=-STEP / 2, before='first_')
    recording = read(tmp_path / 'second_q.csv', keys)
    np.testing.assert_allclose(recording.effort[1:-1], (EFFORT[1:-1] + EFFORT[2:]) / 2, atol=1e-9)
    assert 'merged' in {finding.kind for finding in recording.findings}
    with pytest.raises(UnreadableFileError, match='2 files of the name'):
        read(tmp_path, keys)


NAMES = ['t', 'q0', 'q1', 'q2', 'tau0', 'tau1', 'tau2']  # of the columns of WHOLE


@pytest.mark.parametrize('twice', NAMES)
@pytest.mark.parametrize('suffix', ['.csv', '.parquet'])
def test_a_name_of_two_columns_is_asked_about(twice: str, suffix: str, tmp_path: Path) -> None:
    path, place = tmp_path / f'run{suffix}', NAMES.index(twice)
    both = np.column_stack([WHOLE[:, :place], 2 * WHOLE[:, place], WHOLE[:, place:]])
    names = [*NAMES[:place], twice, *NAMES[place:]]
    if suffix == '.csv':
        path.write_text(text(both, header=','.join(names) + '\n'))
    else:
        pyarrow, parquet = map(pytest.importorskip, ('pyarrow', 'pyarrow.parquet'))
        parquet.write_table(pyarrow.Table.from_arrays(
            [pyarrow.array(column) for column in both.T], names), path)
    with pytest.raises(UnreadableFileError, match=f"2 columns have the name '{twice}'"):
        read(path, NAMED)
    if suffix == '.csv':  # with the number of the right one, as the sentence says
        keys = {key: place + 2 if name == twice else name for key, name in NAMED.items()}
        assert_read(read(path, keys))


def test_a_name_of_two_columns_in_a_file_of_times_is_asked_about(tmp_path: Path) -> None:
    folder = written_apart(tmp_path)
    (folder / 't.csv').write_text(text(np.column_stack([TIME, 2 * TIME]), header='t,t\n'))
    keys = {'time': 't', 'files.time': 't.csv', 'files.position': 'q.csv',
            **{f'{joint}.position': k + 1 for k, joint in enumerate(JOINTS)}}
    with pytest.raises(UnreadableFileError, match="2 columns have the name 't'"):
        read(folder, keys)


@pytest.mark.parametrize('suffix', ['.gz', '.zst'])
def test_packed_tables_are_unpacked(suffix: str, tmp_path: Path) -> None:
    from rosbags.rosbag2.reader import zstd

    data = text(WHOLE).encode()
    path = tmp_path / f'run.csv{suffix}'
    path.write_bytes(gzip.compress(data) if suffix == '.gz' else zstd.compress(data))
    assert_read(read(path, ALL))


def test_currents_without_a_gain_and_a_gain_without_currents_are_told(tmp_path: Path) -> None:
    for quantity, gain, kind in (('current', 1.0, 'no_gain'), ('effort', 2.0, 'gain_unused'),
                                 ('current', 2.0, ''), ('effort', 1.0, '')):
        header = ','.join(['time', *(f'{joint}/position' for joint in JOINTS),
                           *(f'{joint}/{quantity}' for joint in JOINTS)])
        (tmp_path / 'run.csv').write_text(text(WHOLE, header=header + '\n'))
        recording = read_recording(tmp_path / 'run.csv', RecordedDrives(JOINTS, gain=(gain,) * 3))
        kinds = {finding.kind for finding in recording.findings}
        assert ('no_gain' in kinds) == (kind == 'no_gain')
        assert ('gain_unused' in kinds) == (kind == 'gain_unused')
        np.testing.assert_allclose(recording.effort, EFFORT * (
            gain if quantity == 'current' else 1.0), rtol=1e-12)


# Keys below `columns` turn the numbers of a file into SI units.

MOMENTS = np.arange(200) / 100
ANGLES = np.sin(MOMENTS[:, None] * [1.0, 2.0, 3.0])
LOADS = np.cos(MOMENTS[:, None] * [1.0, 2.0, 3.0])


def read_with(folder: Path, position: np.ndarray, effort: np.ndarray, lines: str,
              suffix: str = '.csv') -> Recording:
    path = arm.write_arm(folder)
    path.write_text(path.read_text() + lines)
    run = folder / f'run{suffix}'
    write_recording(run, Recording.from_arrays('run', MOMENTS, position, None, effort, arm.JOINTS))
    return read_recording(run, DriveModel.load(path).recorded)


@pytest.mark.parametrize('suffix', ['.csv', '.mcap'])
def test_encoder_ticks_whose_zero_is_in_the_middle(tmp_path: Path, suffix: str) -> None:
    ticks = np.round(ANGLES * 4096 / (2 * np.pi)) + 2048
    keys = f'{{position_scale: {2 * np.pi / 4096!r}, position_offset: {-np.pi!r}}}'
    found = read_with(tmp_path, ticks, LOADS, '    columns: {' + ', '.join(
        f'{joint}: {keys}' for joint in arm.JOINTS) + '}\n', suffix)
    np.testing.assert_allclose(found.position, ANGLES, atol=2 * np.pi / 4096)


def test_efforts_whose_sign_is_a_bit(tmp_path: Path) -> None:
    load = np.round(np.abs(LOADS) * 500) + 1024 * (LOADS < 0)
    found = read_with(tmp_path, ANGLES, load, '    columns: {' + ', '.join(
        f'{joint}: {{effort_sign_bit: 10, effort_scale: 0.002}}' for joint in arm.JOINTS) + '}\n')
    np.testing.assert_allclose(found.effort, LOADS, atol=1.1e-3)
    with pytest.raises(ModelError, match='effort_sign_bit is 0, must be the number of a bit'):
        read_with(tmp_path, ANGLES, load, '    columns: {turn: {effort_sign_bit: 0}}\n')


def test_a_unit_of_efforts_that_is_not_the_si_unit(tmp_path: Path) -> None:
    path = arm.write_arm(tmp_path)
    text = path.read_text()
    path.write_text(text.replace('      base: ', '      effort_unit: kgf cm\n      base: '))
    run = tmp_path / 'run.csv'
    write_recording(run, Recording.from_arrays(
        'run', MOMENTS, ANGLES, None, LOADS / 0.0980665, arm.JOINTS))
    found = read_recording(run, DriveModel.load(path).recorded)
    np.testing.assert_allclose(found.effort, LOADS)


@pytest.mark.parametrize('blank', ['', '\n'])
def test_a_table_below_a_preamble_with_a_line_of_units(blank: str, tmp_path: Path) -> None:
    path = arm.write_arm(tmp_path)
    columns = {joint: {'position': f'{joint} deg', 'effort': f'{joint} f N'}
               for joint in arm.JOINTS}
    path.write_text(path.read_text() + f'    columns: {{time: t s, {str(columns)[1:]}\n')
    run = tmp_path / 'run.csv'
    np.savetxt(run, np.column_stack([MOMENTS, ANGLES, LOADS]), delimiter=';', comments='',
               header='Log 7\nChannels;7\nRate;100;Hz\n' + ';'.join(
                   ['t', *arm.JOINTS, *(f'{joint} f' for joint in arm.JOINTS)]) + '\n'
               + ';'.join(['s', *['deg'] * 3, *['N'] * 3]) + blank)
    found = read_recording(run, DriveModel.load(path).recorded)
    np.testing.assert_allclose(found.position, ANGLES)
    np.testing.assert_allclose(found.effort, LOADS)


def test_a_time_of_day_of_digits_without_end_is_no_date(tmp_path: Path) -> None:
    content, keys = TEXTS['ISO 8601']
    rows = content.splitlines()
    rows[6] = f'12:{9**30},' + rows[6].partition(',')[2]
    (tmp_path / 'run.csv').write_text('\n'.join(rows))
    with pytest.raises(UnreadableFileError, match='row 7, column t must contain a number'):
        read(tmp_path / 'run.csv', keys)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize(('zone', 'offset'), [
    ('', 0), ('Z', 0), ('UTC', 0), ('+02:00', -7200), ('PST', 0), ('CET', 0)])
def test_dates_have_the_offset_that_they_state(zone: str, offset: int, tmp_path: Path) -> None:
    content, keys = TEXTS['ISO 8601']
    (tmp_path / 'run.csv').write_text(content.replace('T', ' ').replace('+00:00', f' {zone}'))
    recording = read(tmp_path / 'run.csv', keys)
    assert_read(recording, 1e-6)
    assert recording.epoch == EPOCH + offset
