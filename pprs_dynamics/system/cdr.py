# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Common Data Representation, the bytes of ROS messages: encapsulation, alignment, length words.

Version 1, as all middlewares of ROS 2 write it: a header of four bytes; numbers start at multiples
of their size counted after it; sequences and texts follow a length word, and texts end with a zero.
Source: OMG, DDS Interoperability Wire Protocol (RTPS) 2.5, chapter 10; CORBA 3.4, part 2, 9.3.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

# Plain CDR, version 1, little endian, and two bytes of options.
LITTLE_ENDIAN = b'\x00\x01\x00\x00'
HEADER = len(LITTLE_ENDIAN)
STAMP = struct.Struct('<iI')  # of a time or a duration: seconds, nanoseconds
WORD, _BIG_WORD = struct.Struct('<I'), struct.Struct('>I')


def aligned(offset: int, size: int) -> int:
    """Return the next place in a message that values of a size [bytes] may start at."""
    return offset + (HEADER - offset) % size


def padded(data: bytes, size: int, before: int = 0) -> bytes:
    """Return data, which follows `before` other bytes of a message, filled up to a place."""
    offset = before + len(data)
    return data + bytes(aligned(offset, size) - offset)


def with_text(data: bytes, text: str) -> bytes:
    """Return the beginning of a message with a text after it."""
    content = text.encode() + b'\x00'
    return padded(data, 4) + WORD.pack(len(content)) + content


def with_count(data: bytes, count: int, before: int = 0) -> bytes:
    """Return the beginning of a message up to the numbers of 8 bytes of a sequence."""
    data = padded(data, 4, before) + WORD.pack(count)
    return padded(data, 8, before) if count else data


def with_names(frame: str, names: Sequence[str]) -> bytes:
    """Return the beginning of a message: a header, its stamp left open, and the names of joints."""
    data = padded(with_text(LITTLE_ENDIAN + bytes(STAMP.size), frame), 4) + WORD.pack(len(names))
    for name in names:
        data = with_text(data, name)
    return data


class Walk:
    """A place in the bytes of a message, which moves on over what is read.

    Parameters
    ----------
    data : bytes
    is_little_endian : bool

    Attributes
    ----------
    at : int
        The place, which may be beyond the end.
    words : list of int
        Places of all length words until then.

    Raises
    ------
    struct.error
        From every method that reads a length word that is not there, or cannot be one.
    """

    def __init__(self, data: bytes, is_little_endian: bool = True) -> None:
        self._data, self._word = data, WORD if is_little_endian else _BIG_WORD
        self.at, self.words = HEADER, list[int]()

    def over(self, size: int, alignment: int = 4) -> None:
        """Go over that many bytes of values."""
        self.at = aligned(self.at, alignment) + size

    def count(self) -> int:
        """Read a length word."""
        place = aligned(self.at, 4)
        count: int = self._word.unpack_from(self._data, place)[0]
        # Every element takes a byte at least: more is garbage, and would loop for ever.
        if count > len(self._data):
            raise struct.error
        self.words.append(place)
        self.at = place + WORD.size
        return count

    def text(self) -> slice:
        """Go over a text, and return where it stands."""
        count = self.count()
        self.at += count
        return slice(self.at - count, self.at)

    def texts(self) -> list[slice]:
        """Go over a sequence of texts, and return where they stand."""
        return [self.text() for _ in range(self.count())]

    def numbers(self, each: int = 1) -> tuple[int, int]:
        """Go over a sequence of elements that are `each` numbers of 8 bytes.

        Returns
        -------
        (int, int)
            Place of the first, and count of the elements.
        """
        count = self.count()
        if count:
            self.over(8 * each * count, 8)
        return self.at - 8 * each * count, count

    def header(self) -> list[slice]:
        """Go over a header and the names of joints, and return where these stand."""
        self.over(STAMP.size)
        self.text()
        return self.texts()
