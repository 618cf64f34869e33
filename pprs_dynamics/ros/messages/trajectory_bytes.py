# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Trajectories without message objects, of the beginnings that are known.

Points with as many numbers each have a constant length, so that NumPy reads a thousand of them in
the time that message objects need for two, and one point of a stream in a tenth of it. What a
message begins with, its frame and names, is compared with what messages began with that were
read in the ordinary way; every word that makes the layout is compared; whatever differs is left
to the ordinary way.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from rclpy.serialization import serialize_message

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices
from pprs_dynamics.ros.messages.conversions import NANOSECONDS
from pprs_dynamics.system.cdr import HEADER, LITTLE_ENDIAN, STAMP, WORD, Walk, aligned

TWO_WORDS = struct.Struct('<2I')
MOST_BEGINNINGS = 4  # that are kept: more publishers than speak on one topic


class Points(NamedTuple):
    """What a message says.

    Parameters
    ----------
    stamp : int
        Of its header [ns].
    numbers : (N, K) array
        Of all three sequences, one after the other.
    offsets : (N,) array of int
        time_from_start [ns].
    """

    stamp: int
    numbers: Array
    offsets: Indices


class _Beginning(NamedTuple):
    """Frame and names of a message.

    Parameters
    ----------
    parts : tuple of (int, bytes)
        By their places; padding is left out, as it may hold anything.
    end : int
        Place of the count of points.
    order : (K,) array of int, optional
        In which order its numbers are given.
    """

    parts: tuple[tuple[int, bytes], ...]
    end: int
    order: Indices | None


class TrajectoryBytes:
    """Reads messages of points with three sequences of numbers and time_from_start.

    Parameters
    ----------
    counts, numbers : 3 ints
        Elements of each sequence, and numbers in all of them.
    empty : int
        Sequences behind these, without elements.
    """

    def __init__(self, counts: Sequence[int], numbers: Sequence[int], empty: int = 0) -> None:
        self._beginnings: list[_Beginning] = []
        self._is_known = True
        self._first, tail = counts[0], 'I' * empty + 'iI'
        # Numbers begin at multiples of eight. The first word of a point follows the time of the
        # one before, that of the first point the count of points.
        self._before = 8 if struct.calcsize('<' + tail) % 8 == 0 else 4
        self._one = struct.Struct('<' + 'I4x'.join(f'{each}d' for each in numbers) + tail)
        self._point = np.dtype([
            *(one for k, each in enumerate(numbers) for one in (
                (f'words{k}', '<u4', 2 if k else self._before // 4), (f'numbers{k}', '<f8', each))),
            ('empty', '<u4', empty), ('sec', '<i4'), ('nanosec', '<u4')])
        # Of what `_one` unpacks: numbers, and words with what they must be.
        ends = [end + k for k, end in enumerate(accumulate(numbers))]
        self._numbers = [slice(end - each, end) for end, each in zip(ends, numbers, strict=True)]
        self._words = [(end, count) for end, count in zip(
            [*ends[:2], *range(ends[2], ends[2] + empty)], [*counts[1:], *[0] * empty],
            strict=True)]
        self._counts = counts[1:]

    def expect(self, numbers: Array, write: Callable[[Array, list[int]], Any]) -> None:
        """Know from the start what messages begin with, a long one may be the only one.

        Where the installed rclpy lays out its bytes in another way, none is read from then on.

        Parameters
        ----------
        numbers : (2, K) array
            To try it with.
        write : callable
            Numbers (N, K) and time_from_start [ns] -> message.
        """
        offsets = [1_500_000_000, 3_000_000_001]
        for count in (2, 1):  # a second point has another place than the first, which may be alone
            data = bytes(serialize_message(write(numbers[:count], offsets[:count])))
            if count == 2:
                self.learn(data)
            found = self.read(data)
            if found is None or found.numbers.tolist() != numbers[:count].tolist() or (
                    found.offsets.tolist() != offsets[:count]):
                self._beginnings, self._is_known = [], False

    def learn(self, data: bytes, order: Indices | None = None) -> None:
        """Read messages from now on that begin as one does.

        Parameters
        ----------
        data : bytes
            A whole message, which was accepted. Of another encoding than little-endian CDR nothing
            is learnt.
        order : (K,) array of int, optional
            In which order its numbers are given.
        """
        if data[:HEADER] != LITTLE_ENDIAN or not self._is_known:
            return
        walk = Walk(data)
        texts = walk.header()
        names = walk.words[1]  # behind that of the frame
        ends = [walk.words[0] + WORD.size + WORD.unpack_from(data, walk.words[0])[0],
                names + WORD.size, *(text.stop for text in texts)]
        known = _Beginning(tuple((start, data[start:end]) for start, end in zip(
            walk.words, ends, strict=True)), aligned(walk.at, WORD.size), order)
        if all(one.parts != known.parts for one in self._beginnings):
            self._beginnings = [known, *self._beginnings[:MOST_BEGINNINGS - 1]]

    def read(self, data: bytes) -> Points | None:
        """Return what a message says; None where it is not laid out like one that was learnt."""
        for parts, end, order in self._beginnings:
            if data[:HEADER] == LITTLE_ENDIAN and all(
                    data[at:at + len(part)] == part for at, part in parts):
                return self._points(data, end, order)
        return None

    def _points(self, data: bytes, place: int, order: Indices | None) -> Points | None:
        """Return the points whose count stands at a place."""
        start = aligned(place + 2 * WORD.size, 8)  # of the first one's numbers
        if len(data) < start:
            return None
        count, first = TWO_WORDS.unpack_from(data, place)
        # Bytes may follow that mean nothing: what is laid out how, the words of points tell.
        if not count or first != self._first or (
                len(data) < start - self._before + count * self._point.itemsize):
            return None
        seconds, nanoseconds = STAMP.unpack_from(data, HEADER)
        read = self._read_one if count == 1 else self._read_all
        found = read(data, start, count)
        if found is None:
            return None
        numbers, offsets = found
        return Points(seconds * NANOSECONDS + nanoseconds,
                      numbers if order is None else numbers[:, order], offsets)

    def _read_one(self, data: bytes, start: int, count: int) -> tuple[Array, Indices] | None:
        """Return numbers and times of one point: a stream's, where every microsecond counts."""
        point = self._one.unpack_from(data, start)
        for at, word in self._words:
            if point[at] != word:
                return None
        a, b, c = self._numbers
        return np.array([point[a] + point[b] + point[c]]), np.array(
            [point[-2] * NANOSECONDS + point[-1]], np.int64)

    def _read_all(self, data: bytes, start: int, count: int) -> tuple[Array, Indices] | None:
        points = np.frombuffer(data, self._point, count, start - self._before)
        if points['empty'].any() or (points['words0'][1:, 0] != self._first).any() or any(
                (points[f'words{k}'][:, 0] != word).any()
                for k, word in enumerate(self._counts, 1)):
            return None
        return (np.concatenate([points[f'numbers{k}'] for k in range(3)], axis=1),
                points['sec'].astype(np.int64) * NANOSECONDS + points['nanosec'])
