# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Bags of sensor_msgs/JointState, and of other messages by their fields; rosbag2 is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import CHANNELS, RecordedDrives
from pprs_dynamics.errors import UnreadableFileError, optional_library
from pprs_dynamics.measurement.files import joint_states
from pprs_dynamics.measurement.files.bag_storage import Bag, opened_bag
from pprs_dynamics.measurement.files.merged_states import Key, Signal, States, fields_of
from pprs_dynamics.measurement.files.name_hints import MOST, missing_names
from pprs_dynamics.measurement.files.samples import (
    CURRENT,
    Defect,
    Indices,
    Progress,
    Samples,
    whole_epoch,
)
from pprs_dynamics.measurement.files.signals import alternates
from pprs_dynamics.system.files import new_folder, scratch_folder, writable_file
from pprs_dynamics.system.plain_text import counted

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

LOG, LOG_INFO = 'rcl_interfaces/msg/Log', 20  # what Foxglove's log panel lists
CONTROLLER_TYPES = (joint_states.DYNAMIC, joint_states.CONTROLLER)
TOPIC_END = 'joint_states'
# In the names of topics whose positions were commanded, not measured.
COMMANDS = 'command', 'cmd', 'desired', 'reference', 'target', 'goal', 'setpoint'
FIRST = 400  # messages of a topic of which one has an effort, if efforts were recorded
STORAGE = {'.mcap': 'MCAP', '.db3': 'SQLITE3'}


def read_bag(
    path: Path, recorded: RecordedDrives, topic: str | None = None,
    progress: Progress | None = None,
) -> Samples:
    """Read a bag directory, or a bare .mcap, .db3 or .bag file.

    Raises
    ------
    UnreadableFileError
        Where it is damaged, holds no such topic or several, or lacks a drive.
    MissingLibraryError
        Where rosbags is not installed.
    """
    joints = recorded.joints
    with opened_bag(path) as (bag, findings):
        fields = fields_of(bag, recorded)
        of_fields = {field.topic for field in fields}
        main = _chosen(bag, topic, joints) if {*joints} - {
            field.joint for field in fields if field.quantity == 'position'} else []
        states, first = States(joints, fields), main[0].topic if main else ''
        states.collect(bag, [*main, *(c for c in bag.connections
                                      if c.topic in of_fields and c not in main)], progress)
        if main and not states.counts[first]:
            raise UnreadableFileError(path, f'{first} contains no messages')
        states.collect(bag, [c for c in bag.connections
                             if c not in main and _has_channels(bag, c)], channels=True)
        found = states.signals(first, path)
        others = [c for c in bag.connections if c.msgtype == joint_states.JOINT_STATE
                  and c.topic != first and joint_states.channel_of(c.topic, c.msgtype) is None]
        if others and not (topic or fields or _have_efforts(found)):
            states.collect(bag, others)
            with_others = states.signals(first, path)
            found = with_others if _have_efforts(with_others) else found
    return _samples(path, recorded, states, found, first, findings)


def _have_efforts(signals: Mapping[Key, Signal]) -> bool:
    return any(quantity == 'effort' for _, quantity in signals)


def _has_channels(bag: Bag, connection: Connection) -> bool:
    if connection.msgtype != joint_states.DYNAMIC:
        return joint_states.channel_of(connection.topic, connection.msgtype) is not None
    return any(quantity in CHANNELS for *_, message in bag.decoded([connection], 1)
               for _, quantity, *_ in joint_states.states_of(message, joint_states.DYNAMIC))


