# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Files that would take gigabytes, and columns that are no single ones, are one sentence."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from pprs_dynamics.drives import DriveColumns, RecordedColumns, RecordedDrives
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files import array_files, csv_files
from pprs_dynamics.measurement.files.fingerprint import fingerprint
from pprs_dynamics.measurement.files.recording import read_recording

pyarrow = pytest.importorskip('pyarrow')
parquet = pytest.importorskip('pyarrow.parquet')
NAMED = RecordedDrives(('j',), columns=RecordedColumns(
    time='t', drives={'j': DriveColumns({'position': 'q', 'effort': 'tau'})}))
N = 4000
ARRAYS = {'t': np.arange(N) * 0.01, 'q': np.zeros(N), 'tau': np.zeros(N)}


def write(path: Path) -> Path:
    if path.suffix == '.npz':
        np.savez_compressed(path, **ARRAYS)
    elif path.suffix == '.mat':
        savemat(path, ARRAYS, do_compression=True)
    elif path.suffix == '.parquet':
        parquet.write_table(pyarrow.table(ARRAYS), path)
    else:
        rows = '\n'.join(f'{k / 100},0.0,0.0' for k in range(N))
        path.write_bytes(gzip.compress(f't,q,tau\n{rows}\n'.encode()))
    return path


@pytest.mark.parametrize('name', ['run.npz', 'run.mat', 'run.parquet', 'run.csv.gz'])
def test_a_file_of_more_than_is_read_is_refused_before(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = write(tmp_path / name)
    assert len(read_recording(path, NAMED).time) == N
    monkeypatch.setattr(array_files, 'LARGEST', 20_000)
    monkeypatch.setattr(csv_files, 'LARGEST_UNPACKED', 20_000)
    for reader in ('load', 'savez'):
        monkeypatch.setattr(np, reader, None)
    with pytest.raises(UnreadableFileError, match='GB'):
        read_recording(path, NAMED)


def test_a_gzip_file_that_hides_its_length_is_refused_on_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = write(tmp_path / 'run.csv.gz')
    path.write_bytes(path.read_bytes() + gzip.compress(b''))
    monkeypatch.setattr(csv_files, 'LARGEST_UNPACKED', 20_000)
    with pytest.raises(UnreadableFileError, match='unpacks to more than'):
        read_recording(path, NAMED)


def test_a_parquet_with_a_damaged_name_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / 'run.parquet'
    parquet.write_table(pyarrow.table({'t': [0.0], 'quux': [0.0]}), path)
    path.write_bytes(path.read_bytes().replace(b'quux', b'qu\xc0x'))
    with pytest.raises(UnreadableFileError, match=r'run\.parquet'):
        read_recording(path, NAMED)


def test_a_mat_file_with_a_false_size_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / 'run.mat'
    savemat(path, {'d': {'t': ARRAYS['t']}})
    content = path.read_bytes()
    at = content.index(np.array([1, 1], dtype='<i4').tobytes(), 128)
    path.write_bytes(content[:at] + np.array([1, 788529153], '<i4').tobytes() + content[at + 8:])
    with pytest.raises(UnreadableFileError, match='GB'):
        read_recording(path, NAMED)


def test_no_pipe_and_no_device_has_a_fingerprint(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / 'pipe')
    for path in (tmp_path / 'pipe', Path('/dev/zero')):
        with pytest.raises(UnreadableFileError, match='must be a file'):
            fingerprint(path)


def test_complex_numbers_are_no_measurements(tmp_path: Path) -> None:
    path = tmp_path / 'run.mat'
    savemat(path, {**ARRAYS, 'q': ARRAYS['q'] + 1j})
    with pytest.raises(UnreadableFileError, match='q'):
        read_recording(path, NAMED)
