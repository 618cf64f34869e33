# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""CSV files of numbers: one row per line, quotes only within a line, lines of bounded length."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from os import PathLike
from typing import TextIO

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.system.input_files import require_file
from pprs_dynamics.system.output_files import new_file

# Rows written at a time.
ROWS = 10_000
# Characters read at a time.
BLOCK = 4 << 20
# Characters; no recording has so many columns. A packed file of a megabyte may unpack to a line
# of gigabytes.
LONGEST_LINE = 1 << 20


def write_table(path: str | PathLike[str], header: Sequence[str], columns: Sequence[Array]) -> None:
    """Write columns, each (N,) or (N, k), exact to the last digit; NaN as an empty cell.

    Raises
    ------
    UnreadableFileError
        Where it cannot be written.
    """
    names = io.StringIO()
    csv.writer(names, lineterminator='\n').writerow(header)
    with new_file(path) as file:
        file.write(names.getvalue().encode())
        for start in range(0, len(columns[0]), ROWS):
            rows = np.column_stack([values[start:start + ROWS] for values in columns]).tolist()
            text = '\n'.join([','.join(map(repr, row)) for row in rows]) + '\n'
            file.write(text.replace('nan', '').encode())


def read_rows(path: str | PathLike[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of a small CSV file and their numbers, blank lines left out.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read, or a row does not end where its line does.
    """
    require_file(path)
    try:
        with open(path, encoding='utf-8-sig') as file:
            for start, lines in read_lines(path, file):
                for number, line in enumerate(lines, start):
                    if line.strip():
                        yield number, cells_of(path, number, line)
    except UnreadableFileError:
        raise
    except OSError as error:
        raise UnreadableFileError(path, error.strerror or str(error)) from None
    except UnicodeDecodeError:
        raise UnreadableFileError(path, 'is no text, must be CSV in UTF-8') from None


def read_lines(path: str | PathLike[str], file: TextIO, start: int = 1,
               ) -> Iterator[tuple[int, list[str]]]:
    """Yield lines of a text without their ends, many at a time, and the number of the first.

    Raises
    ------
    UnreadableFileError
        For a line that is longer than any row of a table.
    """
    rest = ''
    while text := file.read(BLOCK):
        *lines, rest = (rest + text).split('\n')
        for number, line in enumerate((*lines, rest), start):
            check_length(path, number, line)
        yield start, lines
        start += len(lines)
    if rest:
        yield start, [rest]


def check_length(path: str | PathLike[str], number: int, line: str) -> None:
    """Raise UnreadableFileError for a line that is longer than any row of a table."""
    if len(line) > LONGEST_LINE:
        raise UnreadableFileError(
            path, f'row {number} is longer than {LONGEST_LINE} characters: not a table')


def cells_of(path: str | PathLike[str], number: int, line: str, separator: str = ',') -> list[str]:
    """Return the cells of a row, which ends where its line does.

    Raises
    ------
    UnreadableFileError
        For a quote without its pair, which would take all that follows into its cell.
    """
    try:
        # A second line that is swallowed shows that a quote was left open.
        cells, *following = csv.reader([f'{line}\n', 'following'], delimiter=separator)
    except csv.Error:
        raise UnreadableFileError(path, f'row {number} has a cell of more than '
                                  f'{csv.field_size_limit()} characters: not a table') from None
    if not following:
        raise UnreadableFileError(
            path, f'row {number} has a quote (") without its pair, so where the row ends cannot '
            'be told')
    return cells
