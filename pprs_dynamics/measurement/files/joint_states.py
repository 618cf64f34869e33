# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Messages with states of joints: their types, and what one of them says.

sensor_msgs/JointState; control_msgs/DynamicJointState; control_msgs/JointTrajectoryControllerState.
Definitions of all but the first are those that the bag carries.

Temperatures and pressures are in messages of sensor_msgs, in numbers and joint states on topics
with such a name, and in interfaces of dynamic joint states. They belong to the drive that their
topic or frame names, or to all drives.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cache
from typing import Any

from pprs_dynamics.drives import CHANNELS
from pprs_dynamics.measurement.files.samples import CURRENT, QUANTITIES

JOINT_STATE = 'sensor_msgs/msg/JointState'
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
BEHIND = 0, 4, 8  # bytes that rmw_fastrtps leaves behind a message with empty sequences


def message_types() -> Any:
    """Return a type store with the message types of ROS 2."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_KILTED)


def deserialized(types: Any, data: bytes, kind: str) -> Any:
    """Return the message that bytes are, or None for bytes that are none."""
    for behind in BEHIND:
        with suppress(Exception):  # of any kind, as the bytes are
            return types.deserialize_cdr(data[:len(data) - behind], kind)
    return None


def stamp_of(message: Any) -> int:
    """Return the stamp of a message's header [ns], 0 where it has none."""
    header = getattr(message, 'header', None)
    return 0 if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec


@cache
def channel_of(topic: str, kind: str) -> str | None:
    """Return the channel that messages of a topic are of, by their type or the topic's name."""
    if kind in SENSORS:
        return SENSORS[kind][0]
    return next((name for name in CHANNELS if name in topic.lower()), None) if (
        kind in (*NUMBERS, JOINT_STATE)) else None


# Joints, a quantity, a value of each joint, and whether these are commands.
State = tuple[tuple[str, ...], str, Sequence[float], bool]


def states_of(message: Any, kind: str, topic: str = '', joints: Sequence[str] = (),
              ) -> Iterator[State]:
    """Yield the states in one message.

    Of a sensor for all drives the joint is empty; else its topic or frame names one of `joints`.
    """
    channel = channel_of(topic, kind)
    if kind in (*SENSORS, *NUMBERS) and channel:
        frame = message.header.frame_id if kind in SENSORS else ''
        parts = {part.removesuffix(f'_{channel}') for part in (*topic.split('/'), frame)}
        value = float(getattr(message, SENSORS[kind][1] if kind in SENSORS else 'data'))
        yield (next((joint for joint in joints if joint in parts), ''),), channel, (value,), False
    elif kind == JOINT_STATE:
        names = tuple(message.name)
        given = [(channel or quantity, values) for quantity in QUANTITIES
                 if len(values := getattr(message, quantity)) == len(names)]
        for quantity, values in given[:1] if channel else given:
            yield names, quantity, values, False
    elif kind == DYNAMIC:
        for joint, state in zip(message.joint_names, message.interface_values, strict=False):
            for interface, value in zip(state.interface_names, state.values, strict=False):
                if interface in INTERFACES:
                    yield (joint,), INTERFACES[interface], (value,), False
    elif kind == CONTROLLER:
        measured, output = message.feedback, message.output
        is_command = not len(measured.effort)
        for quantity, values, is_wanted in (
                ('position', measured.positions, False), ('velocity', measured.velocities, False),
                ('effort', output.effort if is_command else measured.effort, is_command)):
            if len(values) == len(message.joint_names):
                yield tuple(message.joint_names), quantity, values, is_wanted