def _samples(path: Path, recorded: RecordedDrives, states: States,
             signals: Mapping[Key, Signal], first: str, findings: list[Defect]) -> Samples:
    """Return the samples that signals make, the first of them on a topic, '' for none."""
    joints, together = states.joints, states.names
    names = {name for message in together for name in message}
    topics = states.topics_of(signals) or first
    missing = [joint for joint in joints if (joint, 'position') not in signals]
    if twice := [joint for joint in missing if any(
            message.count(joint) > 1 for message in together)]:
        raise UnreadableFileError(
            path, f'messages on {topics} name {", ".join(twice)} twice: which value is that of '
            'the drive is not known; record each joint once')
    if unknown := [joint for joint in missing if joint not in names]:
        raise UnreadableFileError(
            path, f'{topics} lacks {", ".join(unknown[:MOST])}; it contains '
            + (', '.join(sorted(names)[:MOST]) or 'no names')
            + f'; {missing_names(joints, names, path.name[:40])}')
    stamps, columns, are_whole = states.together(signals)
    positions = [columns.get((joint, 'position'), np.full(len(stamps), np.nan)) for joint in joints]
    kept = np.full(len(stamps), are_whole) | np.isfinite(positions).all(axis=0)
    if not np.any(kept):
        raise UnreadableFileError(path, f'{topics} contains no positions of all of '
                                  f'{", ".join(joints)} at the same times')
    if not are_whole:
        findings.append(Defect('merged', int(kept.sum()), f'merged by stamp from {topics}'))
    elif mixed := [joint for joint, values in zip(joints, positions, strict=True)
                   if alternates(values)]:
        raise UnreadableFileError(
            path, f'the position of {", ".join(mixed)} on {topics} jumps back and forth from '
            'message to message: two nodes publish there; record one of them')
    elif others := sorted(names - {*joints}):
        findings.append(Defect('ignored_joints', len(others),
                               f'{topics} also contains {", ".join(others)}'))
    if first and first not in states.stamped:
        findings.append(Defect(
            'receive_times', len(stamps), 'the stamps in all message headers are 0'))
    if are_whole and (skipped := states.counts[first] - len(stamps)):
        findings.append(Defect(
            'incomplete_messages', skipped,
            f'{counted(skipped, "message")} of {states.counts[first]} on {topics} '
            f'without one position each of {", ".join(joints)}'))
    if any(signal.is_command for signal in signals.values()):
        findings.append(Defect('commanded_efforts', int(kept.sum()), 'the efforts are what the '
                               'controller commands: none were measured'))
    epoch = whole_epoch(stamps / 1e9)
    return Samples.of_columns(
        joints, (stamps[kept] - epoch * 10**9) / 1e9,
        {key: values[kept] for key, values in _of_drives(columns, recorded).items()},
        f'bag, {topics}', tuple(findings), epoch)


def _of_drives(columns: Mapping[Key, Array], recorded: RecordedDrives) -> dict[Key, Array]:
    """Return the columns of drives: what is measured for all, and other joints' that are named.

    `columns` of a model file name these as <joint>/<quantity>.
    """
    found = {**{(joint, quantity): values for (of, quantity), values in columns.items()
                if not of for joint in recorded.joints}, **columns}
    for (joint, quantity), column in recorded.named.items():
        of, _, other = str(column).rpartition('/')
        if other == quantity and (of, other) in columns:
            found[joint, quantity] = columns[of, other]
    return {(joint, quantity): values for (joint, quantity), values in found.items()
            if quantity != CURRENT or (joint, 'effort') not in found}


def write_bag(path: Path, topics: Mapping[str, Samples],
              texts: Mapping[str, Sequence[str]] | None = None) -> None:
    """Write a bare .mcap or .db3 file by the suffix, or else a bag directory with MCAP.

    Every topic of `topics` gets joint states. Stamps are rounded to 1 ns; they stand in the
    headers. Those of `texts` get rcl_interfaces/Log, at the first stamp of the joint states.

    Raises
    ------
    UnreadableFileError
        Where it cannot be written, or its times are before 0.
    MissingLibraryError
        Where rosbags is not installed.
    """
    for samples in topics.values():
        stamps = _stamps(samples)
        if len(stamps) and (stamps.min() < 0 or stamps.max() >= 2**31 * 10**9):
            raise UnreadableFileError(
                path, f'cannot be written: ROS stamps run from 0 to {2**31} s, but the time is '
                f'{samples.epoch + samples.time.min():.6g} to '
                f'{samples.epoch + samples.time.max():.6g} s')
    if path.suffix not in STORAGE:
        with new_folder(path) as folder:
            _write_directory(folder, topics, texts or {}, '.mcap')
        return
    target = writable_file(path)
    with scratch_folder(target) as scratch:
        _write_directory(scratch / 'bag', topics, texts or {}, path.suffix)
        (scratch / 'bag' / f'bag{path.suffix}').replace(target)


def _stamps(samples: Samples) -> Indices:
    return samples.epoch * 10**9 + np.rint(samples.time * 1e9).astype(np.int64)


def _write_directory(path: Path, topics: Mapping[str, Samples], texts: Mapping[str, Sequence[str]],
                     suffix: str) -> None:
    rosbag2 = optional_library('rosbags.rosbag2', 'rosbags', 'writing bags', 'bags')
    typestore = joint_states.message_types()
    starts = [int(_stamps(samples).min()) for samples in topics.values() if len(samples.time)]
    plugin = rosbag2.StoragePlugin[STORAGE[suffix]]
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        for topic, sentences in texts.items():
            connection = writer.add_connection(topic, LOG, typestore=typestore)
            first = min(starts, default=0)
            stamp = typestore.types['builtin_interfaces/msg/Time'](*divmod(first, 10**9))
            for sentence in sentences:
                message = typestore.types[LOG](
                    stamp=stamp, level=LOG_INFO, name=topic.strip('/'), msg=sentence, file='',
                    function='', line=0)
                writer.write(connection, first, typestore.serialize_cdr(message, LOG))
        for topic, samples in topics.items():
            stamps = _stamps(samples)
            # A bag is read in the order of recording: it must not follow a clock that is set back.
            recorded = np.maximum.accumulate(stamps)
            _write_states(writer, typestore, topic, samples, stamps, recorded)
            for channel, values in samples.channels.items():
                rows = np.isfinite(values).any(axis=1)
                _write_states(writer, typestore, f'/{channel}', Samples(
                    samples.drives, samples.time[rows], values[rows], None,
                    np.full_like(values[rows], np.nan)), stamps[rows], recorded[rows])


