# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""CSV files of any program: with a header or without, packed or not.

Files of this package have `time`, `<drive>/position`, and optionally `<drive>/velocity` and
`<drive>/effort`. pandas reads the numbers, exact to the last bit. Only a block that pandas does not
read is read again row by row, which names the row and the column that are wrong.
"""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from codecs import getincrementaldecoder
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from io import StringIO, TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import IO, Any, TextIO, cast

import numpy as np
from dateutil.parser import parse as parse_date

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import Column
from pprs_dynamics.errors import MissingLibraryError, UnreadableFileError
from pprs_dynamics.measurement.files.samples import Progress, Samples, Series
from pprs_dynamics.system.csv_tables import write_table
from pprs_dynamics.system.files import readable
from pprs_dynamics.system.numbers import parse_number
from pprs_dynamics.system.plain_text import counted

SEPARATORS = (',', ';', '\t', '|')
BLANK = ' '  # where nothing else is between the cells
REMARKS = ('#', '%', 'sep=')  # lines that may stand above a table
ZSTANDARD = ('.zst', '.zstd')
LARGEST_UNPACKED = 2_000_000_000  # bytes
BLOCK = 4 << 20  # characters read at a time
NO_NUMBERS = ['', 'nan', 'NaN', 'NAN', 'N/A', 'NA', 'null', 'NULL', 'None']
PREAMBLE = 20  # lines that may stand above a table
NO_TEXT = ('not a recording, must be a bag (rosbag2, .mcap, .db3, ROS 1) or a table (.csv, '
           '.parquet, .mat, .npz, .json)')
DAY = 86400.0  # [s]
CLOCK = re.compile(r'\d(:\d\d|T\d{4})')  # in every time of day
CONTROLS = re.compile(rb'[\x00-\x08\x0e-\x1f]')  # in no text
BEGINNING = 1 << 16  # bytes by which the encoding is recognised


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
    heads : frozenset of str
        Lines of the header, which may come again where logs were joined.
    """

    path: Path
    separator: str
    decimal: str
    names: list[str]
    count: int
    above: int
    sample: list[str]
    heads: frozenset[str] = frozenset()

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
        with text_of(path) as (file, _):
            lines = list(islice(file, PREAMBLE))
        if not lines:
            raise UnreadableFileError(path, 'the file is empty')
        tables = [cls._with(path, lines, separator, decimal)
                  for separator in (*SEPARATORS, BLANK) if separator != decimal]
        most = max(table.count for table in tables[:-1])
        return next((table for table in tables if any(name in table.names for name in likely)),
                    tables[-1] if most == 1 else next(
                        table for table in tables if table.count == most))

    @classmethod
    def _with(cls, path: Path, lines: Sequence[str], separator: str, decimal: str) -> CsvTable:
        """Return a table whose cells are apart by a separator, from its first lines.

        Lines about the recording may be above its header, and a line of units below it.
        """
        remarks = 0
        while remarks < len(lines) - 1 and lines[remarks].startswith(REMARKS):
            remarks += 1
        # A header as numpy.savetxt writes it is a remark.
        rows = [cells_of(path, number, line.lstrip('#% ') if number == remarks else line, separator)
                if line.strip() and number >= remarks else []
                for number, line in enumerate(lines, 1)]

        def words(k: int) -> list[int]:
            """Return the places of a row's words, as names and states of a log are."""
            return [at for at, cell in enumerate(rows[k]) if _value_of(cell, decimal) is None]

        def is_row(k: int) -> bool:
            return any(rows[k]) and 2 * len(words(k)) < len(rows[k])

        first = next((k for k in range(remarks, len(rows) - 1) if is_row(k) and is_row(k + 1)
                      and 1 < len(rows[k]) == len(rows[k + 1]) and words(k) == words(k + 1)),
                     remarks)
        if first == remarks and not is_row(remarks):
            first += 1
        sample = rows[first] if first < len(rows) else []
        # The header counts where the cells below it are no numbers, as of decimal commas.
        count = len(sample if sample and is_row(first) else rows[remarks])
        end = next((k + 1 for k in range(first - 1, -1, -1) if any(rows[k])), first)
        header = slice(max(end - 2, 0), end)  # above blank lines
        titles = [row for row in rows[header] if len(row) == count and any(row)]
        names = [' '.join(filter(None, cells)) for cells in zip(*titles, strict=True)]
        heads = frozenset(lines[header]) if names else frozenset()
        return cls(path, separator, decimal, names, count, first, sample, heads)

    @property
    def numbers(self) -> int:
        """Number of cells of the first row with numbers or dates."""
        return sum(bool(cell) and _value_of(cell, self.decimal) is not None for cell in self.sample)

    def read(self, wanted: Sequence[Column], progress: Progress | None = None) -> list[Array]:
        """Return columns, (N,) each; times of ISO 8601 as seconds since 1970.

        Raises
        ------
        UnreadableFileError
            If a row has another count of cells, or a cell is no number.
        """
        used = [place for column in wanted if (place := self.place(column)) is not None]
        dates = {k for k in used if k < len(self.sample) and CLOCK.search(self.sample[k])
                 and _value_of(self.sample[k], self.decimal) is not None}
        size, is_packed = self.path.stat().st_size, self.path.suffix in ('.gz', *ZSTANDARD)
        blocks, unpacked, row = [], 0, self.above + 1
        with text_of(self.path) as (file, raw):
            for _ in range(self.above):
                file.readline()
            while lines := file.readlines(BLOCK):
                unpacked += sum(map(len, lines))
                if is_packed and unpacked > LARGEST_UNPACKED:
                    raise UnreadableFileError(
                        self.path, f'it unpacks to more than {LARGEST_UNPACKED / 1e9:g} GB: '
                        'unpack it, or split it into several files')
                blocks.append(self._numbers(lines, row, used, dates))
                row += len(lines)
                if progress is not None:
                    progress(min(raw.tell(), size), size)
        if not sum(map(len, blocks)):
            raise UnreadableFileError(self.path, 'no samples below the header')
        columns = list(np.concatenate(blocks).T)
        return [_past_midnight(values) if k in dates else values
                for k, values in zip(used, columns, strict=True)]

    def series(self, most: int) -> Iterator[Series]:
        """Yield the first numbers of all columns, NaN for what is none; broken rows left out."""
        found: list[list[float | None]] = []
        with text_of(self.path) as (file, _):
            for _ in range(self.above):
                file.readline()
            for line in islice(file, most):
                cells = cells_of(self.path, 0, line, self.separator) if line.strip() else []
                if len(cells) == self.count:
                    found.append([_value_of(cell, self.decimal) for cell in cells])
        if not found:
            raise UnreadableFileError(self.path, 'no samples below the header')
        for k, values in enumerate(np.array(found, dtype=float).T):
            if np.isfinite(values).any():
                name = self.names[k] if self.names else ''
                yield Series(name if self.names.count(name) == 1 and name else k + 1, name, values)

    def place(self, column: Column) -> int | None:
        """Return the place of a column from 0; None where there is none."""
        if isinstance(column, int):
            return column - 1 if column <= self.count else None
        return self.names.index(column) if column in self.names else None

    def _numbers(self, lines: list[str], start: int, used: Sequence[int], dates: set[int]) -> Array:
        """Return the used columns of lines, (n, columns used); blank lines are left out."""
        import pandas as pd  # takes a third of a second

        kept = [(number, line) for number, line in enumerate(lines, start)
                if not line.isspace() and line not in self.heads]
        content = ''.join(line for _, line in kept)
        counts = {len(line.split()) if self.separator == BLANK else line.count(self.separator) + 1
                  for _, line in kept}
        # pandas fills short rows, and takes a quote without its pair for the beginning of a cell.
        if counts - {self.count} or '"' in content:
            for number, line in kept:
                self._row(number, line)
        # From pandas 3.1 on, numbers are always exact and the argument is deprecated.
        exact = ({'float_precision': 'round_trip'}
                 if tuple(map(int, pd.__version__.split('.')[:2])) < (3, 1) else {})
        try:
            frame = pd.read_csv(
                StringIO(content), header=None, names=range(self.count), usecols=used,
                sep=r'\s+' if self.separator == BLANK else self.separator, decimal=self.decimal,
                skipinitialspace=True, keep_default_na=False, na_values=NO_NUMBERS,
                dtype={k: str if k in dates else float for k in used}, **exact)
            if len(frame) == len(kept):
                for k in dates:
                    frame[k] = [_seconds_of(date) for date in frame[k].fillna('')]
                return np.asarray(frame[list(used)], dtype=float)
        except ValueError:
            pass
        return np.array([[self._number(number, cells, column, column in dates) for column in used]
                         for number, line in kept for cells in [self._row(number, line)]]
                        ).reshape(-1, len(used))

    def _row(self, number: int, line: str) -> list[str]:
        """Return the cells of a row, or raise UnreadableFileError if it is none of this table."""
        cells = cells_of(self.path, number, line, self.separator)
        if len(cells) == self.count:
            return cells
        raise UnreadableFileError(
            self.path, f'row {number} contains {counted(len(cells), "cell")}, but the '
            f'{"header" if self.names else "first"} {self.count}: it is truncated or not a table')

    def _number(self, line: int, cells: Sequence[str], column: int, is_date: bool) -> float:
        cell = cells[column]
        try:
            if is_date:
                return _seconds_of(cell)
            return parse_number('nan' if cell in NO_NUMBERS else cell.replace(self.decimal, '.'))
        except ValueError:
            comma = (' (a decimal comma: write columns: {decimal: ","} in the model file)'
                     if re.fullmatch(r'[-+\d]+,\d+', cell) else '')
            name = self.names[column] if self.names else column + 1
            raise UnreadableFileError(
                self.path, f'row {line}, column {name} must contain a number, but '
                f'contains {cell[:40]!r}{comma}') from None


