# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Messages of the type sensor_msgs/JointState, collected for some drives."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices

JOINT_STATE = 'sensor_msgs/msg/JointState'
BEHIND = 0, 4, 8  # bytes that rmw_fastrtps leaves behind a message with empty sequences


def message_types() -> Any:
    """Return a type store with the message types of ROS 2."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_KILTED)


_types = cache(message_types)


def deserialized(types: Any, data: bytes, kind: str) -> Any:
    """Return the message that bytes are, or None for bytes that are none."""
    for behind in BEHIND:
        with suppress(Exception):  # of any kind, as the bytes are
            return types.deserialize_cdr(data[:len(data) - behind], kind)
    return None


class JointStates:
    """Collects stamps, positions, velocities and efforts of some drives from messages.

    Parameters
    ----------
    drives : tuple of str
        Names in the order of the columns.
    """

    def __init__(self, drives: tuple[str, ...]) -> None:
        self.drives = drives
        self.names: set[str] = set()
        self.twice: set[str] = set()  # drives that a message names more than once
        self._places: dict[tuple[str, ...], list[int]] = {}  # of the drives, [] where some lack
        self._stamps: list[tuple[int, int]] = []
        self._values: list[Array] = []
        self._none = np.full(len(drives), np.nan)

    @property
    def samples(self) -> int:
        """Number of messages with one position of each drive."""
        return len(self._stamps)

    def add(self, data: bytes, received: int) -> None:
        """Take in a serialised message and the time of its recording [ns]."""
        state = deserialized(_types(), data, JOINT_STATE)
        if state is None:
            return
        names = tuple(state.name)
        if names not in self._places:
            self._places[names] = self._places_in(names)
        places = self._places[names]
        if places and len(state.position) == len(names):
            stamp = state.header.stamp
            self._stamps.append((stamp.sec * 10**9 + stamp.nanosec, received))
            # Velocity and effort may be absent.
            self._values += [values[places] if len(values) == len(names) else self._none
                             for values in (state.position, state.velocity, state.effort)]

    def arrays(self) -> tuple[Indices, Indices, Array, Array, Array]:
        """Return header stamps and recording times [ns], (N,); the three arrays, (N, D)."""
        stamps, received = np.array(self._stamps, dtype=np.int64).reshape(-1, 2).T
        position, velocity, effort = np.array(self._values).reshape(
            -1, 3, len(self.drives)).swapaxes(0, 1).copy()
        return stamps, received, position, velocity, effort

    def _places_in(self, names: tuple[str, ...]) -> list[int]:
        """Return the places of the drives in a message's names, [] if not each is there once."""
        self.names.update(names)
        twice = {drive for drive in self.drives if names.count(drive) > 1}
        self.twice |= twice
        return [] if twice or not {*self.drives} <= {*names} else [
            names.index(drive) for drive in self.drives]
