# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Small CSV files, and CSV files of numbers to be written."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from os import PathLike

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.system.files import new_file, require_file

ROWS = 10_000  # written at a time


def write_table(path: str | PathLike[str], header: Sequence[str], columns: Sequence[Array]) -> None:
    """Write columns, each (N,) or (N, k), exact to the last digit; NaN as an empty cell.

    Raises
    ------
    UnreadableFileError
        If it cannot be written.
    """
    names = io.StringIO()
    csv.writer(names, lineterminator='\n').writerow(header)
    with new_file(path) as file:
        file.write(names.getvalue().encode())
        # Twice as fast as DataFrame.to_csv.
        for start in range(0, len(columns[0]), ROWS):
            rows = np.column_stack([values[start:start + ROWS] for values in columns]).tolist()
            text = '\n'.join([','.join(map(repr, row)) for row in rows]) + '\n'
            file.write(text.replace('nan', '').encode())


def read_rows(path: str | PathLike[str]) -> list[tuple[int, list[str]]]:
    """Return the rows of a small CSV file and the numbers of their lines, empty rows left out.

    Raises
    ------
    UnreadableFileError
        If it cannot be read, or a quote has no pair.
    """
    require_file(path)
    try:
        with open(path, encoding='utf-8-sig', newline='') as file:
            reader = csv.reader(file, strict=True)
            return [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except OSError as error:
        raise UnreadableFileError(path, error.strerror or str(error)) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UnreadableFileError(path, f'is no CSV text in UTF-8 ({error})') from None
