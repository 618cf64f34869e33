# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Joint states that stand in several messages, topics or types, merged by their stamps.

sensor_msgs/JointState of some drives each, or with efforts on a topic of their own;
control_msgs/DynamicJointState; control_msgs/JointTrajectoryControllerState; messages of any type by
the fields that a model file names. Definitions of all but the first are those that the bag carries.

Temperatures and pressures are in messages of sensor_msgs, in numbers and joint states on topics
with such a name, and in interfaces of dynamic joint states. They belong to the drive that their
topic or frame names, or to all drives.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import CHANNELS, RecordedDrives
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.bag_storage import Bag, damaged
from pprs_dynamics.measurement.files.joint_states import JOINT_STATE
from pprs_dynamics.measurement.files.name_hints import MOST
from pprs_dynamics.measurement.files.samples import (
    CURRENT,
    QUANTITIES,
    Defect,
    Indices,
    Samples,
    whole_epoch,
)

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

DYNAMIC = 'control_msgs/msg/DynamicJointState'
CONTROLLER = 'control_msgs/msg/JointTrajectoryControllerState'
# Interfaces of ros2_control.
INTERFACES = {'position': 'position', 'velocity': 'velocity', 'effort': 'effort',
              'torque': 'effort', 'force': 'effort', 'current': CURRENT,
              **{name: name for name in CHANNELS}}
# Messages of one sensor, and their field.
SENSORS = {'sensor_msgs/msg/Temperature': ('temperature', 'temperature'),
           'sensor_msgs/msg/FluidPressure': ('pressure', 'fluid_pressure')}
NUMBERS = ('std_msgs/msg/Float32', 'std_msgs/msg/Float64')
LONGEST_STEP = 1.6  # median steps between two samples, over which nothing is interpolated


class Field(NamedTuple):
    """A number in messages of any type: its topic, and the way to it, as `data[2]`."""

    topic: str
    way: str
    joint: str
    quantity: str


Fields = Sequence[Field]


class Series(NamedTuple):
    """Numbers on one topic: their stamps [ns], values, and whether they are commands."""

    times: list[int]
    values: list[float]
    is_command: bool


NONE = Series([], [], False)


