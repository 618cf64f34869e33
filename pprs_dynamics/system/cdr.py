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
WORD = struct.Struct('<I')


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
