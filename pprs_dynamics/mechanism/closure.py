"""[B]^-1 of Eq. (4) in closed form, from what the six rows of [B] have in common.

Row i of the slides says n_i . v + m_i . omega = q_dot_i, with m_i = rho_i x n_i. The n_i are
horizontal and constant: two combinations of the three rows give v_x and v_y, and the third, in
which the n_i add up to nothing, speaks of omega alone,

    m . omega = b,    m = sum of balance_i m_i,    b = sum of balance_i q_dot_i.

With v_x and v_y put in, row i of the lifts says s_i v_z + g_i . omega = b_i, s_i = sin u_i. These
four equations are solved by Cramer's rule; their determinant is a constant times det [B], so it
tells one assembly mode from the other. There is no pivot to choose, and nothing is divided by
but the determinant.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from pprs_dynamics.mechanism.inverse_kinematics import read_chain, rod_direction
from pprs_dynamics.mechanism.numbers import Chain, chain
from pprs_dynamics.mechanism.vectors import (
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

INVERSE_COLUMNS = 36


class Wrench(NamedTuple):
    """A force and its moment about o, in `base`."""

    force: Vector
    moment: Vector


class Twist(NamedTuple):
    """v of o and omega, in `base`."""

    v: Vector
    omega: Vector


class Inverse(NamedTuple):
    """[B]^-1 by its columns: twists by unit right sides of Eq. (4), slides then lifts."""

    slide_1: Twist
    slide_2: Twist
    slide_3: Twist
    lift_1: Twist
    lift_2: Twist
    lift_3: Twist
    determinant: Any


class Six(NamedTuple):
    """One number for each drive."""

    slide_1: Any
    slide_2: Any
    slide_3: Any
    lift_1: Any
    lift_2: Any
    lift_3: Any


class Rows(NamedTuple):
    """Rows of [B] that belong to one chain: unit reactions H_i and V_i on the platform."""

    slide: Wrench
    lift: Wrench


def unit_wrench(chain: Any, direction: ChainVector, arm: ChainVector) -> Wrench:
    """Return [f, rho x f] in `base` for a unit force f at A_i."""
    return Wrench(in_base(chain, direction), in_base(chain, cross(arm, direction)))


def closure_rows(chain: Any, arm: ChainVector, c_u: Any, s_u: Any) -> Rows:
    """Return the rows of [B] of a chain."""
    zero = 0.0 * c_u
    axis = ChainVector(zero, zero + 1.0, zero)
    return Rows(unit_wrench(chain, axis, arm),                                 # Eq. (4)
                unit_wrench(chain, rod_direction(c_u, s_u), arm))              # Eq. (4)


class Elimination(NamedTuple):
    """What is left of Eq. (4) without v_x and v_y, solved.

    v_x = h_x - `along_x` . omega, and v_y alike; `z0`, `w0` are v_z and omega for a unit b, `z1`
    to `w3` those for unit b_i.
    """

    along_x: Vector
    along_y: Vector
    z0: Any
    w0: Vector
    z1: Any
    w1: Vector
    z2: Any
    w2: Vector
    z3: Any
    w3: Vector
    determinant: Any


def eliminate(
    p: Any, rows_1: Rows, rows_2: Rows, rows_3: Rows, one: Any, two: Any, three: Any,
) -> Elimination:
    """Solve Eq. (4) for unit right sides; infinite or NaN where the determinant is 0.

    Parameters
    ----------
    p : row of numbers of the geometry
    rows_1, rows_2, rows_3 : Rows
    one, two, three : ChainSample or alike
        Of which `cos_u` and `sin_u` are taken.
    """
    k1, k2, k3 = chain(p, 0), chain(p, 1), chain(p, 2)
    m1, m2, m3 = rows_1.slide.moment, rows_2.slide.moment, rows_3.slide.moment
    along_x = combine(k1.left_x, m1, k2.left_x, m2, k3.left_x, m3)
    along_y = combine(k1.left_y, m1, k2.left_y, m2, k3.left_y, m3)
    m = combine(k1.balance, m1, k2.balance, m2, k3.balance, m3)
    g1 = _reduced(k1, one.cos_u, rows_1.lift.moment, along_x, along_y)
    g2 = _reduced(k2, two.cos_u, rows_2.lift.moment, along_x, along_y)
    g3 = _reduced(k3, three.cos_u, rows_3.lift.moment, along_x, along_y)
    s1, s2, s3 = one.sin_u, two.sin_u, three.sin_u
    g23, g31, g12 = product(g2, g3), product(g3, g1), product(g1, g2)
    G = combine(s1, g23, s2, g31, s3, g12)
    determinant = dot(m, G)
    share = 1.0 / determinant
    return Elimination(
        along_x, along_y, -share * dot(g1, g23), times(share, G),
        share * dot(m, g23), product(m, _difference(share * s2, g3, share * s3, g2)),
        share * dot(m, g31), product(m, _difference(share * s3, g1, share * s1, g3)),
        share * dot(m, g12), product(m, _difference(share * s1, g2, share * s2, g1)),
        determinant)


def solve_closure(p: Any, e: Elimination, one: Any, two: Any, three: Any, right: Six) -> Twist:
    """Return the twist for right sides of Eq. (4)."""
    k1, k2, k3 = chain(p, 0), chain(p, 1), chain(p, 2)
    a, b, c = right.slide_1, right.slide_2, right.slide_3
    h_x = k1.left_x * a + k2.left_x * b + k3.left_x * c
    h_y = k1.left_y * a + k2.left_y * b + k3.left_y * c
    f0 = k1.balance * a + k2.balance * b + k3.balance * c
    return _twist(e, h_x, h_y, f0, right.lift_1 + one.cos_u * (k1.cos * h_x + k1.sin * h_y),
                  right.lift_2 + two.cos_u * (k2.cos * h_x + k2.sin * h_y),
                  right.lift_3 + three.cos_u * (k3.cos * h_x + k3.sin * h_y))


def _twist(e: Elimination, h_x: Any, h_y: Any, f0: Any, f1: Any, f2: Any, f3: Any) -> Twist:
    omega = plus(times(f0, e.w0), combine(f1, e.w1, f2, e.w2, f3, e.w3))
    return Twist(Vector(h_x - dot(e.along_x, omega), h_y - dot(e.along_y, omega),
                        f0 * e.z0 + f1 * e.z1 + f2 * e.z2 + f3 * e.z3), omega)


def invert(p: Any, e: Elimination, one: Any, two: Any, three: Any) -> Inverse:
    """Return [B]^-1 and the determinant."""
    return Inverse(
        _slide_column(p, e, one, two, three, chain(p, 0)),
        _slide_column(p, e, one, two, three, chain(p, 1)),
        _slide_column(p, e, one, two, three, chain(p, 2)),
        _lift_column(e, e.z1, e.w1), _lift_column(e, e.z2, e.w2), _lift_column(e, e.z3, e.w3),
        e.determinant)


def _slide_column(p: Any, e: Elimination, one: Any, two: Any, three: Any, k: Chain) -> Twist:
    k1, k2, k3 = chain(p, 0), chain(p, 1), chain(p, 2)
    return _twist(e, k.left_x, k.left_y, k.balance,
                  one.cos_u * (k1.cos * k.left_x + k1.sin * k.left_y),
                  two.cos_u * (k2.cos * k.left_x + k2.sin * k.left_y),
                  three.cos_u * (k3.cos * k.left_x + k3.sin * k.left_y))


def _lift_column(e: Elimination, v_z: Any, omega: Vector) -> Twist:
    return Twist(Vector(-dot(e.along_x, omega), -dot(e.along_y, omega), v_z), omega)


def _reduced(k: Chain, c_u: Any, moment: Vector, along_x: Vector, along_y: Vector) -> Vector:
    """Return g_i: the moment of V_i when v_x and v_y are put in."""
    return combine(1.0, moment, c_u * k.cos, along_x, c_u * k.sin, along_y)


def _difference(f: Any, a: Vector, g: Any, b: Vector) -> Vector:
    return Vector(f * a.x - g * b.x, f * a.y - g * b.y, f * a.z - g * b.z)


def rod_row(chain: Any, l: Any, arm: ChainVector, s_u: Any) -> Wrench:
    """Return u_dot_i per twist: the rod follows its tip, u_dot_i = e_i . v_Ai / (l sin u_i)."""
    share = 1.0 / (l * s_u)
    zero = 0.0 * s_u
    return unit_wrench(chain, ChainVector(share, zero, zero), arm)             # Eq. (10)


def power(wrench: Wrench, twist: Twist) -> Any:
    """Return the power of a wrench on a twist."""
    return dot(wrench.force, twist.v) + dot(wrench.moment, twist.omega)


def answer(inverse: Inverse, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> Twist:
    """Return the twist that right sides of Eq. (4) give, slides then lifts."""
    one, two, three = inverse.slide_1, inverse.slide_2, inverse.slide_3
    four, five, six = inverse.lift_1, inverse.lift_2, inverse.lift_3
    return Twist(plus(combine(a, one.v, b, two.v, c, three.v),
                      combine(d, four.v, e, five.v, f, six.v)),
                 plus(combine(a, one.omega, b, two.omega, c, three.omega),
                      combine(d, four.omega, e, five.omega, f, six.omega)))


def square(twist: Twist, r: Any) -> Any:
    """Return the squared length of a twist, rotations times r."""
    return dot(twist.v, twist.v) + r * r * dot(twist.omega, twist.omega)


def condition_bound(
    inverse: Inverse, rows_1: Rows, rows_2: Rows, rows_3: Rows, s1: Any, s2: Any, s3: Any, r: Any,
) -> Any:
    """Return the square of the Frobenius condition number of [J], rotations times r."""
    a1, a2, a3 = s1 * s1, s2 * s2, s3 * s3
    J = (square(inverse.slide_1, r) + square(inverse.slide_2, r) + square(inverse.slide_3, r)
         + a1 * square(inverse.lift_1, r) + a2 * square(inverse.lift_2, r)
         + a3 * square(inverse.lift_3, r))
    n = 1.0 / r
    J_inverse = (_size(rows_1.slide, n) + _size(rows_2.slide, n) + _size(rows_3.slide, n)
                 + _size(rows_1.lift, n) / a1 + _size(rows_2.lift, n) / a2
                 + _size(rows_3.lift, n) / a3)
    return J * J_inverse


def _size(wrench: Wrench, n: Any) -> Any:
    # The force of a unit reaction has length 1.
    return 1.0 + n * n * dot(wrench.moment, wrench.moment)


def write_twist(table: Any, s: Any, j: int, twist: Twist) -> None:
    """Write column j of [B]^-1 at sample s."""
    v, omega = twist.v, twist.omega
    table[s, j], table[s, 6 + j], table[s, 12 + j] = v.x, v.y, v.z
    table[s, 18 + j], table[s, 24 + j], table[s, 30 + j] = omega.x, omega.y, omega.z


def read_twist(table: Any, s: Any, j: int) -> Twist:
    """Return column j of [B]^-1 at sample s."""
    return Twist(Vector(table[s, j], table[s, 6 + j], table[s, 12 + j]),
                 Vector(table[s, 18 + j], table[s, 24 + j], table[s, 30 + j]))


def read_inverse(table: Any, s: Any) -> Inverse:
    """Return [B]^-1 at sample s of a table, without its determinant."""
    return Inverse(read_twist(table, s, 0), read_twist(table, s, 1), read_twist(table, s, 2),
                   read_twist(table, s, 3), read_twist(table, s, 4), read_twist(table, s, 5), 0.0)


def inverse_kernel(p: Any, s: Any, chains: Any, inverse: Any, bound: Any) -> Any:
    """Fill tables of [B]^-1 and of `condition_bound` from one of chains.

    p is the geometry, then the square of the largest allowed condition number.
    """
    one, two, three = read_chain(chains, s, 0), read_chain(chains, s, 1), read_chain(chains, s, 2)
    rows_1 = closure_rows(chain(p, 0), one.arm, one.cos_u, one.sin_u)
    rows_2 = closure_rows(chain(p, 1), two.arm, two.cos_u, two.sin_u)
    rows_3 = closure_rows(chain(p, 2), three.arm, three.cos_u, three.sin_u)
    eliminated = eliminate(p, rows_1, rows_2, rows_3, one, two, three)
    B_inverse = invert(p, eliminated, one, two, three)
    write_twist(inverse, s, 0, B_inverse.slide_1)
    write_twist(inverse, s, 1, B_inverse.slide_2)
    write_twist(inverse, s, 2, B_inverse.slide_3)
    write_twist(inverse, s, 3, B_inverse.lift_1)
    write_twist(inverse, s, 4, B_inverse.lift_2)
    write_twist(inverse, s, 5, B_inverse.lift_3)
    found = condition_bound(B_inverse, rows_1, rows_2, rows_3, one.sin_u, two.sin_u, three.sin_u,
                            p[25])
    bound[s, 0] = found
    return (found <= p[24]) & (B_inverse.determinant != 0.0)
