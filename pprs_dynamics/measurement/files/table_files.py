# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings in tables: CSV, Parquet, MAT and NumPy files, LeRobot datasets.

A table holds `time`, `<drive>/position`, and optionally `<drive>/velocity`, `<drive>/effort`, or in
its place `<drive>/current` [A], `<drive>/temperature` or one `temperature` of all drives, and the
same of `pressure`; or what a model file's `columns` say.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import CHANNELS, Column, RecordedColumns, RecordedDrives
from pprs_dynamics.errors import UnreadableFileError, suggestion
from pprs_dynamics.measurement.files.array_files import KINDS, ArrayTable, open_arrays
from pprs_dynamics.measurement.files.csv_files import CsvTable
from pprs_dynamics.measurement.files.merged_states import at_stamps
from pprs_dynamics.measurement.files.name_hints import MOST, init_command, missing_names
from pprs_dynamics.measurement.files.samples import (
    CURRENT,
    QUANTITIES,
    Defect,
    Progress,
    Samples,
    whole_epoch,
)
from pprs_dynamics.system.plain_text import counted, first_of

# The second is what PlotJuggler writes.
TIME_COLUMNS = ('time', '__time')
# What other programs call it.
TIME_LIKE = ('t', 'ts', 'stamp', 'stamps', 'timestamp', 'timestamps', 'times', 'seconds', 'sec',
             'clock', 'rostime', 'date', 'datum', 'datetime', 'zeit', 'uhrzeit', 'zeitstempel')
# Stamps that count thousandths, millionths, ... of seconds since 1970 are of 2000 to 2100, and
# nearer to each other than this [s]: others count from the start of a machine.
DATES = 9.4e8, 4.2e9
LONGEST_STEP = 60.0
PARTS = {3: 'milli', 6: 'micro', 9: 'nano'}
Table = CsvTable | ArrayTable


def read_table(path: Path, drives: RecordedDrives, topic: str | None = None,
               progress: Progress | None = None) -> Samples:
    """Read a table, or several that make one recording.

    Parameters
    ----------
    path : Path
        .parquet, .mat (up to version 7.2), .npz, .json, a LeRobot dataset, or else CSV;
        where the model names several files, their folder or one of them.
    drives : RecordedDrives
    topic : str, optional
        Where columns have prefixes, as in `/joint_states/lift_1/position`: the one to take, if
        there are several.
    progress : callable, optional
        Called with (done, total) now and then.

    Raises
    ------
    UnreadableFileError
        Where it is no such table, a drive or a column is missing, or a cell is not a number.
    MissingLibraryError
        For Parquet without pyarrow.
    """
    columns, joints, named, shared = drives.layout, drives.joints, drives.named, None
    files = files_of(path, columns.files) if columns.files else {'position': path}
    likely = [column for column in (columns.time, columns.time_fraction, *named.values(),
                                    *columns.channels.values()) if isinstance(column, str)]
    if 'time' in files:
        table = open_table(files.pop('time'), columns.decimal, likely)
        own: Column = columns.time if columns.time is not None else next(
            (name for name in TIME_COLUMNS if name in table.names), 1)
        _require(table, [own])
        shared = table.read([own])[0]
    stamps, epoch, prefix = np.zeros(0), 0, ''
    arrays: dict[tuple[str, str], Array] = {}
    told: list[Defect] = []
    for quantity, file in sorted(files.items(), key=lambda item: item[0] != 'position'):
        table = open_table(file, columns.decimal, likely)
        time = None if shared is not None else _time_column(table, columns)
        if columns.files:
            chosen = {key: column for key, column in named.items() if key[1] == quantity}
        else:
            chosen, prefix = _chosen(table, joints, named, columns.channels, topic)
        if not chosen:
            continue
        stamped = [] if time is None else [time, columns.time_fraction or time]
        wanted = list(dict.fromkeys([*stamped, *chosen.values()]))
        _require(table, wanted)
        read = dict(zip(wanted, table.read(wanted, progress), strict=True))
        count = len(read[wanted[-1]])
        if shared is not None and count != len(shared):
            raise UnreadableFileError(file, f'it has {counted(count, "row")}, but the file of '
                                      f'times has {len(shared)}')
        seconds, start, remarks = _seconds(shared if time is None else read[time], columns, count)
        if columns.time_fraction is not None and time is not None:
            seconds = seconds + fraction_of_seconds(read[columns.time_fraction])
        series = {key: read[column] for key, column in chosen.items()}
        seconds = seconds + (start - epoch if arrays else 0)
        if not arrays:
            stamps, epoch = seconds, start
            told += remarks if columns.files else (*remarks, *_ignored(table, wanted))
        elif len(seconds) != len(stamps) or np.any(seconds != stamps):
            told.append(Defect('merged', len(stamps), f'{file.name} has times of its own'))
            whole, at = (np.rint((instants - stamps[0]) * 1e9).astype(np.int64)
                         for instants in (seconds, stamps))
            series = {key: at_stamps(at, whole, values) for key, values in series.items()}
        arrays.update(series)
    return Samples.of_columns(joints, stamps, arrays, _source(path, columns, prefix), tuple(told),
                              epoch)


