"""The robot's numbers as one row, which is how kernels take them, and names for its elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pprs_dynamics.mechanism.vectors import Vector

if TYPE_CHECKING:
    from pprs_dynamics.arrays import Array
    from pprs_dynamics.mechanism.robot import Geometry, Robot

CHAINS = 3
GEOMETRY = 0
PER_CHAIN = 7
BODIES = CHAINS + CHAINS * PER_CHAIN
CARRIAGES = BODIES + 13
ROBOT_NUMBERS = CARRIAGES + 9


class Chain(NamedTuple):
    """Constants of one chain.

    `cos` and `sin` of delta_i; `x`, `y` of the spherical joint in `platform` [m]. The slides
    alone say how the platform moves horizontally, (v_x, v_y) = sum of (`left_x`, `left_y`) times
    the speed of A_i along n_i, and one thing more: the sum of `balance` times these speeds is 0
    for a platform that does not turn.
    """

    cos: Any
    sin: Any
    x: Any
    y: Any
    left_x: Any
    left_y: Any
    balance: Any


class Lengths(NamedTuple):
    """R and l [m], and the sign of sin u_i."""

    R: Any
    l: Any
    elbow: Any


class Platform(NamedTuple):
    """Mass [kg], centre [m] and inertia [kg m^2] of platform and payload, in `platform`."""

    mass: Any
    centre: Vector
    moments: Vector
    products: Vector


class Carriages(NamedTuple):
    """Masses of one chain: slide, lift and rod [kg]."""

    slide: Any
    lift: Any
    rod: Any


def geometry_numbers(geometry: Geometry) -> Array:
    """Return lengths and the constants of the chains, (24,)."""
    frames, platform = geometry.frames, np.asarray(geometry.platform_angles)
    normals = np.stack((-frames.sin, frames.cos), axis=1)
    delta = np.asarray(geometry.chain_angles)
    # The weights with which the three directions n_i add up to nothing.
    balance = np.sin(np.roll(delta, -2) - np.roll(delta, -1))
    left = np.linalg.pinv(normals)
    chains = np.stack((
        frames.cos, frames.sin, geometry.platform_radius * np.cos(platform),
        geometry.platform_radius * np.sin(platform), left[0], left[1], balance), axis=1)
    return np.concatenate(
        ([geometry.base_radius, geometry.rod_length, geometry.elbow_sign], chains.ravel()))


def robot_numbers(robot: Robot) -> Array:
    """Return the numbers of the geometry, then masses and gravity, (46,)."""
    masses = robot.masses
    carriages = np.stack((masses.slides, masses.lifts, masses.rods), axis=1)
    return np.concatenate((
        robot.geometry.numbers, [masses.total], masses.centre, masses.inertia, robot.gravity,
        carriages.ravel()))


def lengths(p: Any) -> Lengths:
    """Return the lengths in a row of numbers."""
    return Lengths(p[0], p[1], p[2])


def chain(p: Any, i: int) -> Chain:
    """Return the constants of chain i in a row of numbers."""
    k = CHAINS + PER_CHAIN * i
    return Chain(p[k], p[k + 1], p[k + 2], p[k + 3], p[k + 4], p[k + 5], p[k + 6])


def platform(p: Any) -> Platform:
    """Return the platform's numbers in a row of numbers."""
    k = BODIES
    return Platform(p[k], Vector(p[k + 1], p[k + 2], p[k + 3]),
                    Vector(p[k + 4], p[k + 5], p[k + 6]), Vector(p[k + 7], p[k + 8], p[k + 9]))


def gravity(p: Any) -> Vector:
    """Return gravity in a row of numbers [m/s^2]."""
    return Vector(p[BODIES + 10], p[BODIES + 11], p[BODIES + 12])


def carriages(p: Any, i: int) -> Carriages:
    """Return the masses of chain i in a row of numbers."""
    k = CARRIAGES + 3 * i
    return Carriages(p[k], p[k + 1], p[k + 2])
