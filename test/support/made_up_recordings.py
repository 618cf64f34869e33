# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings made up for tests: smooth motion, and files as other programs write them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.measurement.files.samples import Defect

STORE = get_typestore(Stores.ROS2_KILTED)
# Definitions of messages that have no wheel, as a bag carries them.
DYNAMIC, CONTROLLER = (f'control_msgs/msg/{name}' for name in (
    'DynamicJointState', 'JointTrajectoryControllerState'))
BREAK = '=' * 80 + '\n'
DEFINITIONS = {
    DYNAMIC: f'''std_msgs/Header header
string[] joint_names
control_msgs/InterfaceValue[] interface_values
{BREAK}MSG: control_msgs/InterfaceValue
string[] interface_names
float64[] values
''',
    CONTROLLER: f'''std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint feedback
trajectory_msgs/JointTrajectoryPoint error
trajectory_msgs/JointTrajectoryPoint output
{BREAK}MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
'''}


def with_definitions(store: Any) -> Any:
    """Return a store of types that has those of `DEFINITIONS` as well."""
    for name, text in DEFINITIONS.items():
        found = get_types_from_msg(text, name)
        store.register({key: t for key, t in found.items() if key not in store.types})
    return store


with_definitions(STORE)
STATE = 'sensor_msgs/msg/JointState'
STEP = 0.002
# Steps of the plain recordings have exactly these nanoseconds, so that all formats say the same.
STEP_NS = 2_000_000
SUFFIXES = ('.csv', '.mcap', '.db3', '')
QUANTITIES = ('position', 'velocity', 'effort')

Arrays = dict[str, Any]


def measured(count: int = 1000, drives: tuple[str, ...] = DRIVES, seed: int = 0) -> Arrays:
    """Smooth motion seen by encoders of 1 um, velocities and efforts with noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(count) * STEP_NS / 1e9
    phase = 2 * np.pi * (0.5 + 0.2 * np.arange(len(drives))) * time[:, None]
    position = 1e-6 * np.rint(1e6 * (0.1 + 0.05 * np.sin(phase) + rng.normal(0, 1e-6, phase.shape)))
    velocity = 0.05 * np.gradient(np.sin(phase), STEP, axis=0) + rng.normal(0, 1e-4, phase.shape)
    return {'time': time, 'position': position, 'velocity': velocity,
            'effort': 5 * np.cos(phase) + rng.normal(0, 0.1, phase.shape)}


def judged(arrays: Arrays) -> Recording:
    return Recording.from_arrays('planted', **arrays)


def kinds(recording: Recording) -> set[str]:
    return {finding.kind for finding in recording.findings}


def the(recording: Recording, kind: str) -> Defect:
    """Return the only finding, which must be of a kind."""
    assert kinds(recording) == {kind}
    (finding,) = recording.findings
    return finding


def header(stamp: int, frame: str = 'base') -> Any:
    """Return a header with a stamp [ns]."""
    return STORE.types['std_msgs/msg/Header'](
        STORE.types['builtin_interfaces/msg/Time'](*divmod(stamp, 10**9)), frame)


def message(stamp: int, names: Any, position: Any, velocity: Any = (), effort: Any = ()) -> Any:
    return STORE.types[STATE](header(stamp), list(names), *(
        np.array(values, dtype=float) for values in (position, velocity, effort)))


def write_plain_bag(
    path: Path, messages: dict[str, list[Any]], storage: StoragePlugin = StoragePlugin.MCAP,
    received: Callable[[int], int] = lambda k: k * STEP_NS, msgtype: str = STATE,
    pack: Callable[[Writer], None] = lambda writer: None,
) -> Path:
    """Write what a recorder of ROS would: messages, or their bytes, by topic."""
    writer = Writer(path, version=9, storage_plugin=storage)
    pack(writer)
    with writer:
        for topic, states in messages.items():
            kind = getattr(states[0], '__msgtype__', msgtype) if states else msgtype
            connection = writer.add_connection(topic, kind, typestore=STORE)
            for k, state in enumerate(states):
                data = state if isinstance(state, bytes) else STORE.serialize_cdr(state, kind)
                writer.write(connection, received(k), data)
    return path


def states_of(arrays: Arrays, names: tuple[str, ...] = DRIVES, **changes: Any) -> list[Any]:
    """Messages of arrays, whose columns belong to the names."""
    values = {**arrays, **changes}
    return [message(round(1e9 * values['time'][k]), names, *(
        [] if values[quantity] is None else values[quantity][k] for quantity in QUANTITIES))
        for k in range(len(values['time']))]


def table(arrays: Arrays, drives: tuple[str, ...] = DRIVES, prefix: str = '') -> pd.DataFrame:
    columns = {'time': arrays['time']}
    for quantity in QUANTITIES:
        for k, drive in enumerate(drives):
            columns[f'{prefix}{drive}/{quantity}'] = arrays[quantity][:, k]
    return pd.DataFrame(columns)


def assert_same(recording: Recording, arrays: Arrays) -> None:
    """Equal to the last bit, NaN as NaN."""
    np.testing.assert_array_equal(recording.time, arrays['time'])
    for quantity in QUANTITIES:
        found, expected = getattr(recording, quantity), arrays[quantity]
        if expected is None:
            assert found is None
        else:
            np.testing.assert_array_equal(found, expected, strict=True)


def the_one(recording: Recording, kind: str) -> Defect:
    (finding,) = [finding for finding in recording.findings if finding.kind == kind]
    return finding


def by_own_writer(suffix: str) -> Callable[[Path, Arrays], Path]:
    def write(folder: Path, arrays: Arrays) -> Path:
        path = folder / f'recording{suffix}'
        # Of columns, as others order their arrays.
        write_recording(path, judged({name: None if values is None else np.asfortranarray(values)
                                      for name, values in arrays.items()}))
        return path
    return write
