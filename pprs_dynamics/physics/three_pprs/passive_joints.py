# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in the passive joints C_i and A_i, Eq. (9), and its drive forces by Eq. (12)."""

from __future__ import annotations

from typing import Any, NamedTuple

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.reversal import sign_over_speed
from pprs_dynamics.physics.mechanism.vectors import ChainVector, in_base, plus, sqrt, times
from pprs_dynamics.physics.three_pprs.closure import DriveValues, Wrench, power, rod_row
from pprs_dynamics.physics.three_pprs.inverse_kinematics import ThreeChains
from pprs_dynamics.physics.three_pprs.kernel_parameters import (
    GeometryParameters,
    Joints,
    each_chain,
)


class Turnover(NamedTuple):
    """sgn(s) / s in C_i and in A_i [s/rad]."""

    revolute: Value
    spherical: Value


def relative_rate(u_dot: Value, omega: ChainVector) -> ChainVector:
    """Return omega_n = u_dot_i n_i - omega, of the rod relative to the platform [rad/s]."""
    return ChainVector(-omega.e, u_dot - omega.n, -omega.k)                    # Eq. (9)


def length(v: ChainVector) -> Any:
    """Return |v|."""
    return sqrt(v.e * v.e + v.n * v.n + v.k * v.k)


def turnover(u_dot: Value, omega: ChainVector, width: Value) -> Turnover:
    """Return the turnover of friction in the joints of a chain, within `width` [rad/s]."""
    return Turnover(sign_over_speed(abs(u_dot), width),
                    sign_over_speed(length(relative_rate(u_dot, omega)), width))


class JointResistance(NamedTuple):
    """k_ri and k_si of one chain at one sample [N m s/rad]."""

    revolute: Value
    spherical: Value


def resist(c: Any, dry: Value, turnover: Any) -> Any:
    """Return k = c + M sgn(s)/s for dry friction M, from the turnover sgn(s)/s."""
    return c + dry * turnover                                                  # Eq. (2), (9)


def dry_moment(mu: Value, d: Value, load: Any) -> Any:
    """Return the dry friction moment of a joint of diameter d under a load [N m]."""
    return mu * d / 2.0 * load                                                 # Eq. (1)


def joint_resistances(
    joints: Joints, H: Any, V: Any, W: Any, V_star: Any, W_star: Any, turnover: Turnover,
) -> JointResistance:
    """Return k_ri and k_si of a chain under its reactions."""
    revolute = dry_moment(joints.mu_r, joints.d_r, sqrt(V_star * V_star + W_star * W_star))
    spherical = dry_moment(joints.mu_s, joints.d_s, sqrt(H * H + V * V + W * W))
    return JointResistance(resist(joints.c_r, joints.M_r + revolute, turnover.revolute),
                           resist(joints.c_s, joints.M_s + spherical, turnover.spherical))


@each_chain
def chain_resistances(
    i: int, geometry: GeometryParameters, rods: ThreeChains, k: Any, printed: Any,
) -> Wrench:
    """Return the wrench on the platform that overcomes the friction in the joints of chain i.

    What acts about u_i is brought there by the rod's row, which gives [J_u] with [J].

    Notes
    -----
    The corrected form is exact: k_si acts on u_dot_i n_i - omega of its own chain. The printed
    form gives the same total power and another share per drive.
    """
    c, chain = rods[i], geometry.chains[i]
    k_r, k_s = k[i]
    about_u = (k_r + k_s) * c.u_dot - (1.0 + printed) * k_s * c.omega.n        # Eq. (12)
    against = relative_rate((1.0 - printed) * c.u_dot, c.omega)
    about_platform = times(-k_s, in_base(chain, against))                      # Eq. (12)
    rod = rod_row(chain, geometry.l, c.arm, c.sin_u)
    return Wrench(times(about_u, rod.force), plus(times(about_u, rod.moment), about_platform))


def friction_forces(
    geometry: GeometryParameters, rods: ThreeChains, inverse: DriveValues, k: Any, printed: Any,
) -> DriveValues:
    """Return the drive forces that overcome resistances k_ri, k_si of the chains: [J]^T w."""
    a, b, c = chain_resistances(geometry, rods, k, printed)
    w = Wrench(plus(a.force, plus(b.force, c.force)), plus(a.moment, plus(b.moment, c.moment)))
    return DriveValues(_slide_forces(w, inverse),
                       _lift_forces(w, inverse, rods))


@each_chain
def _slide_forces(i: int, w: Wrench, inverse: DriveValues) -> Any:
    return power(w, inverse.slides[i])                                 # Eq. (11)


@each_chain
def _lift_forces(i: int, w: Wrench, inverse: DriveValues, rods: ThreeChains) -> Any:
    return rods[i].sin_u * power(w, inverse.lifts[i])                  # Eq. (11)
