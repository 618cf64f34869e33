# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Vectors by their components, each a number or an array."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from pprs_dynamics.arrays import Value


class Vector(NamedTuple):
    """A vector by its components."""

    x: Value
    y: Value
    z: Value


def sqrt(x: Any) -> float:
    """Return the square root of a number, NaN below 0."""
    return math.sqrt(x) if x >= 0.0 else math.nan


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
