# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a survey, from files, folders and globs or a manifest; and the store of results.

A store is a folder with one Parquet file for each recording.
"""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import Any

from pprs_dynamics.errors import PprsError, UnreadableFileError, optional_library
from pprs_dynamics.measurement.files.bag_storage import is_bag_folder
from pprs_dynamics.measurement.files.recording import ENDINGS
from pprs_dynamics.system.files import new_file

AUTO = 'auto'  # effects of a survey that diagnoses
MODEL = 'model'  # in place of an effect, in rows of the model's numbers

TEXT, NUMBER = 'string', 'float64'
# Types of pandas by name; docs/fleets.md has units and meanings.
COLUMNS = {
    'recording': TEXT, 'path': TEXT, 'sha256': TEXT, 'robot': TEXT, 'time': 'datetime64[us, UTC]',
    'duration': NUMBER, 'model': TEXT, 'options': TEXT, 'version': TEXT, 'drive': TEXT,
    'effect': TEXT, 'parameter': TEXT, 'value': NUMBER, 'std': NUMBER, 'unit': TEXT,
    'evidence': NUMBER, 'rms': NUMBER, 'relative': NUMBER, 'noise': NUMBER, 'verdict': TEXT,
    'error': TEXT}


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


class ManifestError(PprsError, ValueError):
    """A manifest with an impossible entry."""


@dataclass(frozen=True)
class SurveyedRecording:
    """A recording, its robot, its time (None: its first stamp), its model file (None: as given)."""

    path: str
    robot: str
    time: datetime | None = None
    model: str | None = None


def pandas() -> Any:
    """Return pandas with pyarrow, or raise MissingLibraryError."""
    _, library = (optional_library(name, 'pandas and pyarrow', 'a survey', 'fleet')
                  for name in ('pyarrow', 'pandas'))
    return library


def find_recordings(patterns: Sequence[str]) -> Iterator[SurveyedRecording]:
    """Yield the recordings in files, folders and globs; a robot has the name of its folder.

    Raises
    ------
    UnreadableFileError
        If a pattern matches no recording.
    """
    for pattern in patterns:
        places = [pattern] if os.path.exists(pattern) else sorted(glob.glob(pattern))
        found = [path for place in places for path in recordings_in(Path(place))]
        if not found:
            raise UnreadableFileError(pattern or "''", 'there is no recording: no file, no '
                                      f'folder with {", ".join(ENDINGS)} or bags, and no match')
        for path in found:
            yield SurveyedRecording(str(path), path.absolute().parent.name or 'robot')


def recordings_in(place: Path) -> Iterator[Path]:
    """Yield the bags and files of recordings in a folder, hidden ones left out; or a file."""
    if not place.is_dir() or is_bag_folder(place):
        yield place
        return
    for path in sorted(place.iterdir()):
        if (path.is_dir() or path.suffix in ENDINGS) and not path.name.startswith('.'):
            yield from recordings_in(path)


def read_manifest(path: str) -> Iterator[SurveyedRecording]:
    """Yield the recordings of a CSV with the columns path, robot and optionally time, model.

    Relative paths start at the manifest's folder.

    Raises
    ------
    UnreadableFileError
        If it cannot be read as a table.
    ManifestError
        For a missing column or value, or an impossible time.
    """
    pd = pandas()
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False, skipinitialspace=True)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or str(error).splitlines()[0]
        raise UnreadableFileError(path, f'cannot be read as a table: {reason}') from None
    for name in ('path', 'robot'):
        if name not in table:
            raise ManifestError(f'{path}: there is no column {name}, must have the columns path '
                                'and robot')
    for number, row in enumerate(table.to_dict('records'), start=2):
        for name in ('path', 'robot'):
            if not row[name].strip():
                raise ManifestError(f'{path}, line {number}: {name} is empty, must be given')
        text, model = row.get('time', '').strip(), row.get('model', '').strip()
        folder = Path(path).parent
        yield SurveyedRecording(
            str(folder / row['path'].strip()), row['robot'].strip(),
            _time(path, number, text) if text else None, str(folder / model) if model else None)


def _time(path: str, line: int, text: str) -> datetime:
    pd = pandas()
    try:
        moment = pd.to_datetime(float(text), unit='s', utc=True)
    except ValueError:
        moment = pd.to_datetime(text, utc=True, errors='coerce')
    if pd.isna(moment) or moment.year < 1970:
        raise ManifestError(f'{path}, line {line}: time {text!r}, must be an ISO 8601 date such as '
                            '2026-03-04T10:00:00Z, or seconds since 1970')
    found: datetime = moment.to_pydatetime()
    return found
