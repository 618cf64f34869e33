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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices, Mask
from pprs_dynamics.system.cdr import (
    HEADER,
    LITTLE_ENDIAN,
    STAMP,
    WORD,
    Walk,
    with_count,
    with_names,
)


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
            arrays = tuple(walk.numbers() for _ in range(3))
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
        return cls(names, arrays, len(data), fixed, np.frombuffer(data, np.uint8)[fixed])

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
    rows, prefix = np.empty((len(stamps), 0), np.uint8), with_names('', names)
    for values in (position, velocity, effort):
        count = 0 if values is None else values.shape[1]
        prefix = with_count(prefix, count, rows.shape[1])
        if values is None or not count:
            continue
        constant = np.tile(np.frombuffer(prefix, np.uint8), (len(stamps), 1))
        numbers = np.ascontiguousarray(values, dtype='<f8').view(np.uint8)
        rows, prefix = np.concatenate((rows, constant, numbers), axis=1), b''
    seconds, nanoseconds = np.divmod(stamps, 10**9)
    words = np.column_stack((seconds, nanoseconds)).astype('<u4')
    rows[:, HEADER:HEADER + STAMP.size] = words.view(np.uint8)
    return rows
