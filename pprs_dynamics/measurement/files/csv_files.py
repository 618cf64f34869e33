# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""CSV files of any program: with a header or without, packed or not.

Our own have `time`, `<drive>/position`, and optionally `<drive>/velocity`, `<drive>/effort`.

Read by numpy.loadtxt in blocks. 300 000 rows of 19 columns (108 MB) on one core, all exact to the
last bit: pandas 1.0 s, pyarrow 3.1 s, this 5.7 s. A diagnosis of them takes longer, the first two
are libraries of 60 and 170 MB, and neither says in which row and column a cell is no number.
"""

from __future__ import annotations

import gzip
import os
import re
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import IO, Any, TextIO, cast

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import Column
from pprs_dynamics.errors import MissingLibraryError, UnreadableFileError
from pprs_dynamics.measurement.files.samples import QUANTITIES, Progress, Samples
from pprs_dynamics.system.csv_tables import (
    LONGEST_LINE,
    cells_of,
    check_length,
    read_lines,
    write_table,
)
from pprs_dynamics.system.numbers import parse_number
from pprs_dynamics.system.plain_text import counted

SEPARATORS = (',', ';', '\t', '|')
BLANK = ' '  # where nothing else is between the cells
REMARKS = ('#', '%', 'sep=')  # lines that may stand above a table
ZSTANDARD = ('.zst', '.zstd')
LARGEST_UNPACKED = 2_000_000_000  # bytes
NO_TEXT = 'neither rosbag2 (MCAP, sqlite3) nor CSV text in UTF-8'


@dataclass(frozen=True)
class CsvTable:
    """A CSV file by its first lines.

    Parameters
    ----------
    path : Path
    separator : str
    decimal : str
        What is between the whole and the rest of a number.
    names : list of str
        The header; empty where there is none.
    count : int
        Columns.
    above : int
        Lines above the first row.
    sample : list of str
        Cells of the first row; empty where there is none.
    """

    path: Path
    separator: str
    decimal: str
    names: list[str]
    count: int
    above: int
    sample: list[str]

    @classmethod
    def open(cls, path: Path, decimal: str = '.', likely: Sequence[str] = ()) -> CsvTable:
        """Read the first lines of a file.

        Parameters
        ----------
        likely : sequence of str
            Columns that are looked for: what is between these is the separator.

        Raises
        ------
        UnreadableFileError
            Where it is no text, or empty.
        """
        separators = tuple(each for each in SEPARATORS if each != decimal)
        with _text_of(path) as (file, _):
            above, remark, first = 0, '', _line(path, file, 1)
            while first.startswith(REMARKS) and (line := _line(path, file, above + 2)):
                above, remark, first = above + 1, first.lstrip('#% '), line
            second = _line(path, file, above + 2)
            while second and not second.strip():
                second = _line(path, file, above + 2)
        if not first:
            raise UnreadableFileError(path, 'the file is empty')
        if '\x00' in first:
            raise UnreadableFileError(path, NO_TEXT)
        rows = {each: _cells(path, above + 1, first, each) for each in (*separators, BLANK)}
        separator = max(separators, key=lambda each: len(rows[each]))
        if len(rows[separator]) == 1:
            separator = BLANK
        separator = next((each for each, cells in rows.items() if any(
            name in cells for name in likely)), separator)
        header = rows[separator]
        if all(_is_value(cell, decimal) for cell in header):
            # A header as numpy.savetxt writes it is a remark.
            titles = _cells(path, above, remark, separator) if remark else []
            return cls(path, separator, decimal, titles if len(titles) == len(header) else [],
                       len(header), above, header)
        return cls(path, separator, decimal, header, len(header), above + 1,
                   _cells(path, above + 2, second, separator) if second else [])

    def read(self, wanted: Sequence[Column], progress: Progress | None = None) -> list[Array]:
        """Return columns, (N,) each; times of ISO 8601 as seconds since 1970.

        Raises
        ------
        UnreadableFileError
            Where a column is missing, a row is none of this table, or a cell is no number.
        """
        used = [self._place(column) for column in wanted]
        size, blocks = self.path.stat().st_size, []
        with _text_of(self.path) as (file, raw):
            for _ in range(self.above):
                file.readline()
            for block in self._blocks(file, used):
                blocks.append(block)
                if progress is not None:
                    progress(min(raw.tell(), size), size)
        if not blocks:
            raise UnreadableFileError(self.path, 'no samples below the header')
        return list(np.concatenate(blocks).T)

    def head(self, most: int) -> list[Array]:
        """Return the first rows of all columns, NaN for what is no number; broken rows left out."""
        found: list[list[float]] = []
        with _text_of(self.path) as (file, _):
            for _ in range(self.above):
                file.readline()
            for line in islice(file, most):
                cells = _cells(self.path, 0, line, self.separator) if line.strip() else []
                if len(cells) == self.count:
                    found.append([self._any(cell) for cell in cells])
        if not found:
            raise UnreadableFileError(self.path, 'no samples below the header')
        return list(np.array(found).T)

    def _any(self, cell: str) -> float:
        try:
            return (parse_number(cell.replace(self.decimal, '.'))
                    if _is_number(cell, self.decimal) else _seconds_of(cell))
        except ValueError:
            return float('nan')

    def _place(self, column: Column) -> int:
        if isinstance(column, int):
            if column > self.count:
                raise UnreadableFileError(self.path, f'no column {column}; it holds '
                                          f'{counted(self.count, "column")}')
            return column - 1
        return self.names.index(column)

    def title(self, place: int) -> str:
        """Return what a column is called."""
        return self.names[place] if self.names else str(place + 1)

    def _blocks(self, file: TextIO, used: Sequence[int]) -> Iterator[Array]:
        """Yield the used columns of the rows, (n, columns used)."""
        dates = {k for k in used if k < len(self.sample) and self.sample[k].strip()
                 and not _is_number(self.sample[k], self.decimal) and _is_date(self.sample[k])}
        is_packed, size = self.path.suffix in ('.gz', *ZSTANDARD), 0
        for start, lines in read_lines(self.path, file, start=self.above + 1):
            size += sum(map(len, lines)) + len(lines)
            _check_unpacked(self.path, size if is_packed else 0)
            numbered = [(number, line) for number, line in enumerate(lines, start) if line.strip()]
            if self.separator == BLANK:
                numbered = [(number, BLANK.join(line.split())) for number, line in numbered]
            for number, line in numbered:
                if line.count(self.separator) != self.count - 1:
                    self._row(number, line)
            if numbered:
                yield self._numbers(numbered, used, dates)

    def _numbers(self, numbered: list[tuple[int, str]], used: Sequence[int], dates: set[int],
                 ) -> Array:
        text = _with_empty_cells_named(
            '\n' + '\n'.join([line for _, line in numbered]), self.separator)
        if self.decimal != '.':
            text = text.replace(self.decimal, '.')
        if not dates:
            try:
                rows = np.loadtxt(text[1:].split('\n'), delimiter=self.separator, usecols=used,
                                  comments=None, ndmin=2, quotechar='"')
                if len(rows) == len(numbered):
                    return rows
            except ValueError:
                pass
        # Slow, and seldom: for dates, to name the row or the cell, or to read cells of blanks.
        return np.array([[self._number(number, cells, column, column in dates) for column in used]
                         for number, line in numbered for cells in [self._row(number, line)]])

    def _row(self, number: int, line: str) -> list[str]:
        cells = cells_of(self.path, number, line, self.separator)
        if len(cells) == self.count:
            return cells
        raise UnreadableFileError(
            self.path, f'row {number} holds {counted(len(cells), "cell")}, but the '
            f'{"header" if self.names else "first"} {self.count}: it is truncated or not a table')

    def _number(self, line: int, cells: Sequence[str], column: int, is_date: bool) -> float:
        cell = cells[column].strip()
        try:
            if is_date:
                return _seconds_of(cell) if cell else float('nan')
            return parse_number(cell.replace(self.decimal, '.')) if cell else float('nan')
        except ValueError:
            comma = (' (a decimal comma: write columns: {decimal: ","} in the model file)'
                     if re.fullmatch(r'[-+\d]+,\d+', cell) else '')
            raise UnreadableFileError(
                self.path, f'row {line}, column {self.title(column)} must hold a number, but '
                f'holds {cell[:40]!r}{comma}') from None


def _line(path: Path, file: TextIO, number: int) -> str:
    line = file.readline(LONGEST_LINE + 1)
    check_length(path, number, line)
    return line


def _cells(path: Path, number: int, line: str, separator: str) -> list[str]:
    line = line.rstrip('\n')
    if separator == BLANK:
        line = BLANK.join(line.split())
    return [cell.strip() for cell in cells_of(path, number, line, separator)]


def _is_number(cell: str, decimal: str) -> bool:
    try:
        parse_number(cell.replace(decimal, '.'))
    except ValueError:
        return False
    return True


def _is_date(cell: str) -> bool:
    try:
        _seconds_of(cell)
    except ValueError:
        return False
    return True


def _is_value(cell: str, decimal: str) -> bool:
    return not cell or _is_number(cell, decimal) or _is_date(cell)


def _seconds_of(date: str) -> float:
    """Return seconds since 1970 of an ISO 8601 date, UTC where it does not say otherwise."""
    moment = datetime.fromisoformat(date.strip().replace(',', '.'))
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


@contextmanager
def _text_of(path: Path) -> Iterator[tuple[TextIO, IO[bytes]]]:
    """Open a file as text, and its bytes, of which `tell` is how far it was read."""
    damages = (EOFError, zlib.error, *([zstd().ZstdError] if path.suffix in ZSTANDARD else []))
    try:
        with (path.open('rb') as raw, _unpacked(path, raw) as content,
              TextIOWrapper(content, encoding='utf-8-sig') as file):
            yield file, raw
    except UnreadableFileError:
        raise
    except damages:
        raise UnreadableFileError(path, 'damaged: it cannot be unpacked to its end') from None
    except UnicodeDecodeError:
        raise UnreadableFileError(path, NO_TEXT) from None
    except OSError as error:
        raise UnreadableFileError(path, error.strerror or str(error)) from None


def _unpacked(path: Path, raw: IO[bytes]) -> IO[bytes]:
    if path.suffix == '.gz':
        # Its last four bytes are the length of what was packed.
        raw.seek(-min(4, path.stat().st_size), os.SEEK_END)
        _check_unpacked(path, int.from_bytes(raw.read(), 'little'))
        raw.seek(0)
        return cast('IO[bytes]', gzip.GzipFile(fileobj=raw))
    if path.suffix in ZSTANDARD:
        return cast('IO[bytes]', zstd().open(raw, 'rb'))
    return raw


def _check_unpacked(path: Path, size: int) -> None:
    if size > LARGEST_UNPACKED:
        raise UnreadableFileError(path, f'it unpacks to more than {LARGEST_UNPACKED / 1e9:g} GB: '
                                  'unpack it, or split it into several files')


def zstd() -> Any:
    """Return the library that unpacks Zstandard, which rosbags brings.

    Raises
    ------
    MissingLibraryError
    """
    # Of Python itself from 3.14 on; before it the one that rosbags asks for.
    for name in ('compression.zstd', 'backports.zstd'):
        with suppress(ImportError):
            return import_module(name)
    raise MissingLibraryError('rosbags', 'reading Zstandard', 'bags')


def write_csv(path: Path, samples: Samples) -> None:
    """Write samples as CSV, exact to the last digit; NaN as an empty cell.

    Times stay counted from `epoch`, which is not written: as floats they would lose digits.
    """
    quantities = [(name, values) for name, values in zip(
        QUANTITIES, (samples.position, samples.velocity, samples.effort), strict=True)
        if values is not None]
    quantities += samples.channels.items()
    header = ['time', *(f'{drive}/{name}' for name, _ in quantities for drive in samples.drives)]
    write_table(path, header, [samples.time, *(values for _, values in quantities)])


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
