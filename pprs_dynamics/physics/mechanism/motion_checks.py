# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Checks of the quantities of a motion: shape, finiteness, unit length, times."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MotionError

# A quaternion printed with three decimals is still accepted; a Euler triple with a 0 is not.
UNIT_LENGTH_TOLERANCE = 1e-3


def checked_matrix(
    name: str, value: ArrayLike, width: int, samples: int | None = None,
) -> Array:
    """Return a finite (N, width) array of floats, or raise MotionError naming the quantity."""
    try:
        array = np.array(value, dtype=float, ndmin=2)
    except (TypeError, ValueError):
        raise MotionError(name, f'{str(value)[:60]!r} was given',
                          f'be an (N, {width}) array of numbers', 'shape') from None
    if array.ndim != 2 or array.shape[1] != width or len(array) == 0:
        raise MotionError(name, f'its shape is {np.shape(value)}',
                          f'be (N, {width}) with N of at least 1', 'shape')
    if samples is not None and len(array) != samples:
        raise MotionError(name, f'it has {len(array)} samples', f'have {samples}, as position',
                          'shape')
    if not np.all(np.isfinite(array)):
        row = int(np.argmax(~np.isfinite(array).all(axis=1)))
        raise MotionError(name, f'sample {row} is {array[row].tolist()}', 'be finite',
                          'finite')
    return array


def normalised(quaternions: Array) -> Array:
    """Return (N, 4) quaternions with length 1, or raise MotionError for one far from it."""
    # hypot-like scaling is not needed: components are finite and a length near 1 is required.
    with np.errstate(over='ignore'):
        length = np.sqrt(np.sum(quaternions * quaternions, axis=1))
    off = np.abs(length - 1) > UNIT_LENGTH_TOLERANCE
    if np.any(off):
        row = int(np.argmax(off))
        raise MotionError('orientation', f'the quaternion of sample {row} has length '
                          f'{length[row]:.6g}', f'be 1 within {UNIT_LENGTH_TOLERANCE:g}',
                          'unit_length')
    unit: Array = quaternions / length[:, None]
    return unit


def checked_times(time: ArrayLike, samples: int) -> Array:
    """Return (N,) finite, strictly increasing times, or raise MotionError."""
    try:
        times = np.array(time, dtype=float, ndmin=1)
    except (TypeError, ValueError):
        raise MotionError('time', f'{str(time)[:60]!r} was given', f'be ({samples},) numbers',
                          'shape') from None
    if times.shape != (samples,):
        raise MotionError('time', f'its shape is {np.shape(time)}',
                          f'be ({samples},), as position', 'shape')
    if samples == 1 and isfinite(times[0]):
        return times  # of a stream's message, where the rest would take longer than the model
    if not np.all(np.isfinite(times)):
        raise MotionError('time', f'sample {int(np.argmax(~np.isfinite(times)))} is not finite',
                          'be finite', 'finite')
    if np.any(np.diff(times) <= 0):
        row = int(np.argmax(np.diff(times) <= 0))
        raise MotionError('time', f'sample {row + 1} at {times[row + 1]:.9g} s follows '
                          f'{times[row]:.9g} s', 'strictly increase', 'time')
    return times
