# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""[B]^-1 of Eq. (4) in closed form, from what the six rows of [B] have in common.

Row i of the slides says n_i . v + m_i . omega = q_dot_i, with m_i = rho_i x n_i. The n_i are
horizontal and constant: two combinations of the three rows give v_x and v_y, and the third, in
which the n_i add up to nothing, speaks of omega alone,

    m . omega = b,    m = sum of balance_i m_i,    b = sum of balance_i q_dot_i.

With v_x and v_y put in, row i of the lifts says s_i v_z + g_i . omega = b_i, s_i = sin u_i. These
four equations are solved by Cramer's rule; their determinant is a constant times det [B]. There is
no pivot to choose, and nothing is divided by but the determinant.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.vectors import (
    ChainVector,
    Vector,
    combine,
    cross,
    dot,
    in_base,
    plus,
    product,
    times,
)
from pprs_dynamics.physics.three_pprs.inverse_kinematics import rod_direction
from pprs_dynamics.physics.three_pprs.kernel_parameters import (
    CHAINS,
    GeometryParameters,
    each_chain,
)


class Wrench(NamedTuple):
    """A force and its moment about o, in `base`."""

    force: Vector
    moment: Vector


class Twist(NamedTuple):
    """v of o and omega, in `base`."""

    v: Vector
    omega: Vector


class DriveValues(NamedTuple):
    """One number, or one twist, for each drive: of the three slides and of the three lifts."""

    slides: tuple[Any, Any, Any]
    lifts: tuple[Any, Any, Any]


class ClosureRows(NamedTuple):
    """Rows of [B] that belong to one chain: unit reactions H_i and V_i on the platform."""

    slide: Wrench
    lift: Wrench


ThreeRows = tuple[ClosureRows, ClosureRows, ClosureRows]


def unit_wrench(chain: Any, direction: ChainVector, arm: ChainVector) -> Wrench:
    """Return [f, rho x f] in `base` for a unit force f at A_i."""
    return Wrench(in_base(chain, direction), in_base(chain, cross(arm, direction)))


def closure_rows(chain: Any, arm: ChainVector, c_u: Value, s_u: Value) -> ClosureRows:
    """Return the rows of [B] of a chain."""
    zero = 0.0 * c_u
    axis = ChainVector(zero, zero + 1.0, zero)
    return ClosureRows(unit_wrench(chain, axis, arm),                          # Eq. (4)
                       unit_wrench(chain, rod_direction(c_u, s_u), arm))       # Eq. (4)


@each_chain
def rows_of_chains(i: int, geometry: GeometryParameters, rods: Any) -> ClosureRows:
    """Return the rows of [B] of chain i from its `arm`, `cos_u` and `sin_u`."""
    return closure_rows(geometry.chains[i], rods[i].arm, rods[i].cos_u, rods[i].sin_u)


class Elimination(NamedTuple):
    """Eq. (4) after elimination of v_x and v_y, solved.

    v_x = h_x - `along_x` . omega, and v_y alike; `z0`, `w0` are v_z and omega for a unit b, the
    `z` and `w` those for unit b_i.
    """

    along_x: Vector
    along_y: Vector
    z0: Value
    w0: Vector
    z: tuple[Any, Any, Any]
    w: tuple[Vector, Vector, Vector]


def _eliminate(geometry: GeometryParameters, rows: ThreeRows, rods: Any) -> Elimination:
    """Solve Eq. (4) for unit right sides."""
    k1, k2, k3 = geometry.chains
    m1, m2, m3 = rows[0].slide.moment, rows[1].slide.moment, rows[2].slide.moment
    along_x = combine(k1.left_x, m1, k2.left_x, m2, k3.left_x, m3)
    along_y = combine(k1.left_y, m1, k2.left_y, m2, k3.left_y, m3)
    m = combine(k1.balance, m1, k2.balance, m2, k3.balance, m3)
    g1, g2, g3 = _reduced_moments(geometry, rods, rows, along_x, along_y)
    s1, s2, s3 = rods[0].sin_u, rods[1].sin_u, rods[2].sin_u
    g23, g31, g12 = product(g2, g3), product(g3, g1), product(g1, g2)
    G = combine(s1, g23, s2, g31, s3, g12)
    share = 1.0 / dot(m, G)
    return Elimination(
        along_x, along_y, -share * dot(g1, g23), times(share, G),
        (share * dot(m, g23), share * dot(m, g31), share * dot(m, g12)),
        (product(m, _difference(share * s2, g3, share * s3, g2)),
         product(m, _difference(share * s3, g1, share * s1, g3)),
         product(m, _difference(share * s1, g2, share * s2, g1))))


