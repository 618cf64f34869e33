# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Vectors by their components, each a number or an array."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array, Value


class Rotation(NamedTuple):
    """Rot, from `platform` to `base`, by its columns."""

    x: Vector
    y: Vector
    z: Vector


class MotionSample(NamedTuple):
    """P, Rot, v, omega, a_o and epsilon, see `PlatformMotion`."""

    position: Vector
    rotation: Rotation
    v: Vector
    omega: Vector
    a: Vector
    epsilon: Vector


def vector(table: Any, s: int, k: int) -> Vector:
    """Return the vector in columns k to k + 2 of sample s."""
    return Vector(table[s, k], table[s, k + 1], table[s, k + 2])


def motion_sample(motion: Any, s: int) -> MotionSample:
    """Return sample s of a table of motions: P, quaternion, v, omega, a and epsilon."""
    return MotionSample(
        vector(motion, s, 0),
        rotation(motion[s, 3], motion[s, 4], motion[s, 5], motion[s, 6]),
        vector(motion, s, 7), vector(motion, s, 10), vector(motion, s, 13), vector(motion, s, 16))


def rotation(x: Value, y: Value, z: Value, w: Value) -> Rotation:
    """Return the rotation of a unit quaternion."""
    return Rotation(
        Vector(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)),
        Vector(2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)),
        Vector(2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)))


def rotation_matrix(x: Value, y: Value, z: Value, w: Value) -> Array:
    """Return the matrix of a unit quaternion, (3, 3), or of N quaternions, (N, 3, 3)."""
    return np.stack([np.stack(column, axis=-1) for column in rotation(x, y, z, w)], axis=-1)


def turned(R: Rotation, a: Vector) -> Vector:
    """Return a vector of `platform` in `base`."""
    return Vector(R.x.x * a.x + R.y.x * a.y + R.z.x * a.z,
                  R.x.y * a.x + R.y.y * a.y + R.z.y * a.z,
                  R.x.z * a.x + R.y.z * a.y + R.z.z * a.z)


def turned_back(R: Rotation, a: Vector) -> Vector:
    """Return a vector of `base` in `platform`."""
    return Vector(R.x.x * a.x + R.x.y * a.y + R.x.z * a.z,
                  R.y.x * a.x + R.y.y * a.y + R.y.z * a.z,
                  R.z.x * a.x + R.z.y * a.y + R.z.z * a.z)


class Vector(NamedTuple):
    """A vector by its components."""

    x: Value
    y: Value
    z: Value


def sqrt(x: Any) -> float:
    """Return the square root of a number, NaN below 0."""
    return math.sqrt(x) if x >= 0.0 else math.nan


def sign_over_speed(speed: Any, reversal_velocity: Any) -> Any:
    """Return tanh(s / v_rev) / s for a number s >= 0, with its limit 1 / v_rev at rest."""
    # Below 1e-8 the quotient equals its limit to rounding; dividing there would give 0 / 0.
    smallest = 1e-8 * reversal_velocity
    safe = smallest if speed < smallest else speed
    return math.tanh(safe / reversal_velocity) / safe


def plus(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return Vector(a.x + b.x, a.y + b.y, a.z + b.z)


def minus(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


def times(factor: Value, a: Vector) -> Vector:
    """Return a vector in `base` times a number."""
    return Vector(factor * a.x, factor * a.y, factor * a.z)


def combine(f: Value, a: Vector, g: Value, b: Vector, h: Value, c: Vector) -> Vector:
    """Return f a + g b + h c."""
    return Vector(f * a.x + g * b.x + h * c.x, f * a.y + g * b.y + h * c.y,
                  f * a.z + g * b.z + h * c.z)


def product(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return Vector(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


def dot(a: Vector, b: Vector) -> Value:
    """Return a . b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


def block(row: Any, start: int, shape: tuple[int, ...]) -> Any:
    """Return a table of some shape within a row of numbers."""
    return row[start:start + math.prod(shape)].reshape(shape)


def elements(named: Any) -> Any:
    """Return a named tuple of arrays whose elements are Python's numbers, which are faster.

    Compiled code takes the arrays unchanged.
    """
    return type(named)(*(array.data for array in named))
