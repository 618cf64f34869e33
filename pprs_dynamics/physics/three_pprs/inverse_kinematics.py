# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Inverse kinematics: drives and rods from the platform's motion, Eq. (3) and its derivatives.

In chain i, with unit vectors e_i (radial), n_i (revolute axis) and k (up):
C_i = R e_i + q_i n_i + q_(i+3) k and A_i = C_i + l (-cos u_i e_i + sin u_i k).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.motion_sample import MotionSample, Rotation, turned
from pprs_dynamics.physics.mechanism.vectors import ChainVector, Vector, add, cross, in_chain, sqrt
from pprs_dynamics.physics.three_pprs.kernel_parameters import Chain, GeometryParameters, each_chain


class ChainSample(NamedTuple):
    """One chain at one sample.

    `arm` is rho_i = A_i - P, from the platform's origin to the spherical joint [m]; `omega` the
    platform's angular velocity in the chain's frame [rad/s]; slide and lift are drives.
    """

    arm: ChainVector
    cos_u: Value
    sin_u: Value
    u_dot: Value
    u_ddot: Value
    slide: Value
    lift: Value
    slide_velocity: Value
    lift_velocity: Value
    slide_acceleration: Value
    lift_acceleration: Value
    omega: ChainVector


ThreeChains = tuple[ChainSample, ChainSample, ChainSample]


def rod_direction(c_u: Value, s_u: Value) -> ChainVector:
    """Return d_i, the unit vector along the rod from C_i to A_i."""
    return ChainVector(-c_u, 0.0 * c_u, s_u)


def rod_normal(c_u: Value, s_u: Value) -> ChainVector:
    """Return w_i, minus the direction in which the rod's tip moves as u_i grows."""
    return ChainVector(-s_u, 0.0 * c_u, -c_u)


def chain_arm(chain: Chain, R: Rotation) -> ChainVector:
    """Return rho_i = Rot r e'_i: the spherical joints lie in the platform's plane."""
    return in_chain(chain, turned(R, Vector(chain.x, chain.y, 0.0)))


@each_chain
def chain_motions(i: int, geometry: GeometryParameters, motion: MotionSample) -> ChainSample:
    """Return the motion of chain i that belongs to the platform's, Eq. (3) and (4)."""
    R, l, chain = geometry.R, geometry.l, geometry.chains[i]  # noqa: E741
    rho = chain_arm(chain, motion.rotation)
    omega = in_chain(chain, motion.omega)
    epsilon = in_chain(chain, motion.epsilon)
    A = add(in_chain(chain, motion.position), rho)

    cos_u = (R - A.e) / l
    sin_u = geometry.elbow * sqrt(1.0 - cos_u * cos_u)
    q_slide = A.n                                                              # Eq. (3)
    q_lift = A.k - l * sin_u                                                   # Eq. (3)

    spin = cross(omega, rho)
    v_A = add(in_chain(chain, motion.v), spin)
    u_dot = v_A.e / (l * sin_u)
    q_slide_dot = v_A.n                                                        # Eq. (4)
    q_lift_dot = v_A.k - l * cos_u * u_dot                                     # Eq. (4)

    a_A = add(in_chain(chain, motion.a), add(cross(epsilon, rho), cross(omega, spin)))
    u_ddot = (a_A.e / l - cos_u * u_dot * u_dot) / sin_u
    q_slide_ddot = a_A.n
    q_lift_ddot = a_A.k - l * (cos_u * u_ddot - sin_u * u_dot * u_dot)
    return ChainSample(rho, cos_u, sin_u, u_dot, u_ddot, q_slide, q_lift, q_slide_dot,
                       q_lift_dot, q_slide_ddot, q_lift_ddot, omega)


def are_within_reach(rods: ThreeChains, minimum_sine: Any) -> Any:
    """Return whether all rods reach and none is too nearly horizontal; false for NaN."""
    return (abs(rods[0].sin_u) >= minimum_sine and abs(rods[1].sin_u) >= minimum_sine
            and abs(rods[2].sin_u) >= minimum_sine)
