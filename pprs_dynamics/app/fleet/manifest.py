# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Manifest of a fleet: recordings, their robots, times and conditions.

A manifest is a CSV file with the columns path, robot and time, optionally model; every further
column is a condition, a number that trends can be drawn beside. Paths are files or whatever
fsspec reaches, such as s3://bucket/name.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any

from pprs_dynamics.errors import MissingLibraryError, PprsError, UnreadableFileError
from pprs_dynamics.system.csv_tables import read_rows
from pprs_dynamics.system.numbers import parse_number

ENDINGS = ('.csv', '.mcap', '.db3')
BAG = 'metadata.yaml'  # a folder that holds it is a rosbag2 recording
LATEST = 2 ** 63 / 1e9  # [s], of 2262: readers of Parquet count nanoseconds, pandas for one
KNOWN = ('path', 'robot', 'time', 'model')


class ManifestError(PprsError, ValueError):
    """A manifest that says something impossible."""

    def __init__(self, path: str, line: int, found: str, rule: str) -> None:
        super().__init__(f'{path}, line {line}: {found}, must {rule}')


@dataclass(frozen=True)
class ManifestEntry:
    """One recording.

    Parameters
    ----------
    path : str
        Of a file or a bag's folder, or an address that fsspec knows.
    robot : str
    time : float, optional
        Seconds since 1970; None: from the recording's own stamps.
    model : str, optional
        Model file of this recording; None: that of the survey.
    conditions : dict of str to float
        What else was known, e.g. a temperature.
    """

    path: str
    robot: str
    time: float | None = None
    model: str | None = None
    conditions: dict[str, float] = field(default_factory=dict)


def read_manifest(path: str) -> Iterator[ManifestEntry]:
    """Yield the recordings of a manifest; relative paths start at its folder.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read.
    ManifestError
        For a missing column or value, or a time that is none.
    """
    rows = read_rows(path)
    _, header = next(rows, (1, []))
    missing = [name for name in KNOWN[:2] if name not in header]
    if missing:
        raise ManifestError(path, 1, f'there is no column {missing[0]}',
                            'have the columns path and robot')
    for line, cells in rows:
        yield _entry(path, line, dict(zip(header, cells, strict=False)))


def _entry(path: str, line: int, row: dict[str, str]) -> ManifestEntry:
    def given(name: str) -> str:
        return row.get(name, '').strip()

    for name in KNOWN[:2]:
        if not given(name):
            raise ManifestError(path, line, f'{name} is empty', 'be given')
    conditions = {name: value for name, text in row.items()
                  if name and name not in KNOWN and (value := _number(text)) is not None}
    return ManifestEntry(
        _beside(path, given('path')), given('robot'),
        read_time(path, line, given('time')) if given('time') else None,
        _beside(path, given('model')) if given('model') else None, conditions)


def _beside(manifest: str, path: str) -> str:
    return path if is_remote(path) else str(Path(manifest).parent / path)


def _number(text: str) -> float | None:
    try:
        value = parse_number(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def read_time(path: str, line: int, text: str) -> float:
    """Return seconds since 1970 of an ISO 8601 date (UTC unless it says otherwise) or a number."""
    value = _number(text)
    if value is None:
        try:
            moment = datetime.fromisoformat(text)
        except ValueError:
            moment = None
        if moment is not None:
            value = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    if value is None or not 0 <= value < LATEST:
        raise ManifestError(path, line, f'time {text!r}', 'be an ISO 8601 date such as '
                            '2026-03-04T10:00:00Z, or seconds since 1970')
    return value


def is_remote(path: str) -> bool:
    """Return whether a path is an address for fsspec."""
    return '://' in path


def filesystem(path: str) -> tuple[Any, str]:
    """Return fsspec's file system of a path, and the path within it.

    Raises
    ------
    UnreadableFileError
        For an address that fsspec does not know, or that needs a library that is not there.
    """
    try:
        import fsspec
    except ImportError:
        raise MissingLibraryError('fsspec', 'a survey', 'fleet') from None
    try:
        system, within = fsspec.core.url_to_fs(path)
    except (ValueError, ImportError) as error:
        raise UnreadableFileError(path, str(error)) from None
    return system, within


@contextmanager
def reached(path: str) -> Iterator[None]:
    """Turn what libraries of file systems raise, and they raise what they like, into one sentence.

    Raises
    ------
    UnreadableFileError
    """
    try:
        yield
    except PprsError:
        raise
    except OSError as error:
        raise UnreadableFileError(path, error.strerror or str(error)) from None
    except Exception as error:
        if not is_remote(path):
            raise
        raise UnreadableFileError(path, f'cannot be reached: {error}') from None


def find_recordings(patterns: Sequence[str]) -> Iterator[ManifestEntry]:
    """Yield what files, folders and globs hold; a robot is called as the folder is.

    Raises
    ------
    UnreadableFileError
        Where one matches nothing.
    """
    for pattern in patterns:
        found = False
        for path in _matching(pattern):
            found = True
            folder = PurePosixPath(path.rpartition('://')[2]).parent.name
            yield ManifestEntry(path, folder or 'robot')
        if not found:
            raise UnreadableFileError(pattern or "''", 'there is no recording: no file, no '
                                      f'folder with {", ".join(ENDINGS)} or bags, and no match')


def _matching(pattern: str) -> Iterator[str]:
    if not pattern:  # which would be the present folder
        return
    system, root = filesystem(pattern)
    named = system.unstrip_protocol if is_remote(pattern) else str
    with reached(pattern):
        is_glob = any(c in root for c in '*?[') and not system.exists(root)
        places = sorted(system.glob(root)) if is_glob else [root]
        for place in places:
            if system.isdir(place):
                yield from map(named, _within(system, place))
            elif system.exists(place):
                yield named(place)


def _within(system: Any, folder: str) -> Iterator[str]:
    for place, folders, files in system.walk(folder):
        if BAG in files:
            folders.clear()
            yield place
            continue
        folders.sort() if isinstance(folders, list) else None
        for name in sorted(files):
            if name.endswith(ENDINGS):
                yield f'{place.rstrip("/")}/{name}'


def entries(patterns: Sequence[str], manifest: str | None) -> Iterator[ManifestEntry]:
    """Yield the recordings of a survey: all of a manifest, or what patterns match.

    With both, the manifest describes what the patterns match; what it does not list is called as
    without it.
    """
    if manifest is None:
        yield from find_recordings(patterns)
    elif not patterns:
        yield from read_manifest(manifest)
    else:
        known = {_full(entry.path): entry for entry in read_manifest(manifest)}
        for entry in find_recordings(patterns):
            listed = known.get(_full(entry.path))
            yield entry if listed is None else listed


def _full(path: str) -> str:
    return path if is_remote(path) else str(Path(path).absolute())
