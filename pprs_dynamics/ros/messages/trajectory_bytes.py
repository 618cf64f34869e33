# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Trajectories read from their bytes, without message objects.

Points with as many numbers each have a constant length, so NumPy reads a thousand of them in the
time that message objects need for two. Every word of the layout is compared; a message that
differs in any is read as an object.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices
from pprs_dynamics.ros.messages.conversions import NANOSECONDS
from pprs_dynamics.system.cdr import HEADER, LITTLE_ENDIAN, STAMP, WORD, Walk, aligned

TWO_WORDS = struct.Struct('<2I')


class Points(NamedTuple):
    """Content of a message.

    Parameters
    ----------
    stamp : int
        Of its header [ns].
    frame : str
    names : list of str
    numbers : (N, K) array
        Of all three sequences, one after the other.
    offsets : (N,) array of int
        time_from_start [ns].
    """

    stamp: int
    frame: str
    names: list[str]
    numbers: Array
    offsets: Indices


class PointLayout:
    """Layout of messages whose points have three sequences of numbers and time_from_start.

    A point is a row of words of four bytes. Numbers are two words, and start at multiples of
    eight bytes.

    Parameters
    ----------
    counts, numbers : 3 ints
        Elements of each sequence, and numbers in all of them.
    empty : int
        Sequences behind these, without elements.
    """

    def __init__(self, counts: Sequence[int], numbers: Sequence[int], empty: int = 0) -> None:
        # The first length word of a point follows the time of the point before.
        at = self._before = 1 + (empty + 1) % 2
        words: list[tuple[int, int]] = []
        columns: list[int] = []
        for k, (count, each) in enumerate(zip(counts, numbers, strict=True)):
            if k:
                words.append((at, count))
                at += 2
            columns += range(at, at + 2 * each)
            at += 2 * each
        words += [(at + k, 0) for k in range(empty)]
        self._first, self._columns, self._time = counts[0], np.array(columns), at + empty
        places, lengths = np.array(words, '<u4').T
        self._words, self._lengths = places.astype(int), lengths.tobytes()

    def read(self, data: bytes) -> Points | None:
        """Return the content of a message, or None where it has another layout."""
        if data[:HEADER] != LITTLE_ENDIAN:
            return None
        walk = Walk(data)
        try:
            walk.over(STAMP.size)
            frame, *names = (_text(data[place]) for place in (walk.text(), *walk.texts()))
            place = aligned(walk.at, WORD.size)
            count, first = TWO_WORDS.unpack_from(data, place)
        except (struct.error, ValueError):
            return None
        width = self._time + 2
        start = aligned(place + TWO_WORDS.size, 8) - self._before * WORD.size
        # Bytes without meaning may follow.
        if not count or first != self._first or (
                len(data) < start + count * width * WORD.size):
            return None
        rows = np.frombuffer(data, '<u4', count * width, start).reshape(count, width)
        if rows.take(self._words, 1).tobytes() != self._lengths * count or (
                rows[1:, 0].tobytes() != WORD.pack(first) * (count - 1)):
            return None
        seconds, nanoseconds = STAMP.unpack_from(data, HEADER)
        offsets = (rows.view('<i4')[:, self._time].astype(np.int64) * NANOSECONDS
                   + rows[:, self._time + 1])
        return Points(seconds * NANOSECONDS + nanoseconds, frame, names,
                      rows.take(self._columns, 1).view('<f8'), offsets)


def _text(data: bytes) -> str:
    """Return a text, which ends with a zero; raise ValueError where it does not."""
    if data[-1:] != b'\0':
        raise ValueError(data)
    return data[:-1].decode()