def fraction_of_seconds(counts: Array) -> Array:
    """Return the seconds that whole milliseconds, microseconds or nanoseconds are, by their size.

    They are below a second, and a recording has some near to it.
    """
    most = float(np.nanmax(counts, initial=0.0))
    return counts / next((10.0 ** power for power in PARTS if most < 10.0 ** power), 1e9)


def open_table(path: Path, decimal: str = '.', likely: Sequence[str] = ()) -> Table:
    """Return a table by its first bytes; see `CsvTable.open`."""
    return open_arrays(path) or CsvTable.open(path, decimal, likely)


def _source(path: Path, columns: RecordedColumns, prefix: str = '') -> str:
    position = path / columns.files.get('position', '')
    kind = ('LeRobot' if path.is_dir() and not columns.files else
            KINDS.get(position.suffix if columns.files else path.suffix, 'CSV'))
    if columns.time is not None or any(of.names for of in columns.drives.values()):
        return f'{kind} by columns of the model file'
    return f'{kind}, {prefix}' if prefix else kind


def _time_column(table: Table, columns: RecordedColumns) -> Column | None:
    """Return the column of times; None where a rate replaces it."""
    if columns.time is not None:
        return columns.time
    if columns.rate is not None:
        return None
    time = next((name for name in TIME_COLUMNS if name in table.names), None)
    if time is not None:
        return time
    words = {re.sub('[^a-z]', '', name.lower()): name for name in reversed(table.names)}
    likely = next((words[word] for word in TIME_LIKE if word in words), None)
    # A header of one word, or of many, is no table of ours: a letter, a log.
    head = ', '.join(table.names[:6])[:80] or 'numbers alone'
    raise UnreadableFileError(
        table.path, f'not a recording in this form: the header must contain time and '
        f'<drive>/position, but is {head!r}; '
        + (f'write columns: {{time: {likely}}} in the model file, or: ' if likely else '')
        + init_command(table.path.name[:40]))


def _chosen(table: Table, joints: tuple[str, ...], named: Mapping[tuple[str, str], Column],
            channels: Mapping[str, Column], topic: str | None,
            ) -> tuple[dict[tuple[str, str], Column], str]:
    """Return the column of each joint and quantity, and the prefix of those of our own format."""
    # What is measured once for all drives.
    shared = {(joint, name): channels.get(name, name) for name in CHANNELS
              if name in channels or name in table.names for joint in joints}
    found: dict[str, dict[tuple[str, str], Column]] = {'': {}}
    for name in table.names:
        joint, slash, quantity = name.rpartition('/')
        prefix, _, drive = joint.rpartition('/')
        if slash and quantity in (*QUANTITIES, CURRENT, *CHANNELS):
            found.setdefault(prefix, {})[drive, quantity] = name
    ours = tuple(joint for joint in joints if (joint, 'position') not in named)
    prefix = _prefix(table.path, found, ours, topic) if ours else ''
    # A named current replaces an effort of our own format, and the other way round.
    chosen = {(joint, quantity): name for (joint, quantity), name in found[prefix].items()
              if joint in joints and not (quantity == 'effort' and (joint, CURRENT) in named)
              and not (quantity == CURRENT and (joint, 'effort') in {**found[prefix], **named})}
    return {**shared, **chosen, **named}, prefix


def _require(table: Table, wanted: Sequence[Column]) -> None:
    """Raise UnreadableFileError where a table lacks a column, or has two of that name."""
    for column in wanted:
        places = [str(k) for k, name in enumerate(table.names, 1) if name == column]
        if len(places) > 1:
            raise UnreadableFileError(
                table.path, f'{len(places)} columns have the name {column!r}: '
                + (f'write the number of the right one, {" or ".join(places)}'
                   if isinstance(table, CsvTable) else 'rename one of them'))
        if table.place(column) is None:
            raise UnreadableFileError(
                table.path, f'no column {column!r}{suggestion(str(column), table.names)}'
                '; it contains ' + (', '.join(sorted(table.names)[:MOST]) or (
                    f'{counted(getattr(table, "count", 0), "column")} without a header, must be '
                    'numbers from 1')))


