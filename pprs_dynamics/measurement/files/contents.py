# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Contents of a file, read without a model: joints of messages, and columns of tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.measurement.files.array_files import WIDEST
from pprs_dynamics.measurement.files.bag_files import CONTROLLER_TYPES
from pprs_dynamics.measurement.files.bag_storage import Bag, is_bag, opened_bag
from pprs_dynamics.measurement.files.csv_files import CsvTable
from pprs_dynamics.measurement.files.joint_states import JOINT_STATE, states_of
from pprs_dynamics.measurement.files.samples import Series
from pprs_dynamics.measurement.files.table_files import open_table
from pprs_dynamics.system.files import readable

ROWS = 4000  # that are looked at
MESSAGES = 400  # of each topic


@dataclass(frozen=True)
class Contents:
    """Contents of a file.

    Parameters
    ----------
    joints : mapping of str to mapping of str to set of str
        By topic: joints with the quantities that are finite in some message.
    series : tuple of Series
        Columns with numbers in them.
    decimal : str
        What is between the whole and the rest of a number.
    """

    joints: Mapping[str, Mapping[str, set[str]]] = field(default_factory=dict)
    series: tuple[Series, ...] = ()
    decimal: str = '.'


def look_into(path: Path) -> Contents:
    """Return the topics, columns and drives of a recording.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read.
    MissingLibraryError
        Where the library for it is not installed.
    """
    if is_bag(path):
        with readable(path), opened_bag(path) as (bag, _):
            return Contents(_joints(bag), tuple(_arrays(bag)))
    table = open_table(path)
    if isinstance(table, CsvTable) and table.numbers < len(table.sample):
        with_commas = CsvTable.open(path, ',')
        table = with_commas if with_commas.numbers > table.numbers else table
    return Contents(series=tuple(table.series(ROWS)), decimal=table.decimal)


def _joints(bag: Bag) -> dict[str, dict[str, set[str]]]:
    found: dict[str, dict[str, set[str]]] = {}
    for topic, kind, messages in _topics(bag, (JOINT_STATE, *CONTROLLER_TYPES)):
        of_topic = found.setdefault(topic, {})
        for message in messages:
            for names, quantity, values, _ in states_of(message, kind, topic):
                for joint in np.array(names)[np.isfinite(values)].tolist():
                    of_topic.setdefault(joint, set()).add(quantity)
    return {topic: joints for topic, joints in found.items() if joints}


def _arrays(bag: Bag) -> Iterator[Series]:
    """Yield the elements of std_msgs' arrays of numbers."""
    kinds = {c.msgtype for c in bag.connections if c.msgtype.endswith('MultiArray')}
    for topic, _, messages in _topics(bag, tuple(kinds)):
        rows = [np.asarray(message.data, dtype=float) for message in messages]
        count = min((len(row) for row in rows), default=0)
        for k in range(min(count, WIDEST)):
            yield Series(f'{topic}[{k}]', f'{topic}[{k}]', np.array([row[k] for row in rows]))


def _topics(bag: Bag, kinds: tuple[str, ...]) -> Iterator[tuple[str, str, list[Any]]]:
    """Yield topics of some types: name, type, first messages."""
    for topic in sorted({c.topic for c in bag.connections if c.msgtype in kinds}):
        own = [c for c in bag.connections if c.topic == topic and c.msgtype in kinds]
        yield topic, own[0].msgtype, [message for *_, message in bag.decoded(own, MESSAGES)]
