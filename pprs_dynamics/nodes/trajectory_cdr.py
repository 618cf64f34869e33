"""The CDR bytes of trajectory_msgs/MultiDOFJointTrajectory, read without building objects.

Points with one transform, one velocity and one acceleration have a constant length, so that
NumPy reads a thousand of them in the time that message objects need for two. Every word that
makes this layout is compared; whatever differs is left to the ordinary path.
"""

from __future__ import annotations

import struct

import numpy as np

from pprs_dynamics.measurement.samples import Indices
from pprs_dynamics.mechanism.robot import Array

# Encapsulation: plain CDR, version 1, little endian, without options.
LITTLE_ENDIAN = b'\x00\x01\x00\x00'
HEADER = 4
STAMP = struct.Struct('<iI')
WORD = struct.Struct('<I')
NANOSECONDS = 1_000_000_000
NUMBERS = 19  # position, quaternion, two twists

# What stands between stamp and points for each frame that means `base`: length words and
# names, padding left out as it may hold anything. (place, bytes), and the place of the count.
_NAMES = WORD.pack(1), WORD.pack(9) + b'platform\x00'
_HEADS = {
    1: (((12, WORD.pack(1) + b'\x00'), (20, _NAMES[0] + _NAMES[1])), 40),
    5: (((12, WORD.pack(5) + b'base\x00'), (24, _NAMES[0] + _NAMES[1])), 44),
}
_FRAMES = {1: '', 5: 'base'}
# The first number of the first point stands here for both heads, as numbers are aligned to 8.
_FIRST = 52
_POINT = np.dtype([
    # Of the first point, the length word may stand after the padding instead of before it.
    ('transforms', '<u4', 2), ('pose', '<f8', 7),
    ('velocities', '<u4', 2), ('velocity', '<f8', 6),
    ('accelerations', '<u4', 2), ('acceleration', '<f8', 6),
    ('time', [('sec', '<i4'), ('nanosec', '<u4')])])


def read_points(data: bytes) -> tuple[int, Array, Indices] | None:
    """Return header stamp [ns], numbers (N, 19) and time_from_start (N,) [ns] of a message.

    Parameters
    ----------
    data : bytes
        A serialised trajectory_msgs/MultiDOFJointTrajectory.

    Returns
    -------
    tuple or None
        None where the message is not one for `platform` in `base`, with at least one point and
        one transform, one velocity and one acceleration each, in little-endian CDR.
    """
    if len(data) < _FIRST + _POINT.itemsize - 8 or data[:HEADER] != LITTLE_ENDIAN:
        return None
    head = _HEADS.get(WORD.unpack_from(data, 12)[0])
    if head is None or any(data[at:at + len(text)] != text for at, text in head[0]):
        return None
    count = WORD.unpack_from(data, head[1])[0]
    # Equality, and not merely enough: a longer message is not what it seems.
    if len(data) != _FIRST - 8 + count * _POINT.itemsize or not count:
        return None
    # The first point's own word of the transforms follows the count at once.
    if WORD.unpack_from(data, head[1] + 4)[0] != 1:
        return None
    points = np.frombuffer(data, _POINT, count, _FIRST - 8)
    if count > 1 and not (points['transforms'][1:, 0] == 1).all():
        return None
    if not ((points['velocities'][:, 0] == 1).all() and (points['accelerations'][:, 0] == 1).all()):
        return None
    numbers = np.empty((count, NUMBERS))
    numbers[:, :7], numbers[:, 7:13] = points['pose'], points['velocity']
    numbers[:, 13:] = points['acceleration']
    times = points['time']
    seconds, nanoseconds = STAMP.unpack_from(data, 4)
    offsets = times['sec'].astype(np.int64) * NANOSECONDS + times['nanosec']
    return seconds * NANOSECONDS + nanoseconds, numbers, offsets


def is_whole(data: bytes) -> bool:
    """Return whether the bytes hold every element that their length words promise.

    The deserialiser of rmw_fastrtps does not notice where a message is cut off within padding
    before a number, and reads on in foreign memory.
    """
    if len(data) < HEADER or data[0] or data[1] > 1:
        # Another encoding: its deserialiser has to know.
        return len(data) >= HEADER
    word = WORD if data[1] else struct.Struct('>I')
    try:
        at = _after_text(data, word, HEADER + STAMP.size)
        count, at = _count(data, word, at)
        for _ in range(count):
            at = _after_text(data, word, at)
        count, at = _count(data, word, at)
        for _ in range(count):
            for numbers in (7, 6, 6):
                elements, at = _count(data, word, at)
                if elements:
                    at = _aligned(at, 8) + 8 * numbers * elements
            at = _aligned(at, 4) + STAMP.size
    except struct.error:
        return False
    return at <= len(data)


def _count(data: bytes, word: struct.Struct, at: int) -> tuple[int, int]:
    """Return the length word at a place, and the place after it."""
    at = _aligned(at, 4)
    count: int = word.unpack_from(data, at)[0]
    # Every element takes a byte at least: more than that is garbage, and would loop for ever.
    if count > len(data):
        raise struct.error
    return count, at + word.size


def _after_text(data: bytes, word: struct.Struct, at: int) -> int:
    length, at = _count(data, word, at)
    return at + length


def _aligned(at: int, size: int) -> int:
    """Return the next place that values of a size may start at, counted after the header."""
    return at + (HEADER - at) % size
