# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a file holds, looked into without a model: joints of messages, and columns of tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import Column
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.array_files import ArrayTable, is_lerobot
from pprs_dynamics.measurement.files.bag_files import CONTROLLER_TYPES
from pprs_dynamics.measurement.files.bag_storage import Bag, is_storage, opened_bag
from pprs_dynamics.measurement.files.csv_files import CsvTable
from pprs_dynamics.measurement.files.joint_state_cdr import JOINT_STATE
from pprs_dynamics.measurement.files.merged_states import states_of
from pprs_dynamics.measurement.files.table_files import open_table

ROWS = 4000  # that are looked at
MESSAGES = 400  # of each topic
WIDEST = 64  # elements of a list that may be joints


@dataclass(frozen=True)
class Series:
    """One column of a table, or one element of messages that are arrays.

    Parameters
    ----------
    column : str or int
        As a model file names it.
    title : str
        What it is called, for people; empty where it has no name.
    values : (n,) array
        Its first numbers.
    """

    column: Column
    title: str
    values: Array


@dataclass(frozen=True)
class Contents:
    """What a file holds.

    Parameters
    ----------
    joints : mapping of str to mapping of str to set of str
        By topic: joints with the quantities that are finite in some message.
    series : tuple of Series
        Columns with numbers in them.
    decimal : str
        What is between the whole and the rest of a number.
    has_header : bool
    """

    joints: Mapping[str, Mapping[str, set[str]]] = field(default_factory=dict)
    series: tuple[Series, ...] = ()
    decimal: str = '.'
    has_header: bool = True


def look_into(path: Path) -> Contents:
    """Return what a recording holds.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read.
    MissingLibraryError
        Where the library for it is not installed.
    """
    try:
        if not is_lerobot(path) and is_storage(path):
            with opened_bag(path) as (bag, _):
                return Contents(_joints(bag), tuple(_arrays(bag)))
        if not path.is_dir() and not path.stat().st_size:
            raise UnreadableFileError(path, 'the file is empty')
    except OSError as error:
        if isinstance(error, UnreadableFileError):
            raise
        raise UnreadableFileError(path, error.strerror or str(error)) from None
    table = open_table(path)
    if isinstance(table, ArrayTable):
        return Contents(series=tuple(_elements(table)))
    if table.separator == ';' and _has_decimal_commas(table):
        table = CsvTable.open(path, ',')
    columns = table.head(ROWS)
    return Contents(
        series=tuple(Series(name or place + 1, name, values) for place, (name, values) in enumerate(
            zip(table.names or [''] * len(columns), columns, strict=True))
            if np.isfinite(values).any()),
        decimal=table.decimal, has_header=bool(table.names))


def _has_decimal_commas(table: CsvTable) -> bool:
    return any(',' in cell for cell in table.sample) and not any(
        '.' in cell for cell in table.sample)


def _joints(bag: Bag) -> dict[str, dict[str, set[str]]]:
    found: dict[str, dict[str, set[str]]] = {}
    for topic, kind, messages in _topics(bag, (JOINT_STATE, *CONTROLLER_TYPES)):
        of_topic = found.setdefault(topic, {})
        for message in messages:
            for joint, quantity, value, _ in states_of(message, kind):
                if np.isfinite(value):
                    of_topic.setdefault(joint, set()).add(quantity)
    return {topic: joints for topic, joints in found.items() if joints}


def _arrays(bag: Bag) -> Iterator[Series]:
    """Yield the elements of std_msgs' arrays of numbers."""
    kinds = {one.msgtype for one in bag.connections if one.msgtype.endswith('MultiArray')}
    for topic, _, messages in _topics(bag, tuple(kinds)):
        rows = [np.asarray(message.data, dtype=float) for message in messages]
        count = min((len(row) for row in rows), default=0)
        for k in range(min(count, WIDEST)):
            yield Series(f'{topic}[{k}]', f'{topic}[{k}]', np.array([row[k] for row in rows]))


def _topics(bag: Bag, kinds: tuple[str, ...]) -> Iterator[tuple[str, str, list[Any]]]:
    """Yield topics of some types: name, type, first messages."""
    for topic in sorted({one.topic for one in bag.connections if one.msgtype in kinds}):
        own = [one for one in bag.connections if one.topic == topic and one.msgtype in kinds]
        yield topic, own[0].msgtype, [message for *_, message in bag.decoded(own, MESSAGES)]


def _elements(table: ArrayTable) -> Iterator[Series]:
    for name in table.names:
        try:
            values = np.squeeze(np.asarray(table.load([name])[name]))
            if np.issubdtype(values.dtype, np.datetime64):
                values = values.astype('datetime64[ns]').astype(np.int64)
            if values.dtype.kind == 'c':
                values = values.real if not np.any(values.imag) else values.astype(str)
            values = values.astype(float)
        except (TypeError, ValueError):  # words, pictures
            continue
        if values.ndim == 1 and len(values) > 1:
            yield Series(name, name, values[:ROWS])
        elif values.ndim == 2:
            values = values.T if values.shape[0] < values.shape[1] else values
            labels = table.labels.get(name, ())
            for k in range(values.shape[1] if values.shape[1] <= WIDEST else 0):
                title = f'{name} {labels[k]}' if len(labels) == values.shape[1] else f'{name}[{k}]'
                yield Series(f'{name}[{k}]', title, values[:ROWS, k])