def fields_of(bag: Bag, recorded: RecordedDrives) -> list[Field]:
    """Return the columns of a model file that are fields of messages: `/topic.field[2]`.

    Of std_msgs' arrays `/topic[2]` is enough.
    """
    topics = sorted({c.topic for c in bag.connections}, key=len, reverse=True)
    columns = recorded.columns.drives if recorded.columns is not None else {}
    shared = recorded.columns.channels if recorded.columns is not None else {}
    found = []
    for joint, drive in zip(recorded.joints or recorded.names, recorded.names, strict=True):
        own = columns[drive].names if drive in columns else {}
        for quantity, column in {**shared, **own}.items():
            name = str(column)
            if not name.startswith('/'):
                continue
            topic = next((known for known in topics if name.startswith(known)
                          and name[len(known):][:1] in ('.', '[')), None)
            if topic is None:
                raise UnreadableFileError(
                    bag.path, f'no topic of the column {name}; it contains '
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


def read_merged(bag: Bag, connections: list[Connection], drives: tuple[str, ...],
                findings: Sequence[Defect], fields: Fields = ()) -> Samples:
    """Return the states of all drives at the stamps of the first one's positions.

    Each quantity of a drive is read from one topic.

    Parameters
    ----------
    bag : Bag
    connections : list of Connection
        Topics that are read; the first has precedence.
    drives : tuple of D str
    findings : sequence of Defect
        Remarks that the samples get, too.
    fields : sequence of Field
        Of messages of any type.

    Raises
    ------
    UnreadableFileError
        If several topics without precedence have the same quantity, some drive has no positions,
        or messages are damaged.
    """
    series: dict[tuple[str, str], dict[str, Series]] = defaultdict(dict)
    named = {(field.joint, field.quantity) for field in fields}
    for connection, received, message in bag.decoded(connections):
        stamp = stamp_of(message) or received
        states = [(field.joint, field.quantity, _value(message, field.way), False)
                  for field in fields if field.topic == connection.topic]
        try:
            states += [state for state in states_of(message, connection.msgtype)
                       if state[:2] not in named and state[1] not in CHANNELS]
        except (AttributeError, TypeError, ValueError) as error:
            raise UnreadableFileError(bag.path, damaged(error)) from None
        for joint, quantity, value, is_command in states:
            if joint in drives and np.isfinite(value):
                of_topic = series[joint, quantity].setdefault(
                    connection.topic, Series([], [], is_command))
                of_topic.times.append(stamp)
                of_topic.values.append(float(value))
    chosen = {key: _only(bag, key, topics, connections[0].topic)
              for key, topics in series.items()}
    for drive in drives:
        if (drive, 'effort') in chosen:
            chosen.pop((drive, CURRENT), None)
    stamps = np.unique(np.array(chosen.get((drives[0], 'position'), NONE).times, dtype=np.int64))
    columns = {key: at_stamps(stamps, *found[:2]) for key, found in chosen.items()}
    none = np.full(len(stamps), np.nan)
    kept = np.isfinite([columns.get((drive, 'position'), none) for drive in drives]).all(axis=0)
    topics = ', '.join(sorted({connection.topic for connection in connections}))
    if not np.any(kept):
        raise UnreadableFileError(bag.path, f'{topics} contains no positions of all of '
                                  f'{", ".join(drives)} at the same times')
    told = [*findings, Defect('merged', int(kept.sum()), f'merged by stamp from {topics}')]
    if any(found.is_command for found in chosen.values()):
        told.append(Defect('commanded_efforts', int(kept.sum()), 'the efforts are what the '
                           'controller commands: none were measured'))
    epoch = whole_epoch(stamps / 1e9)
    return Samples.of_columns(
        drives, (stamps[kept] - epoch * 10**9) / 1e9,
        {key: values[kept] for key, values in columns.items()}, f'bag, {topics}', tuple(told),
        epoch)


def _only(bag: Bag, key: tuple[str, str], topics: dict[str, Series], first: str) -> Series:
    """Return the series of a quantity on the first topic, else on the only other one."""
    if first in topics:
        return topics[first]
    if len(topics) > 1:
        joint, quantity = key
        listed = sorted(topics)
        raise UnreadableFileError(
            bag.path, f'{", ".join(listed)} each have the {quantity} of {joint}: write columns: '
            f'{{{joint}: {{{quantity}: "{listed[0]}.{quantity}[K]"}}}} in the model file, K the '
            'place of the joint in the message from 0')
    return next(iter(topics.values()))


def stamp_of(message: Any) -> int:
    """Return the stamp of a message's header [ns], 0 where it has none."""
    header = getattr(message, 'header', None)
    return 0 if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec


def channel_of(topic: str, kind: str) -> str | None:
    """Return the channel that messages of a topic are of, by their type or the topic's name."""
    if kind in SENSORS:
        return SENSORS[kind][0]
    return next((name for name in CHANNELS if name in topic.lower()), None) if (
        kind in (*NUMBERS, JOINT_STATE)) else None


def states_of(message: Any, kind: str, topic: str = '', joints: Sequence[str] = (),
              ) -> Iterator[tuple[str, str, float, bool]]:
    """Yield joint, quantity, value, and whether that is a command, of one message.

    Of a sensor for all drives the joint is empty; else its topic or frame names one of `joints`.
    """
    channel = channel_of(topic, kind)
    if kind in (*SENSORS, *NUMBERS) and channel:
        frame = message.header.frame_id if kind in SENSORS else ''
        parts = {part.removesuffix(f'_{channel}') for part in (*topic.split('/'), frame)}
        value = float(getattr(message, SENSORS[kind][1] if kind in SENSORS else 'data'))
        yield next((joint for joint in joints if joint in parts), ''), channel, value, False
    elif kind == JOINT_STATE:
        names, arrays = message.name, [getattr(message, quantity) for quantity in QUANTITIES]
        given = [(channel or quantity, array) for quantity, array in zip(
            QUANTITIES, arrays, strict=True) if len(array) == len(names)]
        for quantity, array in given[:1] if channel else given:
            for joint, value in zip(names, array, strict=True):
                yield joint, quantity, value, False
    elif kind == DYNAMIC:
        for joint, state in zip(message.joint_names, message.interface_values, strict=False):
            for interface, value in zip(state.interface_names, state.values, strict=False):
                if interface in INTERFACES:
                    yield joint, INTERFACES[interface], value, False
    elif kind == CONTROLLER:
        measured, output = message.feedback, message.output
        is_command = not len(measured.effort)
        for quantity, array in (('position', measured.positions),
                                ('velocity', measured.velocities),
                                ('effort', output.effort if is_command else measured.effort)):
            if len(array) == len(message.joint_names):
                for joint, value in zip(message.joint_names, array, strict=True):
                    yield joint, quantity, value, quantity == 'effort' and is_command


def read_channels(bag: Bag, joints: tuple[str, ...], stamps: Indices) -> dict[str, Array]:
    """Return further channels of a bag, (N, D) by name, NaN between messages.

    Parameters
    ----------
    bag : Bag
    joints : tuple of D str
        What the bag calls the drives.
    stamps : (N,) array of int
        Of the samples [ns]; a message counts for the one that is next.
    """
    def has_channels(connection: Connection) -> bool:
        if connection.msgtype != DYNAMIC:
            return channel_of(connection.topic, connection.msgtype) is not None
        return any(quantity in CHANNELS for *_, message in bag.decoded([connection], 1)
                   for _, quantity, *_ in states_of(message, DYNAMIC))

    chosen = [connection for connection in bag.connections if has_channels(connection)]
    if not chosen or not len(stamps):
        return {}
    order = np.argsort(stamps, kind='stable')
    series: dict[tuple[str, str], list[tuple[int, float]]] = defaultdict(list)
    for connection, received, message in bag.decoded(chosen):
        for joint, quantity, value, _ in states_of(message, connection.msgtype, connection.topic,
                                                   joints):
            if quantity in CHANNELS and joint in ('', *joints) and np.isfinite(value):
                series[quantity, joint].append((stamp_of(message) or received, float(value)))
    found: dict[str, Array] = {}
    # What a drive has of its own counts for more than what is measured for all.
    for (channel, joint), read in sorted(series.items(), key=lambda item: bool(item[0][1])):
        array = found.setdefault(channel, np.full((len(stamps), len(joints)), np.nan))
        place = joints.index(joint) if joint else slice(None)
        times, values = zip(*read, strict=True)
        rows = order[np.minimum(np.searchsorted(stamps, times, sorter=order), len(stamps) - 1)]
        column = np.full(len(stamps), np.nan)
        column[rows] = values
        array[:, place] = column[:, None] if not joint else column
    return found


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
