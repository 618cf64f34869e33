# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""CSV files of numbers to be written."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.system.files import new_file


def write_table(path: str | PathLike[str], header: Sequence[str], columns: Sequence[Array]) -> None:
    """Write columns, each (N,) or (N, k), exact to the last digit; NaN as an empty cell.

    Raises
    ------
    UnreadableFileError
        If it cannot be written.
    """
    import pandas as pd  # takes a third of a second

    table = pd.DataFrame(np.column_stack(columns), columns=list(header))
    with new_file(path) as file:
        table.to_csv(file, index=False, lineterminator='\n')
