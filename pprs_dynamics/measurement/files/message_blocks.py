# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Serialised joint states -> arrays, by their common layout where they have one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.joint_state_cdr import Layout
from pprs_dynamics.measurement.files.samples import Indices

# Of a topic whose messages differ in more ways than this, the others are read one by one.
MOST_LAYOUTS = 16


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
            from rosbags.typesys import Stores, get_typestore
            self._typestore = get_typestore(Stores.ROS2_KILTED)
        try:
            state = self._typestore.deserialize_cdr(message, 'sensor_msgs/msg/JointState')
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