def _write_states(writer: Any, typestore: Any, topic: str, samples: Samples, stamps: Indices,
                  recorded: Indices) -> None:
    """Write samples as joint states, with stamps in their headers and as they are recorded."""
    connection = writer.add_connection(topic, joint_states.JOINT_STATE, typestore=typestore)
    types = typestore.types
    none = np.empty((len(stamps), 0))
    quantities = [np.ascontiguousarray(none if values is None else values, dtype=float)
                  for values in (samples.position, samples.velocity, samples.effort)]
    for stamp, at, *values in zip(stamps.tolist(), recorded.tolist(), *quantities, strict=True):
        header = types['std_msgs/msg/Header'](
            types['builtin_interfaces/msg/Time'](*divmod(stamp, 10**9)), '')
        message = types[joint_states.JOINT_STATE](header, list(samples.drives), *values)
        writer.write(connection, at, typestore.serialize_cdr(message, joint_states.JOINT_STATE))


def _has_efforts(bag: Bag, connections: list[Connection], drives: tuple[str, ...]) -> bool:
    """Return whether the first messages of a topic have positions of all drives, and efforts."""
    states = [(joint, quantity, value) for connection, _, message in bag.decoded(
        connections, FIRST) for joints, quantity, values, _ in joint_states.states_of(
            message, connection.msgtype) for joint, value in zip(joints, values, strict=True)
        if np.isfinite(value)]
    known = {(joint, quantity) for joint, quantity, _ in states}
    # Drivers fill what they do not measure with zeros.
    filled = {quantity for joint, quantity, value in states if joint in drives and value}
    return all((drive, 'position') in known for drive in drives) and {
        'position', 'effort'} <= filled


def _chosen(bag: Bag, topic: str | None, drives: tuple[str, ...]) -> list[Connection]:
    """Return the connections of the one topic to be read.

    That is the only one with positions and efforts, whose samples belong together; of several,
    or none, the one that ends in `joint_states`.
    """
    path = bag.path
    states = [item for item in bag.connections if item.msgtype == joint_states.JOINT_STATE]
    topics: dict[str, list[Connection]] = {}
    for item in sorted(bag.connections, key=lambda item: item.topic):
        if item.msgtype == joint_states.JOINT_STATE or (
                item.msgtype in CONTROLLER_TYPES and item.msgcount and (topic or not states)):
            topics.setdefault(item.topic, []).append(item)
    if topic is not None:
        matching = [name for name in topics if name.strip('/') == topic.strip('/')]
        if not matching:
            raise UnreadableFileError(
                path, f'there is no sensor_msgs/JointState on {topic}'
                + (f', but on {", ".join(topics)}' if topics else ''))
    elif not states and len(topics) == 1:
        matching = [*topics]
    else:
        measured = [name for name in topics
                    if joint_states.channel_of(name, joint_states.JOINT_STATE) is None]
        named = [name for name in measured if name.endswith(TOPIC_END)]
        whole = [name for name in measured if not any(word in name.lower() for word in COMMANDS)
                 and _has_efforts(bag, topics[name], drives)] if len(measured) > 1 else []
        matching = whole if len(whole) == 1 else [name for name in named if name in whole] or named
        # Topics that were announced and stayed silent are no choice.
        matching = [name for name in matching
                    if any(item.msgcount for item in topics[name])] or matching
        if not matching:
            arrays = sorted({item.topic for item in bag.connections
                             if item.msgtype.endswith('MultiArray')})
            raise UnreadableFileError(
                path, f'there is no sensor_msgs/JointState on a topic ending in {TOPIC_END}'
                + (f'; choose one of {", ".join(topics)} with --topic' if topics else
                   f'; of arrays write columns: {{DRIVE: {{position: "{arrays[0]}[0]"}}}} in the '
                   'model file' if arrays else ''))
    if len(matching) > 1:
        raise UnreadableFileError(
            path, f'there are joint states on {", ".join(matching)}: choose one with --topic')
    return topics[matching[0]]
