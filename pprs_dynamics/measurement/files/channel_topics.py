# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Further channels of drives in bags: temperatures and pressures.

Messages of type sensor_msgs/Temperature and sensor_msgs/FluidPressure have one number. So have
numbers of std_msgs on topics with such a name. They belong to the drive that their topic or frame
names, and to all drives where it names none. A sensor_msgs/JointState on a topic with such a name
has one number a joint, a control_msgs/DynamicJointState an interface of that name.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import CHANNELS
from pprs_dynamics.measurement.files.bag_storage import Bag
from pprs_dynamics.measurement.files.joint_state_cdr import JOINT_STATE, message_types
from pprs_dynamics.measurement.files.merged_states import DYNAMIC, stamp_of
from pprs_dynamics.measurement.files.samples import QUANTITIES, Indices, Samples

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

# Messages of one sensor, and their field.
SENSORS = {'sensor_msgs/msg/Temperature': ('temperature', 'temperature'),
           'sensor_msgs/msg/FluidPressure': ('pressure', 'fluid_pressure')}
NUMBERS = ('std_msgs/msg/Float32', 'std_msgs/msg/Float64')


def channel_of(topic: str, kind: str) -> str | None:
    """Return the channel that messages of a topic are of, by their type or the topic's name."""
    if kind in SENSORS:
        return SENSORS[kind][0]
    if kind in (*NUMBERS, JOINT_STATE):
        return next((name for name in CHANNELS if name in topic.lower()), None)
    return None


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
    chosen = [one for one in bag.connections if channel_of(one.topic, one.msgtype)
              or (one.msgtype == DYNAMIC and _has_channels(bag, one))]
    if not chosen or not len(stamps):
        return {}
    order = np.argsort(stamps, kind='stable')
    times: dict[tuple[str, str], list[int]] = defaultdict(list)
    values: dict[tuple[str, str], list[float]] = defaultdict(list)
    for connection, received, message in bag.decoded(chosen):
        for channel, joint, value in _told(connection.topic, connection.msgtype, message, joints):
            times[channel, joint].append(stamp_of(message) or received)
            values[channel, joint].append(value)
    found: dict[str, Array] = {}
    # What a drive has of its own counts for more than what is measured for all.
    for (channel, joint), read in sorted(values.items(), key=lambda one: bool(one[0][1])):
        array = found.setdefault(channel, np.full((len(stamps), len(joints)), np.nan))
        at = np.searchsorted(stamps, np.array(times[channel, joint], dtype=np.int64), sorter=order)
        place = slice(None) if not joint else joints.index(joint)
        if joint:
            array[:, place] = np.nan
        for row, value in zip(order[np.minimum(at, len(stamps) - 1)], read, strict=True):
            array[row, place] = value
    return {name: array for name, array in found.items() if np.isfinite(array).any()}


def _has_channels(bag: Bag, connection: Connection) -> bool:
    """Return whether the first message of dynamic joint states has more than motion and effort."""
    return any(name in CHANNELS for *_, message in bag.decoded([connection], 1)
               for state in message.interface_values for name in state.interface_names)


def _told(topic: str, kind: str, message: Any, joints: tuple[str, ...],
          ) -> Iterator[tuple[str, str, float]]:
    """Yield channel, joint, '' for all of them, and value."""
    if kind == DYNAMIC:
        for joint, state in zip(message.joint_names, message.interface_values, strict=False):
            for name, value in zip(state.interface_names, state.values, strict=False):
                if name in CHANNELS and joint in joints:
                    yield name, joint, float(value)
        return
    channel = channel_of(topic, kind)
    assert channel is not None
    if kind == JOINT_STATE:
        numbers = next((array for array in (getattr(message, name) for name in QUANTITIES)
                        if len(array) == len(message.name)), ())
        for joint, value in zip(message.name, numbers, strict=False):
            if joint in joints:
                yield channel, joint, float(value)
        return
    frame = message.header.frame_id if kind in SENSORS else ''
    parts = {part.removesuffix(f'_{channel}') for part in (*topic.split('/'), frame)}
    value = float(getattr(message, SENSORS[kind][1] if kind in SENSORS else 'data'))
    yield channel, next((joint for joint in joints if joint in parts), ''), value


def write_channels(writer: Any, samples: Samples, stamps: Indices) -> None:
    """Write what was measured on `/<drive>/<channel>`, positions of links on `/<channel>`."""
    store: Any = None
    for channel in samples.channels.keys() - {channel for channel, _ in SENSORS.values()}:
        store = message_types() if store is None else store
        connection = writer.add_connection(f'/{channel}', JOINT_STATE, typestore=store)
        known = np.isfinite(samples.channels[channel])
        for at in np.flatnonzero(known.any(axis=1)):
            time = store.types['builtin_interfaces/msg/Time'](*divmod(int(stamps[at]), 10**9))
            header = store.types['std_msgs/msg/Header'](stamp=time, frame_id='')
            none = np.zeros(0)
            message = store.types[JOINT_STATE](
                header=header, name=list(np.array(samples.drives)[known[at]]),
                position=samples.channels[channel][at, known[at]], velocity=none, effort=none)
            writer.write(connection, int(stamps[at]), store.serialize_cdr(message, JOINT_STATE))
    for kind, (channel, name) in SENSORS.items():
        if channel not in samples.channels:
            continue
        store = message_types() if store is None else store
        for d, drive in enumerate(samples.drives):
            series = samples.channels[channel][:, d]
            known = np.flatnonzero(np.isfinite(series))
            if not len(known):
                continue
            connection = writer.add_connection(f'/{drive}/{channel}', kind, typestore=store)
            for at in known:
                time = store.types['builtin_interfaces/msg/Time'](*divmod(int(stamps[at]), 10**9))
                header = store.types['std_msgs/msg/Header'](stamp=time, frame_id=drive)
                message = store.types[kind](header=header, variance=0.0, **{name: series[at]})
                writer.write(connection, int(stamps[at]), store.serialize_cdr(message, kind))
