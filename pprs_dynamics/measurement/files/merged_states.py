# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Joint states that stand in several messages, topics or types, merged by their stamps.

sensor_msgs/JointState of some drives each, or with efforts on a topic of their own;
control_msgs/DynamicJointState; control_msgs/JointTrajectoryControllerState. Definitions of the
latter two are those that the bag carries.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.joint_state_cdr import JOINT_STATE, message_types
from pprs_dynamics.measurement.files.samples import QUANTITIES, Defect, Indices

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag2 import Reader

DYNAMIC = 'control_msgs/msg/DynamicJointState'
CONTROLLER = 'control_msgs/msg/JointTrajectoryControllerState'
LONGEST_STEP = 1.6  # median steps between two samples, over which nothing is interpolated


def read_merged(reader: Reader, connections: list[Connection], drives: tuple[str, ...],
                ) -> tuple[Indices, list[Array], list[Defect]] | None:
    """Return the states of all drives, at the stamps of the first one's positions.

    Returns
    -------
    tuple or None
        Stamps [ns] (N,), positions, velocities and efforts (N, D) with NaN where unknown, and what
        there is to say; None where some drive has no positions in these messages.
    """
    typestore = _typestore(connections)
    times: dict[tuple[str, str], list[int]] = defaultdict(list)
    values: dict[tuple[str, str], list[float]] = defaultdict(list)
    commanded = False
    for connection, received, data in reader.messages(connections):
        try:
            message = typestore.deserialize_cdr(data, connection.msgtype)
        except Exception:  # bytes that are no such message
            continue
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec or received
        for joint, quantity, value, is_command in _states(message, connection.msgtype):
            if joint in drives and np.isfinite(value):
                times[joint, quantity].append(stamp)
                values[joint, quantity].append(float(value))
                commanded |= is_command
    if any(not times[drive, 'position'] for drive in drives):
        return None
    stamps = np.unique(np.array(times[drives[0], 'position'], dtype=np.int64))
    arrays = [np.stack([
        _at(stamps, times[drive, quantity], values[drive, quantity]) for drive in drives], axis=1)
        for quantity in QUANTITIES]
    kept = np.isfinite(arrays[0]).all(axis=1)
    topics = sorted({connection.topic for connection in connections})
    findings = [Defect('merged', int(kept.sum()), f'merged by stamp from {", ".join(topics)}')]
    if commanded:
        findings.append(Defect(
            'commanded_efforts', int(kept.sum()), 'the efforts are what the controller commands: '
            'none were measured'))
    return stamps[kept], [array[kept] for array in arrays], findings


def _typestore(connections: list[Connection]) -> Any:
    """Return types with those that the bag defines beside ROS 2's own."""
    from rosbags.typesys import get_types_from_msg

    typestore = message_types()
    for connection in connections:
        if connection.msgtype not in typestore.types and connection.msgdef.data:
            found = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            typestore.register({name: fields for name, fields in found.items()
                                if name not in typestore.types})
    return typestore


def _states(message: Any, kind: str) -> Iterator[tuple[str, str, float, bool]]:
    """Yield joint, quantity, value, and whether that is a command, of one message."""
    if kind == JOINT_STATE:
        for quantity in QUANTITIES:
            array = getattr(message, quantity)
            if len(array) == len(message.name):
                for joint, value in zip(message.name, array, strict=True):
                    yield joint, quantity, value, False
    elif kind == DYNAMIC:
        for joint, state in zip(message.joint_names, message.interface_values, strict=False):
            for quantity, value in zip(state.interface_names, state.values, strict=False):
                if quantity in QUANTITIES:
                    yield joint, quantity, value, False
    else:
        measured, output = message.feedback, message.output
        efforts = measured.effort if len(measured.effort) else output.effort
        for quantity, array in (('position', measured.positions),
                                ('velocity', measured.velocities), ('effort', efforts)):
            if len(array) == len(message.joint_names):
                for joint, value in zip(message.joint_names, array, strict=True):
                    yield joint, quantity, value, (
                        quantity == 'effort' and not len(measured.effort))


def _at(stamps: Indices, times: list[int], values: list[float]) -> Array:
    """Return a series at other stamps: exact where they are the same, else between neighbours."""
    if len(times) < 2:
        return np.full(len(stamps), np.nan)
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
