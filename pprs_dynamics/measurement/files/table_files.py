# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Tables of any program, CSV, Parquet or MAT, by the columns that a model file names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import RecordedColumns
from pprs_dynamics.errors import MissingLibraryError, UnreadableFileError
from pprs_dynamics.measurement.files.csv_files import named_columns, read_csv, require_columns
from pprs_dynamics.measurement.files.samples import Progress, Samples

PARQUET, MAT = ('.parquet', '.pq'), ('.mat',)


def read_table(path: Path, drives: tuple[str, ...], columns: RecordedColumns,
               progress: Progress | None = None) -> Samples:
    """Read a table by its own names.

    Parameters
    ----------
    path : Path
        .parquet, .mat (up to version 7.2), or anything else as CSV.
    drives : tuple of D str
    columns : RecordedColumns
    progress : callable, optional
        Called with (done, total) now and then.

    Raises
    ------
    UnreadableFileError
        Where it is no such table, or lacks a column.
    MissingLibraryError
        For Parquet without pyarrow.
    """
    samples = (_of_arrays(path, drives, columns) if path.suffix in (*PARQUET, *MAT)
               else read_csv(path, drives, progress=progress, names=columns))
    scale = np.array([columns.drives[drive].position_scale for drive in drives])
    velocity = samples.velocity
    return replace(
        samples, position=samples.position * scale,
        velocity=None if velocity is None else velocity * scale,
        effort=samples.effort * [columns.drives[drive].effort_scale for drive in drives],
        source=f'{path.suffix.lstrip(".") or "table"} by columns of the model file')


def _of_arrays(path: Path, drives: tuple[str, ...], columns: RecordedColumns) -> Samples:
    names = named_columns(columns, drives)
    wanted = [columns.time, *names.values()]
    table = (_parquet if path.suffix in PARQUET else _mat)(path, wanted)
    require_columns(path, wanted, list(table))
    arrays = {name: _numbers(path, name, table[name]) for name in wanted}
    lengths = {len(values) for values in arrays.values()}
    if len(lengths) > 1:
        short = min(arrays, key=lambda name: len(arrays[name]))
        raise UnreadableFileError(path, f'column {short!r} has {len(arrays[short])} rows, '
                                  f'must have {max(lengths)}, as others')
    return Samples.of_columns(drives, arrays[columns.time],
                              {key: arrays[name] for key, name in names.items()}, '')


def _numbers(path: Path, name: str, values: Any) -> Array:
    try:
        array: Array = np.asarray(values, dtype=float).ravel()
    except (TypeError, ValueError):
        raise UnreadableFileError(path, f'column {name!r} holds something else than numbers'
                                  ) from None
    return array


def _parquet(path: Path, wanted: list[str]) -> Mapping[str, Any]:
    try:
        from pyarrow import ArrowException
        from pyarrow.parquet import ParquetFile
    except ImportError:
        raise MissingLibraryError('pyarrow', 'reading Parquet files', 'tables') from None
    try:
        file = ParquetFile(path)
        names = file.schema_arrow.names
        table = file.read([name for name in wanted if name in names])
    except (ArrowException, OSError) as error:
        raise UnreadableFileError(path, f'no Parquet file ({str(error).splitlines()[0][:120]})'
                                  ) from None
    return {name: table[name].to_numpy() if name in table.column_names else ()
            for name in (names if len(table.column_names) < len(set(wanted)) else
                         table.column_names)}


def _mat(path: Path, wanted: list[str]) -> Mapping[str, Any]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path, squeeze_me=True)
    except NotImplementedError:
        raise UnreadableFileError(path, 'a MAT file of version 7.3, must be saved with -v7'
                                  ) from None
    except (MatReadError, ValueError, TypeError, OSError, EOFError, IndexError) as error:
        raise UnreadableFileError(path, f'no MAT file ({str(error).splitlines()[0][:120]})'
                                  ) from None
    return {name: value for name, value in content.items() if not name.startswith('__')}
