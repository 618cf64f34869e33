# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Common Data Representation, the bytes of ROS messages: encapsulation, alignment, length words.

Version 1, as all middlewares of ROS 2 write it: a header of four bytes; numbers start at multiples
of their size counted after it; sequences and texts follow a length word, and texts end with a zero.
Source: OMG, DDS Interoperability Wire Protocol (RTPS) 2.5, chapter 10; CORBA 3.4, part 2, 9.3.
"""

from __future__ import annotations

import struct

# Plain CDR, version 1, little endian, and two bytes of options.
LITTLE_ENDIAN = b'\x00\x01\x00\x00'
HEADER = len(LITTLE_ENDIAN)
STAMP = struct.Struct('<iI')  # of a time or a duration: seconds, nanoseconds
WORD, _BIG_WORD = struct.Struct('<I'), struct.Struct('>I')


def aligned(offset: int, size: int) -> int:
    """Return the next place in a message that values of a size [bytes] may start at."""
    return offset + (HEADER - offset) % size


class Walk:
    """A reading position in the bytes of a message.

    Parameters
    ----------
    data : bytes
        Its second byte is the order of bytes.

    Attributes
    ----------
    at : int
        The place, which may be beyond the end.

    Raises
    ------
    struct.error
        From every method that reads a length word that is not there, or cannot be one.
    """

    def __init__(self, data: bytes) -> None:
        self._data, self._word = data, WORD if data[1] == LITTLE_ENDIAN[1] else _BIG_WORD
        self.at = HEADER

    def over(self, size: int, alignment: int = 4) -> None:
        """Skip that many bytes of values."""
        self.at = aligned(self.at, alignment) + size

    def count(self) -> int:
        """Read a length word."""
        place = aligned(self.at, 4)
        count: int = self._word.unpack_from(self._data, place)[0]
        # Every element takes a byte at least: more is garbage, and would loop for ever.
        if count > len(self._data):
            raise struct.error
        self.at = place + WORD.size
        return count

    def text(self) -> slice:
        """Skip a text and return its place."""
        count = self.count()
        self.at += count
        return slice(self.at - count, self.at)

    def texts(self) -> list[slice]:
        """Skip a sequence of texts and return their places."""
        return [self.text() for _ in range(self.count())]

    def numbers(self, width: int = 1) -> None:
        """Skip a sequence of elements that are `width` numbers of 8 bytes."""
        count = self.count()
        if count:
            self.over(8 * width * count, 8)

    def header(self) -> None:
        """Skip a header and the names of joints."""
        self.over(STAMP.size)
        self.text()
        self.texts()
