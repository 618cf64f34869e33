# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The CDR bytes of sensor_msgs/JointState, read and written many messages at a time.

A topic of joint states carries the same names in the same order in every message, so its bytes
have one layout: length words and names that never change, and numbers at fixed places. Reading
the numbers with NumPy is 20 times faster than building message objects. Every byte that makes
the layout is compared in every message; one that differs gets a layout of its own.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices, Mask
from pprs_dynamics.system.cdr import HEADER, LITTLE_ENDIAN, STAMP, WORD, Walk

JOINT_STATE = 'sensor_msgs/msg/JointState'
# Of a topic whose messages differ in more ways than this, the others are read one by one.
MOST_LAYOUTS = 16


def message_types() -> Any:
    """Return what ROS 2 itself defines, in a store of its own."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_KILTED)


@dataclass(frozen=True)
class Layout:
    """Where what stands in a serialised JointState.

    Parameters
    ----------
    names : tuple of str
        Joints, in the message's order.
    arrays : three times (offset, count)
        First byte and number of values of position, velocity and effort.
    length : int
        Bytes of the message.
    fixed : (K,) array of int
        Places of the bytes that make this layout: encapsulation, length words, names. Stamps,
        values, padding and the text of the frame may differ.
    pattern : (K,) array of bytes
        What stands there.
    """

    names: tuple[str, ...]
    arrays: tuple[tuple[int, int], ...]
    length: int
    fixed: Indices
    pattern: NDArray[np.uint8]

    @classmethod
    def of(cls, data: bytes) -> Layout | None:
        """Return the layout of a message, None where it is not little-endian CDR of version 1."""
        if data[:2] != LITTLE_ENDIAN[:2]:
            return None
        walk = Walk(data)
        try:
            places = walk.header()
            for _ in range(3):
                walk.numbers()
            names = tuple(data[place].rstrip(b'\x00').decode() for place in places)
        except (struct.error, UnicodeDecodeError):
            return None
        # Bytes may follow: rmw_fastrtps leaves some where a sequence is empty, and ROS itself
        # ignores them (rosbags does not).
        if walk.at > len(data):
            return None
        fixed = np.array([
            *range(2), *(k for word in walk.words for k in range(word, word + WORD.size)),
            *(k for place in places for k in range(place.start, place.stop))], np.int64)
        return cls(names, tuple(walk.arrays), len(data), fixed,
                   np.frombuffer(data, np.uint8)[fixed])

    def matches(self, rows: NDArray[np.uint8]) -> Mask:
        """Return which messages, (N, length) bytes, have this layout."""
        same: Mask = np.all(rows[:, self.fixed] == self.pattern, axis=1)
        return same

    def stamps(self, rows: NDArray[np.uint8]) -> Indices:
        """Return the header stamps [ns], (N,)."""
        words = np.ascontiguousarray(rows[:, HEADER:HEADER + STAMP.size])
        seconds = words.view('<i4')[:, 0].astype(np.int64)
        stamps: Indices = seconds * 10**9 + words.view('<u4')[:, 1]
        return stamps

    def values(self, rows: NDArray[np.uint8], array: tuple[int, int]) -> Array:
        """Return one of the arrays, (N, count)."""
        offset, count = array
        block = np.ascontiguousarray(rows[:, offset:offset + 8 * count])
        return block.view('<f8').astype(np.float64, copy=False)

    def filled(self, stamps: Indices, *quantities: Array | None) -> NDArray[np.uint8]:
        """Return messages with this layout as rows of bytes, (N, length), all else zero.

        Parameters
        ----------
        stamps : (N,) array of int
            [ns].
        *quantities : (N, count) arrays
            Position, velocity and effort; what has no values is not looked at.
        """
        rows = np.zeros((len(stamps), self.length), np.uint8)
        rows[:, self.fixed] = self.pattern
        seconds, nanoseconds = np.divmod(stamps, 10**9)
        words = np.column_stack((seconds, nanoseconds)).astype('<u4')
        rows[:, HEADER:HEADER + STAMP.size] = words.view(np.uint8)
        for (offset, count), values in zip(self.arrays, quantities, strict=True):
            if count:
                numbers = np.ascontiguousarray(values, dtype='<f8')
                rows[:, offset:offset + 8 * count] = numbers.view(np.uint8)
        return rows


def serialised(
    names: tuple[str, ...], stamps: Indices, position: Array, velocity: Array | None,
    effort: Array,
) -> NDArray[np.uint8]:
    """Return JointState messages with an empty frame as rows of bytes, (N, length).

    Parameters
    ----------
    names : tuple of D str
    stamps : (N,) array of int
        [ns].
    position, velocity, effort : (N, D) arrays
        `velocity` may be None: an empty sequence.
    """
    return _layout_of(names, velocity is not None).filled(stamps, position, velocity, effort)


@cache
def _layout_of(names: tuple[str, ...], has_velocity: bool) -> Layout:
    store, zeros = message_types(), np.zeros(len(names))
    header = store.types['std_msgs/msg/Header'](
        store.types['builtin_interfaces/msg/Time'](0, 0), '')
    message = store.types[JOINT_STATE](
        header, list(names), zeros, zeros if has_velocity else zeros[:0], zeros)
    layout = Layout.of(bytes(store.serialize_cdr(message, JOINT_STATE)))
    assert layout is not None
    return layout


class JointStateBlocks:
    """Collects stamps, positions, velocities and efforts of some drives from messages.

    Parameters
    ----------
    drives : tuple of D str
        Taken by name, in any order, among any others.
    use_layouts : bool
        False reads every message by rosbags; for checking one way against the other.
    """

    def __init__(self, drives: tuple[str, ...], use_layouts: bool = True) -> None:
        self.drives = drives
        self.names: set[str] = set()
        self.samples = 0
        self._layouts: list[Layout] = []
        self._use_layouts = use_layouts
        self._blocks: list[tuple[Indices, Indices, Array]] = []
        self._typestore: Any = None

    def add(self, messages: Sequence[bytes], received: Sequence[int]) -> None:
        """Take in serialised messages and the times of their recording [ns]."""
        stamps = np.zeros(len(messages), dtype=np.int64)
        # Position, velocity, effort; a sample counts where every drive has a position value.
        values = np.full((3, len(messages), len(self.drives)), np.nan)
        complete = np.zeros(len(messages), dtype=bool)
        lengths = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
        left = np.arange(len(messages))
        tried = 0
        while len(left):
            if tried == len(self._layouts):
                first = int(left[0])
                layout = Layout.of(messages[first]) if self._use_layouts else None
                if layout is None or tried == MOST_LAYOUTS:
                    complete[first] = self._take_one(messages[first], layout, first, stamps, values)
                    left = left[1:]
                    continue
                self._layouts.append(layout)
            layout = self._layouts[tried]
            tried += 1
            fitting = left[lengths[left] == layout.length]
            joined = b''.join([messages[row] for row in fitting.tolist()])
            rows = np.frombuffer(joined, np.uint8).reshape(len(fitting), layout.length)
            same = layout.matches(rows)
            if not np.all(same):
                fitting, rows = fitting[same], rows[same]
            if len(fitting):
                complete[fitting] = self._take(layout, rows, fitting, stamps, values)
                left = np.setdiff1d(left, fitting, assume_unique=True)
        times = np.array(received, dtype=np.int64)
        if not np.all(complete):
            stamps, times, values = stamps[complete], times[complete], values[:, complete]
        self.samples += len(stamps)
        self._blocks.append((stamps, times, values))

    def arrays(self) -> tuple[Indices, Indices, Array, Array, Array]:
        """Return header stamps and recording times [ns], (N,); the three arrays, (N, D).

        What was collected is given away, not kept.
        """
        stamps = np.concatenate([block[0] for block in self._blocks])
        received = np.concatenate([block[1] for block in self._blocks])
        position, velocity, effort = (
            np.concatenate([block[2][k] for block in self._blocks]) for k in range(3))
        self._blocks.clear()
        return stamps, received, position, velocity, effort

    def _take(
        self, layout: Layout, messages: NDArray[np.uint8], rows: Indices, stamps: Indices,
        values: Array,
    ) -> bool:
        """Read messages of one layout into their rows; return whether they hold all drives."""
        stamps[rows] = layout.stamps(messages)
        return self._place(layout.names, [
            layout.values(messages, array) for array in layout.arrays], rows, values)

    def _take_one(
        self, message: bytes, layout: Layout | None, row: int, stamps: Indices, values: Array,
    ) -> bool:
        """Read one message for itself, with rosbags where it has no layout."""
        rows = np.array([row])
        if layout is not None:
            return self._take(layout, np.frombuffer(message, np.uint8)[None], rows, stamps, values)
        if self._typestore is None:
            self._typestore = message_types()
        try:
            state = self._typestore.deserialize_cdr(message, JOINT_STATE)
        except Exception:
            # Bytes that are no joint state at all: told among the incomplete messages.
            return False
        stamps[row] = state.header.stamp.sec * 10**9 + state.header.stamp.nanosec
        arrays = [np.asarray(array)[None] for array in (state.position, state.velocity,
                                                        state.effort)]
        return self._place(tuple(state.name), arrays, rows, values)

    def _place(
        self, names: tuple[str, ...], arrays: Sequence[Array], rows: Indices, values: Array,
    ) -> bool:
        """Put arrays, (n, joints) each, into their rows; return whether they hold all drives."""
        self.names.update(names)
        if any(drive not in names for drive in self.drives):
            return False
        columns = [names.index(drive) for drive in self.drives]
        if arrays[0].shape[1] != len(names):
            return False
        for k, array in enumerate(arrays):
            # A sequence of another length than the names says nothing about which joint.
            if array.shape[1] == len(names):
                values[k, rows] = array[:, columns]
        return True
