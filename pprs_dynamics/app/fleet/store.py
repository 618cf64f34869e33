# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Store of a survey: a folder with one Parquet file for each recording.

The file name is a hash of content, robot, model, effects and package version. A survey that runs
again therefore skips what is done.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from pprs_dynamics.app.fleet.recordings import pandas
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.system.files import new_file

AUTO = 'auto'  # effects of a survey that diagnoses
MODEL = 'model'  # stands for the effect in rows of the model's own numbers

TEXT, NUMBER = 'string', 'float64'
# Types of pandas by name; docs/fleets.md has units and meanings.
COLUMNS = {
    'recording': TEXT, 'path': TEXT, 'sha256': TEXT, 'robot': TEXT, 'time': 'datetime64[us, UTC]',
    'duration': NUMBER, 'model': TEXT, 'options': TEXT, 'version': TEXT, 'drive': TEXT,
    'effect': TEXT, 'parameter': TEXT, 'value': NUMBER, 'std': NUMBER, 'unit': TEXT,
    'evidence': NUMBER, 'rms': NUMBER, 'relative': NUMBER, 'noise': NUMBER, 'verdict': TEXT,
    'error': TEXT}


def key_of(*parts: str) -> str:
    """Return the name of a recording's file in a store, without its ending."""
    return hashlib.sha256(json.dumps(parts).encode(errors='surrogateescape')).hexdigest()[:40]


def write_rows(store: Path, key: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write the rows of a recording as a file of a store, whole or not at all.

    Raises
    ------
    UnreadableFileError
        If it cannot be written.
    """
    pd = pandas()
    table = pd.DataFrame(list(rows), columns=[*COLUMNS]).astype(COLUMNS)
    numbers = table.select_dtypes(NUMBER).columns
    table[numbers] = table[numbers].where(table[numbers].abs() < float('inf'))
    content = BytesIO()
    table.to_parquet(content, index=False)
    store.mkdir(parents=True, exist_ok=True)
    with new_file(store / f'{key}.parquet') as file:
        file.write(content.getvalue())


def read_rows(store: str) -> Any:
    """Return the rows of a store as a table of pandas.

    Raises
    ------
    UnreadableFileError
        If it is no store, or a file in it is damaged.
    """
    pd = pandas()
    tables = []
    for file in sorted(Path(store).glob('*.parquet')):
        try:
            tables.append(pd.read_parquet(file))
        except (OSError, ValueError) as error:
            raise UnreadableFileError(file, 'is damaged, delete it and run pprs survey again: '
                                      f'{str(error).splitlines()[0]}') from None
    if not tables or {*COLUMNS} - {*tables[0].columns}:
        raise UnreadableFileError(store, 'not a store, must be a folder that `pprs survey '
                                  '--output` wrote')
    return pd.concat(tables, ignore_index=True)
