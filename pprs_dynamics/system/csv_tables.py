# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""CSV files of numbers to be written."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from os import PathLike

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.system.files import new_file

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
