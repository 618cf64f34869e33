# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings in tables: CSV, Parquet and MAT files.

Our own are CSV: `time`, `<drive>/position`, and optionally `<drive>/velocity`, `<drive>/effort`.

In place of an effort there may be `<drive>/current` [A]. Files that end in .gz are unpacked.

Read by numpy.loadtxt in blocks. A million rows of 19 columns on one core, exact to the last bit:
pandas 1 s (a dependency), loadtxt 6 s, float() of each cell 12 s.
"""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import TextIOWrapper
from pathlib import Path
from typing import IO, Any, TextIO, cast

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import RecordedColumns
from pprs_dynamics.errors import MissingLibraryError, UnreadableFileError
from pprs_dynamics.measurement.files.samples import (
    CURRENT,
    QUANTITIES,
    Defect,
    Progress,
    Samples,
)
from pprs_dynamics.system.csv_tables import (
    LONGEST_LINE,
    cells_of,
    check_length,
    read_lines,
    write_table,
)
from pprs_dynamics.system.numbers import parse_number
from pprs_dynamics.system.plain_text import counted

PARQUET, MAT = ('.parquet', '.pq'), ('.mat',)
# The second is what PlotJuggler writes.
TIME_COLUMNS = ('time', '__time')
SEPARATORS = (',', ';', '\t')


@dataclass(frozen=True)
class _Table:
    """A CSV file by its header: separator, all columns, and which are used.

    Those of drives and quantities had a prefix where there is one.
    """

    path: Path
    separator: str
    header: list[str]
    time: int
    columns: dict[tuple[str, str], int]
    prefix: str = ''

    @property
    def used(self) -> list[int]:
        """Numbers of the columns that are read: of time, and of drives and quantities."""
        return [self.time, *self.columns.values()]

    def blocks(self, file: TextIO) -> Iterator[Array]:
        """Yield the used columns of the rows below the header, (n, columns used)."""
        for start, lines in read_lines(self.path, file, start=2):
            numbered = [(number, line) for number, line in enumerate(lines, start) if line.strip()]
            for number, line in numbered:
                if line.count(self.separator) != len(self.header) - 1:
                    self._cells(number, line)
            if numbered:
                yield self._numbers(numbered)

    def _numbers(self, numbered: list[tuple[int, str]]) -> Array:
        text = _with_empty_cells_named(
            '\n' + '\n'.join([line for _, line in numbered]), self.separator)
        try:
            rows = np.loadtxt(text[1:].split('\n'), delimiter=self.separator, usecols=self.used,
                              comments=None, ndmin=2, quotechar='"')
            if len(rows) == len(numbered):
                return rows
        except ValueError:
            pass
        # Slow, and seldom: to name the row or the cell, or to read cells of blanks.
        return np.array([[self._number(number, cells, column) for column in self.used]
                         for number, line in numbered for cells in [self._cells(number, line)]])

    def _cells(self, number: int, line: str) -> list[str]:
        cells = cells_of(self.path, number, line, self.separator)
        if len(cells) == len(self.header):
            return cells
        raise UnreadableFileError(
            self.path, f'row {number} holds {counted(len(cells), "cell")}, but the header '
            f'{len(self.header)}: it is truncated or not a table')

    def _number(self, line: int, cells: Sequence[str], column: int) -> float:
        cell = cells[column].strip()
        try:
            return parse_number(cell) if cell else float('nan')
        except ValueError:
            comma = ' (a decimal comma is not read)' if re.fullmatch(r'[-+\d]+,\d+', cell) else ''
            raise UnreadableFileError(
                self.path, f'row {line}, column {self.header[column]} must hold a number, but '
                f'holds {cell[:40]!r}{comma}') from None

    def samples(self, drives: tuple[str, ...], blocks: list[Array]) -> Samples:
        """Return what the blocks of the rows hold, and which columns were not read."""
        time, *values = (np.concatenate([block[:, place] for block in blocks])
                         for place in range(len(self.used)))
        others = [name or '(no name)' for index, name in enumerate(self.header)
                  if index not in self.used]
        findings = (Defect(
            'ignored_columns', len(others),
            f'the file also holds {counted(len(others), "column")}: '
            + ', '.join(others[:10]) + (', ...' if len(others) > 10 else '')),) if others else ()
        return Samples.of_columns(drives, time, dict(zip(self.columns, values, strict=True)),
                                  f'CSV, {self.prefix}' if self.prefix else 'CSV', findings)


def read_csv(
    path: Path, drives: tuple[str, ...], topic: str | None = None,
    progress: Progress | None = None, names: RecordedColumns | None = None,
) -> Samples:
    """Read a CSV with a header; comma, semicolon or tab between columns in any order.

    Parameters
    ----------
    names : RecordedColumns, optional
        Of columns that have names of their own; blanks and | may be between these, too.
    topic : str, optional
        Where columns have prefixes, as in `/joint_states/lift_1/position`: the one to take, if
        there are several.

    Raises
    ------
    UnreadableFileError
        Where it is no such table, a drive is missing, or a cell is not a number.
    """
    try:
        size = path.stat().st_size
        with (path.open('rb') as raw, _unpacked(path, raw) as content,
              TextIOWrapper(content, encoding='utf-8-sig') as file):
            first = file.readline(LONGEST_LINE + 1)
            if not first:
                raise UnreadableFileError(path, 'the file is empty')
            check_length(path, 1, first)
            table = (_columns(path, first, drives, topic) if names is None
                     else _named_columns(path, first, drives, names))
            blocks = []
            for block in table.blocks(file):
                blocks.append(block)
                if progress is not None:
                    progress(min(raw.tell(), size), size)
    except OSError as error:
        if isinstance(error, UnreadableFileError):
            raise
        raise UnreadableFileError(path, error.strerror or str(error)) from None
    except (EOFError, zlib.error):
        raise UnreadableFileError(path, 'damaged: it cannot be unpacked to its end') from None
    except UnicodeDecodeError:
        raise UnreadableFileError(
            path, 'neither rosbag2 (MCAP, sqlite3) nor CSV text in UTF-8') from None
    if not blocks:
        raise UnreadableFileError(path, 'no samples below the header')
    return table.samples(drives, blocks)


def _unpacked(path: Path, raw: IO[bytes]) -> IO[bytes]:
    return cast('IO[bytes]', gzip.GzipFile(fileobj=raw)) if path.suffix == '.gz' else raw


def write_csv(path: Path, samples: Samples) -> None:
    """Write samples as CSV, exact to the last digit; NaN as an empty cell.

    Times stay counted from `epoch`, which is not written: as floats they would lose digits.
    """
    quantities = [(name, values) for name, values in zip(
        QUANTITIES, (samples.position, samples.velocity, samples.effort), strict=True)
        if values is not None]
    header = ['time', *(f'{drive}/{name}' for name, _ in quantities for drive in samples.drives)]
    write_table(path, header, [samples.time, *(values for _, values in quantities)])


def _columns(
    path: Path, first: str, drives: tuple[str, ...], topic: str | None,
) -> _Table:
    """Return what the header says, by the names of our own format."""
    headers = _headers(path, first, SEPARATORS)
    separator = max(SEPARATORS, key=lambda s: len(headers[s]))
    header = headers[separator]
    time = next((name for name in TIME_COLUMNS if name in header), None)
    if time is None:
        raise UnreadableFileError(
            path, 'not a recording: the header must hold time and <drive>/position, but is '
            f'{first.strip()[:80]!r}')
    found: dict[str, dict[tuple[str, str], int]] = {}
    for index, name in enumerate(header):
        joint, slash, quantity = name.rpartition('/')
        prefix, _, drive = joint.rpartition('/')
        if slash and quantity in (*QUANTITIES, CURRENT):
            of_prefix = found.setdefault(prefix, {})
            if (drive, quantity) in of_prefix:
                raise UnreadableFileError(path, f'the column {name!r} stands twice')
            of_prefix[drive, quantity] = index
    if header.count(time) > 1:
        raise UnreadableFileError(path, f'the column {time!r} stands twice')
    prefix = _prefix(path, found, drives, topic)
    columns = {key: index for key, index in found[prefix].items() if key[0] in drives}
    for drive in drives:
        if (drive, 'effort') in columns:
            columns.pop((drive, CURRENT), None)
    return _Table(path, separator, header, header.index(time), columns, prefix)


def _named_columns(
    path: Path, first: str, drives: tuple[str, ...], names: RecordedColumns,
) -> _Table:
    """Return what the header says, of columns with names of their own."""
    headers = _headers(path, first, (*SEPARATORS, ' ', '|'))
    separator = next((each for each, cells in headers.items() if names.time in cells), ',')
    header = headers[separator]
    wanted = _names_of_columns(names, drives)
    _require_columns(path, [names.time, *wanted.values()], header)
    return _Table(path, separator, header, header.index(names.time),
                  {key: header.index(name) for key, name in wanted.items()})


def _names_of_columns(names: RecordedColumns, drives: Sequence[str]) -> dict[tuple[str, str], str]:
    """Return the names of columns by drive and quantity."""
    return {(drive, quantity): name for drive in drives
            for quantity, name in names.drives[drive].names.items()}


def _require_columns(path: Path, wanted: Sequence[str], known: Sequence[str]) -> None:
    """Raise UnreadableFileError where a table lacks a column."""
    missing = [name for name in wanted if name not in known]
    if missing:
        raise UnreadableFileError(path, f'no column {missing[0]!r}; it holds '
                                  + (', '.join(sorted(known)[:12]) or 'none'))


def _headers(path: Path, first: str, separators: Sequence[str]) -> dict[str, list[str]]:
    if '\x00' in first:
        raise UnreadableFileError(path, 'neither rosbag2 (MCAP, sqlite3) nor CSV text in UTF-8')
    return {separator: [cell.strip() for cell in cells_of(path, 1, first.rstrip('\n'), separator)]
            for separator in separators}


def _prefix(
    path: Path, found: dict[str, dict[tuple[str, str], int]], drives: tuple[str, ...],
    topic: str | None,
) -> str:
    """Return the prefix whose columns hold all drives."""
    if topic is not None:
        found = {prefix: columns for prefix, columns in found.items()
                 if prefix.strip('/') == topic.strip('/')}
    complete = [prefix for prefix, columns in found.items()
                if all((drive, 'position') in columns for drive in drives)]
    if not complete:
        joints = sorted({f'{prefix}/{drive}' if prefix else drive
                         for prefix, columns in found.items()
                         for drive, quantity in columns if quantity == 'position'})
        known = {drive for columns in found.values()
                 for drive, quantity in columns if quantity == 'position'}
        missing = [drive for drive in drives if drive not in known] or list(drives)
        raise UnreadableFileError(
            path, f'no {", ".join(f"{drive}/position" for drive in missing)}'
            + (f' under {topic}' if topic else '') + '; there are positions of '
            + (', '.join(joints) or 'no joint'))
    # The plain names are the format; prefixes are a courtesy to other tools.
    if '' in complete:
        return ''
    if len(complete) > 1:
        raise UnreadableFileError(
            path, f'there are the drives of {", ".join(complete)}: choose one with topic')
    return complete[0]


def _with_empty_cells_named(text: str, separator: str) -> str:
    """Return lines, after a first newline, with nan in cells of no character."""
    # Plain searches: a regular expression for the same takes as long as reading the numbers.
    if '\n' + separator in text:
        text = text.replace('\n' + separator, '\nnan' + separator)
    if separator + '\n' in text or text.endswith(separator):
        text = (text + '\n').replace(separator + '\n', separator + 'nan\n')[:-1]
    if separator * 2 in text:
        # Twice: of three separators in a row the first replacement sees only one pair.
        for _ in range(2):
            text = text.replace(separator * 2, separator + 'nan' + separator)
    return text


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
    names = _names_of_columns(columns, drives)
    wanted = [columns.time, *names.values()]
    table = (_parquet if path.suffix in PARQUET else _mat)(path, wanted)
    _require_columns(path, wanted, list(table))
    arrays = {name: _as_numbers(path, name, table[name]) for name in wanted}
    lengths = {len(values) for values in arrays.values()}
    if len(lengths) > 1:
        short = min(arrays, key=lambda name: len(arrays[name]))
        raise UnreadableFileError(path, f'column {short!r} has {len(arrays[short])} rows, '
                                  f'must have {max(lengths)}, as others')
    return Samples.of_columns(drives, arrays[columns.time],
                              {key: arrays[name] for key, name in names.items()}, '')


def _as_numbers(path: Path, name: str, values: Any) -> Array:
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
    return {name: table[name].to_numpy() if name in table.column_names else () for name in names}


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