def cells_of(path: Path, number: int, line: str, separator: str) -> list[str]:
    """Return the cells of a row, which ends where its line does."""
    line = BLANK.join(line.split()) if separator == BLANK else line.rstrip('\n')
    try:
        # The reader takes the second line into a cell if a quote is left open.
        cells, *following = csv.reader([f'{line}\n', 'following'], delimiter=separator,
                                       skipinitialspace=True)
    except csv.Error as error:
        raise UnreadableFileError(path, f'row {number} is no row of a table: {error}') from None
    if not following:
        raise UnreadableFileError(
            path, f'row {number} has a quote (") without its pair, so its end is unknown')
    return [cell.strip() for cell in cells]


def _value_of(cell: str, decimal: str) -> float | None:
    """Return a number, or the seconds of a date; NaN for an empty cell, and None for words."""
    with suppress(ValueError):
        return parse_number(cell.replace(decimal, '.'))
    with suppress(ValueError):
        return _seconds_of(cell)
    return None


def _seconds_of(date: str) -> float:
    """Return seconds since 1970 of a date with a time of day, UTC if it has no offset.

    A time of day alone counts from midnight; an empty cell is NaN. The day is first where points
    are between the numbers, as in German.
    """
    if not date:
        return float('nan')
    if not CLOCK.search(date):
        raise ValueError(date)
    try:
        moment = datetime.fromisoformat(date.replace(',', '.'))
    except ValueError:
        try:
            # By default names of zones mean other things on every machine.
            moment = parse_date(date, default=datetime(1970, 1, 1), dayfirst='.' in date.split(
                ':')[0], tzinfos=lambda name, offset: offset)
        except ArithmeticError:  # of digits without end
            raise ValueError(date) from None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _past_midnight(times: Array) -> Array:
    """Return dates, (N,) [s], where those that are times of day go on rising after midnight."""
    known = np.isfinite(times)
    if not np.any(times[known] >= DAY):
        times[known] += DAY * np.cumsum(np.diff(times[known], prepend=0.0) < -DAY / 2)
    return times


