# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the 3-PPRS' kernels, by name."""

from __future__ import annotations

from typing import Any, NamedTuple

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.vectors import Vector


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
