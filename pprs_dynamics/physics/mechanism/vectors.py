# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Vectors by their components, each a float or an array: in `base`, or in a chain's frame."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from pprs_dynamics.arrays import Value


class Vector(NamedTuple):
    """A vector in `base` or `platform`."""

    x: Value
    y: Value
    z: Value


class ChainVector(NamedTuple):
    """A vector by its components in a chain's own frame (e_i, n_i, k).

    e_i points radially outwards from the base's centre, n_i along the revolute axis of C_i
    (the slide's direction), k up; e_i x n_i = k. Of all chains at once, each component is (N, 3),
    chains last.
    """

    e: Value
    n: Value
    k: Value


def sqrt(x: Any) -> float:
    """Return the square root of a number, NaN below 0."""
    return math.sqrt(x) if x >= 0.0 else math.nan


def add(a: ChainVector, b: ChainVector) -> ChainVector:
    """Return a + b."""
    return ChainVector(a.e + b.e, a.n + b.n, a.k + b.k)


def cross(a: ChainVector, b: ChainVector) -> ChainVector:
    """Return a x b."""
    return ChainVector(a.n * b.k - a.k * b.n, a.k * b.e - a.e * b.k, a.e * b.n - a.n * b.e)


def plus(a: Vector, b: Vector) -> Vector:
    """Return a + b in `base`."""
    return Vector(a.x + b.x, a.y + b.y, a.z + b.z)


def minus(a: Vector, b: Vector) -> Vector:
    """Return a - b in `base`."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


def times(factor: Value, a: Vector) -> Vector:
    """Return a vector in `base` times a number."""
    return Vector(factor * a.x, factor * a.y, factor * a.z)


def combine(f: Value, a: Vector, g: Value, b: Vector, h: Value, c: Vector) -> Vector:
    """Return f a + g b + h c in `base`."""
    return Vector(f * a.x + g * b.x + h * c.x, f * a.y + g * b.y + h * c.y,
                  f * a.z + g * b.z + h * c.z)


def product(a: Vector, b: Vector) -> Vector:
    """Return a x b in `base`."""
    return Vector(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


def dot(a: Vector, b: Vector) -> Value:
    """Return a . b in `base`."""
    return a.x * b.x + a.y * b.y + a.z * b.z


def in_chain(chain: Any, v: Vector) -> ChainVector:
    """Return a vector of `base` in the frame of a chain with `cos` and `sin` of its angle."""
    return ChainVector(v.x * chain.cos + v.y * chain.sin, v.y * chain.cos - v.x * chain.sin, v.z)


def in_base(chain: Any, v: ChainVector) -> Vector:
    """Return a vector of a chain's frame in `base`."""
    return Vector(v.e * chain.cos - v.n * chain.sin, v.e * chain.sin + v.n * chain.cos, v.k)