@contextmanager
def text_of(path: Path) -> Iterator[tuple[TextIO, IO[bytes]]]:
    """Open a file as text, and its bytes, of which `tell` is how far it was read."""
    damages = (EOFError, zlib.error, *([zstd().ZstdError] if path.suffix in ZSTANDARD else []))
    try:
        with (readable(path), path.open('rb') as raw, _unpacked(path, raw) as content,
              TextIOWrapper(content, encoding=_encoding(path, content)) as file):
            yield file, raw
    except damages:
        raise UnreadableFileError(path, 'damaged: it cannot be unpacked to its end') from None
    except UnicodeDecodeError:
        raise UnreadableFileError(path, NO_TEXT) from None


def _encoding(path: Path, content: IO[bytes]) -> str:
    """Return how a text is encoded: UTF-8, UTF-16 with its mark, or as Windows does in Europe."""
    start = content.read(BEGINNING)
    content.seek(0)
    if start.startswith((b'\xff\xfe', b'\xfe\xff')):
        return 'utf-16'
    if CONTROLS.search(start):
        raise UnreadableFileError(path, NO_TEXT)
    try:
        getincrementaldecoder('utf-8')().decode(start)
    except UnicodeDecodeError:
        return 'cp1252'
    return 'utf-8-sig'


def _unpacked(path: Path, raw: IO[bytes]) -> IO[bytes]:
    if path.suffix == '.gz':
        return cast('IO[bytes]', gzip.GzipFile(fileobj=raw))
    if path.suffix in ZSTANDARD:
        return cast('IO[bytes]', zstd().open(raw, 'rb'))
    return raw


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
    quantities = [*samples.measured.items(), *samples.channels.items()]
    header = ['time', *(f'{drive}/{name}' for name, _ in quantities for drive in samples.drives)]
    write_table(path, header, [samples.time, *(values for _, values in quantities)])