def _twist(
    e: Elimination, h_x: Value, h_y: Value, f0: Value, f1: Value, f2: Value, f3: Value,
) -> Twist:
    omega = plus(times(f0, e.w0), combine(f1, e.w[0], f2, e.w[1], f3, e.w[2]))
    return Twist(Vector(h_x - dot(e.along_x, omega), h_y - dot(e.along_y, omega),
                        f0 * e.z0 + f1 * e.z[0] + f2 * e.z[1] + f3 * e.z[2]), omega)


def invert(geometry: GeometryParameters, rows: ThreeRows, rods: Any) -> DriveValues:
    """Return [B]^-1 by its columns, the twists for unit right sides of Eq. (4).

    Infinite or NaN where det [B] is 0.

    Parameters
    ----------
    geometry : GeometryParameters
    rows : three ClosureRows
    rods : three ChainSample
    """
    e = _eliminate(geometry, rows, rods)
    return DriveValues(_slide_columns(geometry, e, rods), _lift_columns(e))


@each_chain
def _slide_columns(i: int, geometry: GeometryParameters, e: Elimination, rods: Any) -> Twist:
    k = geometry.chains[i]
    f1, f2, f3 = _horizontal_shares(geometry, rods, k.left_x, k.left_y)
    return _twist(e, k.left_x, k.left_y, k.balance, f1, f2, f3)


@each_chain
def _lift_columns(i: int, e: Elimination) -> Twist:
    return Twist(Vector(-dot(e.along_x, e.w[i]), -dot(e.along_y, e.w[i]), e.z[i]), e.w[i])


@each_chain
def _horizontal_shares(
    i: int, geometry: GeometryParameters, rods: Any, h_x: Value, h_y: Value,
) -> Any:
    """Return the share of eliminated v_x and v_y in the right side of lift i."""
    k = geometry.chains[i]
    return rods[i].cos_u * (k.cos * h_x + k.sin * h_y)


@each_chain
def _reduced_moments(
    i: int, geometry: GeometryParameters, rods: Any, rows: ThreeRows, along_x: Vector,
    along_y: Vector,
) -> Vector:
    """Return g_i: the moment of V_i after elimination of v_x and v_y."""
    k, c_u = geometry.chains[i], rods[i].cos_u
    return combine(1.0, rows[i].lift.moment, c_u * k.cos, along_x, c_u * k.sin, along_y)


def _difference(f: Value, a: Vector, g: Value, b: Vector) -> Vector:
    return Vector(f * a.x - g * b.x, f * a.y - g * b.y, f * a.z - g * b.z)


def rod_row(chain: Any, length: Value, arm: ChainVector, s_u: Value) -> Wrench:
    """Return u_dot_i per twist: the rod follows its tip, u_dot_i = e_i . v_Ai / (l sin u_i)."""
    share = 1.0 / (length * s_u)
    zero = 0.0 * s_u
    return unit_wrench(chain, ChainVector(share, zero, zero), arm)             # Eq. (10)


def power(wrench: Wrench, twist: Twist) -> Value:
    """Return the power of a wrench on a twist."""
    return dot(wrench.force, twist.v) + dot(wrench.moment, twist.omega)


def square(twist: Twist, r: Any) -> Any:
    """Return the squared length of a twist, rotations times r."""
    return dot(twist.v, twist.v) + r * r * dot(twist.omega, twist.omega)


def condition_bound(inverse: DriveValues, rows: ThreeRows, rods: Any, r: Any) -> Any:
    """Return the square of the Frobenius condition number of [J], rotations times r."""
    n = 1.0 / r
    J, J_inverse = 0.0 * n, 0.0 * n
    for i in range(CHAINS):
        sine = rods[i].sin_u * rods[i].sin_u
        J = J + square(inverse.slides[i], r) + sine * square(inverse.lifts[i], r)
        J_inverse = J_inverse + _size(rows[i].slide, n) + _size(rows[i].lift, n) / sine
    return J * J_inverse


def _size(wrench: Wrench, n: Any) -> Any:
    # The force of a unit reaction has length 1.
    return 1.0 + n * n * dot(wrench.moment, wrench.moment)
