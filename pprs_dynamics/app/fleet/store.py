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

# Name, pandas type, unit, meaning; docs/fleets.md prints this table.
COLUMNS: tuple[tuple[str, str, str, str], ...] = (
    ('recording', 'string', '', 'name of the file or bag'),
    ('path', 'string', '', 'where it was read from'),
    ('sha256', 'string', '', 'of its content'),
    ('robot', 'string', '', 'of the manifest, else the name of the folder'),
    ('time', 'datetime64[us, UTC]', 'UTC', "of the manifest, else the recording's first stamp"),
    ('duration', 'float64', 's', 'of its segments together'),
    ('model', 'string', '', "SHA-256 of the model's values"),
    ('options', 'string', '', 'auto, or the effects that were fitted'),
    ('version', 'string', '', 'of this package'),
    ('drive', 'string', '', "null for the structure and the model's own numbers"),
    ('effect', 'string', '', "name in the catalogue; model for the model's own numbers; null in "
     "a drive's first row"),
    ('parameter', 'string', '', 'coefficient of the effect, or key of the model file'),
    ('value', 'float64', 'unit', 'as fitted'),
    ('std', 'float64', 'unit', 'its standard deviation; null if it is unknown'),
    ('unit', 'string', '', 'of value and std'),
    ('evidence', 'float64', '1', 'by which the cost rises without the effect'),
    ('rms', 'float64', 'N', 'rms of measured minus model, of the drive'),
    ('relative', 'float64', '1', 'rms over that of the changing part of the effort'),
    ('noise', 'float64', 'N', "rms of the drive's noise"),
    ('verdict', 'string', '', 'of diagnose; fitted with named effects; refused without a result'),
    ('error', 'string', '', 'why there is no result; null if there is one'),
)


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
    table = pd.DataFrame(list(rows), columns=[name for name, *_ in COLUMNS]).astype(
        {name: kind for name, kind, *_ in COLUMNS})
    numbers = table.select_dtypes('float64').columns
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
    if not tables or {name for name, *_ in COLUMNS} - {*tables[0].columns}:
        raise UnreadableFileError(store, 'not a store, must be a folder that `pprs survey '
                                  '--output` wrote')
    return pd.concat(tables, ignore_index=True)
