# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Parameters of kernels: numbers by name, and the row of them that compiled code takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.vectors import Vector

P = TypeVar('P', bound=tuple[Any, ...])
Q = TypeVar('Q', bound=tuple[Any, ...])


class KernelParameters(Generic[P]):
    """The parameters of a kernel in both forms.

    Parameters
    ----------
    named : named tuple
        Of floats and of tuples, named or not, of the like.

    Attributes
    ----------
    row : (K,) array
        All numbers in `named`, in order. Handing it to compiled code takes a third of a
        microsecond, the named tuple itself four: half as long as the forces of a sample.
    """

    __slots__ = ('named', 'row')

    def __init__(self, named: P) -> None:
        self.named = named
        self.row = np.array(_numbers(named))

    def extended(self, form: Callable[..., Q], *others: Any) -> KernelParameters[Q]:
        """Return the parameters `form(named, *others)`, a named tuple that begins with these."""
        return KernelParameters(form(self.named, *others))


def _numbers(named: tuple[Any, ...]) -> list[float]:
    numbers: list[float] = []
    for value in named:
        if isinstance(value, tuple):
            numbers += _numbers(value)
        else:
            numbers.append(float(value))
    return numbers


class Chain(NamedTuple):
    """Constants of one chain.

    `cos` and `sin` of delta_i; `x`, `y` of the spherical joint in `platform` [m]. The slides
    alone say how the platform moves horizontally, (v_x, v_y) = sum of (`left_x`, `left_y`) times
    the speed of A_i along n_i, and one thing more: the sum of `balance` times these speeds is 0
    for a platform that does not turn.
    """

    cos: Value
    sin: Value
    x: Value
    y: Value
    left_x: Value
    left_y: Value
    balance: Value


class GeometryParameters(NamedTuple):
    """R and l [m], the sign of sin u_i, and the three chains."""

    R: Value
    l: Any  # noqa: E741
    elbow: Value
    chains: tuple[Chain, Chain, Chain]


class PlatformBody(NamedTuple):
    """Mass [kg], centre [m] and inertia [kg m^2] of platform and payload, in `platform`."""

    mass: Value
    centre: Vector
    moments: Vector
    products: Vector


class ChainMasses(NamedTuple):
    """Masses in one chain [kg]."""

    slide: Value
    lift: Value
    rod: Value


class RobotParameters(NamedTuple):
    """Geometry, masses, and gravity in `base` [m/s^2]."""

    geometry: GeometryParameters
    platform: PlatformBody
    masses: tuple[ChainMasses, ChainMasses, ChainMasses]
    gravity: Vector
