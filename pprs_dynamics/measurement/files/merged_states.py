# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""States of joints that stand in any messages, collected, and brought to the same stamps.

A message may have some drives each, or efforts alone; messages of any type are read by the fields
that a model file names.
"""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import CHANNELS, RecordedDrives
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.bag_storage import Bag, damaged
from pprs_dynamics.measurement.files.joint_states import deserialized, stamp_of, states_of
from pprs_dynamics.measurement.files.name_hints import MOST
from pprs_dynamics.measurement.files.samples import Indices, Progress

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

LONGEST_STEP = 1.6  # median steps between two samples, over which nothing is interpolated
REPORTED = 8192  # messages between two reports of progress
# In the place of a topic: of fields that the model file names, and of channels on all topics.
NAMED, EVERY = '', '*'
Key = tuple[str, str]  # a joint and a quantity


class Field(NamedTuple):
    """A number in messages of any type: its topic, and the way to it, as `data[2]`."""

    topic: str
    way: str
    joint: str
    quantity: str


def fields_of(bag: Bag, recorded: RecordedDrives) -> list[Field]:
    """Return the columns of a model file that are fields of messages: `/topic.field[2]`.

    Of std_msgs' arrays `/topic[2]` is enough.
    """
    topics = sorted({c.topic for c in bag.connections}, key=len, reverse=True)
    shared = {(joint, quantity): column for joint in recorded.joints
              for quantity, column in recorded.layout.channels.items()}
    found = []
    for (joint, quantity), column in {**shared, **recorded.named}.items():
        name = str(column)
        if not name.startswith('/'):
            continue
        topic = next((known for known in topics if name.startswith(known)
                      and name[len(known):][:1] in ('.', '[')), None)
        if topic is None:
            raise UnreadableFileError(bag.path, f'no topic of the column {name}; it contains '
                                      + ', '.join(sorted(topics)[:MOST]))
        way = name[len(topic):]
        found.append(Field(topic, f'data{way}' if way.startswith('[') else way[1:], joint,
                           quantity))
    return found


def _value(message: Any, way: str) -> float:
    """Return a number of a message; NaN where it has none there."""
    for name, element in re.findall(r'([^.\[\]]+)|\[(\d+)\]', way):
        try:
            message = getattr(message, name) if name else message[int(element)]
        except (AttributeError, IndexError, TypeError):
            return math.nan
    return float(message) if isinstance(message, (int, float, np.number)) else math.nan


class Signal(NamedTuple):
    """A quantity of a joint: numbers of the messages, values, and whether these are commands."""

    messages: Indices
    values: Array
    is_command: bool


NOTHING = Signal(np.zeros(0, dtype=np.int64), np.zeros(0), False)


class States:
    """States of joints, collected from messages.

    Parameters
    ----------
    joints : tuple of D str
        What messages call the drives.
    fields : sequence of Field
        Of messages of any type: they replace what is found otherwise.

    Attributes
    ----------
    counts : mapping of str to int
        Messages by topic, also those that cannot be decoded.
    """

    def __init__(self, joints: tuple[str, ...], fields: Sequence[Field] = ()) -> None:
        self.joints, self.fields = joints, fields
        self.counts: Counter[str] = Counter()
        self._times: list[tuple[str, int, int]] = []  # topic, stamp, and when it was received
        self._rows: dict[tuple[str, tuple[str, ...], str, bool], list[tuple[int, Any]]] = (
            defaultdict(list))

    def collect(self, bag: Bag, connections: Sequence[Connection],
                progress: Progress | None = None, channels: bool = False) -> None:
        """Take in the messages of some topics, of all quantities or of channels alone.

        Raises
        ------
        UnreadableFileError
            Where messages are damaged.
        """
        types = bag.types(connections)
        total = sum(connection.msgcount for connection in connections)
        for done, (connection, received, data) in enumerate(bag.messages(connections), 1):
            self.counts[connection.topic] += 1
            message = deserialized(types, data, connection.msgtype)
            try:
                if message is not None:
                    self.add(connection.topic, connection.msgtype, message, received, channels)
            except (AttributeError, TypeError, ValueError) as error:
                raise UnreadableFileError(bag.path, damaged(error)) from None
            if progress is not None and (done % REPORTED == 0 or done == total):
                progress(done, max(total, done))

    def add(self, topic: str, kind: str, message: Any, received: int,
            channels: bool = False) -> None:
        """Take in a message, and the time of its recording [ns]; see `collect`."""
        number = len(self._times)
        self._times.append((topic, stamp_of(message), received))
        for names, quantity, values, is_command in states_of(
                message, kind, topic if channels else '', self.joints):
            if not channels or quantity in CHANNELS:
                self._rows[EVERY if channels else topic, names, quantity, is_command].append(
                    (number, values))
        for field in self.fields:
            if field.topic == topic and not channels:
                self._rows[NAMED, (field.joint,), field.quantity, False].append(
                    (number, (_value(message, field.way),)))

    @property
    def names(self) -> set[tuple[str, ...]]:
        """Joints that one message or another names."""
        return {names for topic, names, *_ in self._rows if topic != EVERY}

    def topics_of(self, signals: Mapping[Key, Signal]) -> str:
        """Return the topics of signals, for a sentence."""
        return ', '.join(sorted({self._times[n][0] for signal in signals.values()
                                 for n in signal.messages[:1]}))

    def signals(self, first: str, path: Path) -> dict[Key, Signal]:
        """Return each quantity of the joints: of the first topic, else of the only one that has it.

        Raises
        ------
        UnreadableFileError
            Where several other topics have it.
        """
        parts: dict[Key, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
        for (topic, names, quantity, is_command), rows in self._rows.items():
            numbers, values = (np.array(part) for part in zip(*rows, strict=True))
            for joint, column in zip(names, values.T, strict=True):
                if joint in ('', *self.joints) and names.count(joint) == 1 and (
                        quantity == 'position' or np.isfinite(column).any()):
                    parts[joint, quantity][topic].append((numbers, column, is_command))
        found = {}
        for (joint, quantity), topics in parts.items():
            chosen = next((known for known in (NAMED, first, EVERY) if known in topics), None)
            if chosen is None and len(topics) > 1:
                listed = sorted(topics)
                raise UnreadableFileError(
                    path, f'{", ".join(listed)} each have the {quantity} of {joint}: write '
                    f'columns: {{{joint}: {{{quantity}: "{listed[0]}.{quantity}[K]"}}}} in the '
                    'model file, K the place of the joint in the message from 0')
            own: Any = topics[next(iter(topics)) if chosen is None else chosen]
            messages, columns, are_commands = map(list, zip(*own, strict=True))
            unique, at = np.unique(np.concatenate(messages), return_index=True)
            found[joint, quantity] = Signal(unique, np.concatenate(columns)[at], any(are_commands))
        return found

    @property
    def stamped(self) -> set[str]:
        """Topics on which some message has a stamp in its header."""
        return {topic for topic, stamp, _ in self._times if stamp}

    def together(self, signals: Mapping[Key, Signal]) -> tuple[Indices, dict[Key, Array], bool]:
        """Bring signals to the messages that have the positions of all joints.

        Where there are none, to the stamps of the first joint's positions.

        Returns
        -------
        stamps : (N,) array of int
            [ns]; of a topic without any, the times of recording.
        columns : dict of (N,) arrays
            NaN where nothing is known. A channel counts for the next sample alone.
        are_whole : bool
            Whether each sample is one message, with all quantities but channels.
        """
        stamped = self.stamped
        times = np.array([stamp if topic in stamped else received
                          for topic, stamp, received in self._times], dtype=np.int64)
        positions = [signals.get((joint, 'position'), NOTHING).messages for joint in self.joints]
        whole: Indices = reduce(np.intersect1d, positions)
        are_whole = len(whole) > 0
        stamps = times[whole] if are_whole else np.unique(times[positions[0]])
        order = np.argsort(stamps, kind='stable')
        columns = {}
        for (joint, quantity), (messages, values, _) in signals.items():
            column = columns[joint, quantity] = np.full(len(stamps), np.nan)
            if np.any(here := np.isin(whole, messages)):
                column[here] = values[np.isin(messages, whole)]
                continue
            known = np.isfinite(values)
            if quantity in CHANNELS:
                at = np.searchsorted(stamps, times[messages[known]], sorter=order)
                column[order[np.minimum(at, len(stamps) - 1)]] = values[known]
            else:
                column[:] = at_stamps(stamps, times[messages[known]], values[known])
                are_whole = False
        return stamps, columns, are_whole


def at_stamps(stamps: Indices, times: Sequence[int] | Indices,
              values: Sequence[float] | Array) -> Array:
    """Return a series at other stamps: exact where they are the same, else between neighbours."""
    if len(times) < 2:
        alone = np.full(len(stamps), np.nan)
        alone[np.isin(stamps, times)] = values
        return alone
    known, first = np.unique(np.array(times, dtype=np.int64), return_index=True)
    numbers = np.array(values)[first]
    # Counted from the first: seconds since 1970 would lose digits as floats.
    x, at = (known - known[0]).astype(float), (stamps - known[0]).astype(float)
    found: Array = np.interp(at, x, numbers, left=np.nan, right=np.nan)
    step = float(np.median(np.diff(x)))
    after = np.clip(np.searchsorted(x, at), 1, len(x) - 1)
    wide = (x[after] - x[after - 1] > LONGEST_STEP * step) & ~np.isin(stamps, known)
    found[wide] = np.nan
    return found