def _seconds(stamps: Any, columns: RecordedColumns, count: int,
             ) -> tuple[Array, int, tuple[Defect, ...]]:
    """Return times [s], whole seconds that they count from, and what was made of the stamps."""
    if stamps is None:
        assert columns.rate is not None
        return np.arange(count) / columns.rate, 0, ()
    scale = columns.time_scale
    told: tuple[Defect, ...] = ()
    if scale is None:
        finite = stamps[np.isfinite(stamps)].astype(float)
        middle, step = (float(np.median(values)) if len(values) else 0.0
                        for values in (finite, np.abs(np.diff(finite))))
        power = next((power for power in PARTS if step <= LONGEST_STEP * 10.0 ** power
                      and DATES[0] < middle / 10.0 ** power < DATES[1]), 0)
        scale = 10.0 ** -power
        if power:
            told = (Defect('epoch_unit', len(stamps),
                           f'the stamps count {PARTS[power]}seconds since 1970'),)
    if stamps.dtype.kind in 'iu' and scale <= 1:
        # As floats, nanoseconds since 1970 are off by a quarter of a microsecond.
        unit = round(1 / scale)
        epoch = whole_epoch(stamps / unit)
        return (stamps - epoch * unit) / unit, epoch, told
    return stamps * scale, 0, told


def _ignored(table: Table, wanted: Sequence[Column]) -> tuple[Defect, ...]:
    every = table.names or [str(k + 1) for k in range(getattr(table, 'count', 0))]
    places = [table.place(column) for column in wanted]
    used = {every[place] if isinstance(place, int) else place[0]
            for place in places if place is not None}
    others = [name or '(no name)' for name in every if name not in used]
    if not others:
        return ()
    return (Defect('ignored_columns', len(others), f'not used: {first_of(others, 10)}'),)


def _prefix(
    path: Path, found: Mapping[str, Mapping[tuple[str, str], Column]], drives: tuple[str, ...],
    topic: str | None,
) -> str:
    """Return the prefix whose columns hold all drives."""
    if topic is not None:
        found = {prefix: columns for prefix, columns in found.items()
                 if prefix.strip('/') == topic.strip('/')}
    complete = [prefix for prefix, columns in found.items()
                if all((drive, 'position') in columns for drive in drives)]
    if not complete:
        joints = sorted(str(name).removesuffix('/position') for columns in found.values()
                        for (_, quantity), name in columns.items() if quantity == 'position')
        known = {joint.rpartition('/')[2] for joint in joints}
        missing = [drive for drive in drives if drive not in known] or list(drives)
        raise UnreadableFileError(
            path, f'no {", ".join(f"{drive}/position" for drive in missing[:MOST])}'
            + (f' under {topic}' if topic else '') + '; there are positions of '
            + (', '.join(joints[:MOST]) or 'no joint')
            + f'; {missing_names(drives, known, path.name[:40])}')
    # The plain names are the format; prefixes are a courtesy to other tools.
    if '' in complete:
        return ''
    if len(complete) > 1:
        raise UnreadableFileError(
            path, f'there are the drives of {", ".join(complete)}: choose one with --topic')
    return complete[0]


def files_of(path: Path, names: Mapping[str, str]) -> dict[str, Path]:
    """Return the files that make a recording, by quantity.

    Parameters
    ----------
    path : Path
        Their folder, or one of them.
    names : mapping
        By quantity; * is the part in which recordings of one folder differ.

    Raises
    ------
    UnreadableFileError
        Where one is missing, or several fit.
    """
    if path.is_dir():
        folder, star = path, None
        if '*' in names['position']:
            fitting = sorted(folder.glob(names['position']))
            if len(fitting) != 1:
                raise UnreadableFileError(
                    path, f'{counted(len(fitting), "file")} of the name {names["position"]}: name '
                    'one of them instead of the folder')
            return files_of(fitting[0], names)
    else:
        folder = path.parent
        fits = filter(None, (re.fullmatch(
            re.escape(Path(name).name).replace(r'\*', '(.*)'), path.name)
            for name in names.values()))
        # Of q*.csv and qd*.csv the second is what qd_run.csv is.
        fit = min(fits, key=lambda fit: sum(map(len, fit.groups())), default=None)
        if fit is None:
            raise UnreadableFileError(
                path, f'its name must match one of {", ".join(names.values())}, the files of one '
                'recording by columns.files: write * there for the part that differs between '
                'recordings, as in q_*.csv')
        star = next(iter(fit.groups()), None)
        if len(Path(names['position']).parts) > 1:  # they may lie in folders of their own
            folder = folder.parent
    found = {quantity: folder / name.replace('*', star or '') for quantity, name in names.items()}
    for quantity, file in found.items():
        if not file.is_file():
            raise UnreadableFileError(file, f'no such file, which columns.files.{quantity} names')
    return found
