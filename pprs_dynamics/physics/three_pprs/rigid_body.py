# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Inverse dynamics without friction, in the paper's four steps: Eq. (5) to (8).

Gravity enters as the acceleration that each body would need to feel weightless, f = a - g, so
that any direction of gravity is exact; with g = (0, 0, -9.81) the paper's formulas remain.
A positive drive force is what the drive must apply along its positive coordinate.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.motion_sample import MotionSample, turned, turned_back
from pprs_dynamics.physics.mechanism.vectors import (
    ChainVector,
    Vector,
    in_chain,
    minus,
    plus,
    product,
    sqrt,
    times,
)
from pprs_dynamics.physics.three_pprs.closure import DriveValues, Wrench, power, unit_wrench
from pprs_dynamics.physics.three_pprs.inverse_kinematics import ChainSample, ThreeChains, rod_normal
from pprs_dynamics.physics.three_pprs.kernel_parameters import (
    CHAINS,
    ChainMasses,
    PlatformBody,
    RobotParameters,
    each_chain,
)


class ChainForces(NamedTuple):
    """Forces in one chain at one sample.

    Reactions of the spherical joint on the platform: H along n_i, V along the rod from C_i to A_i,
    W along w_i. The starred ones are the same force one joint further down, in C_i: H_star along
    n_i, V_star vertical, W_star radial (Eq. 9). Then the drives' forces and their guides' loads.
    """

    H: Value
    V: Value
    W: Value
    H_star: Value
    V_star: Value
    W_star: Value
    slide: Value
    lift: Value
    slide_load: Value
    lift_load: Value


def platform_wrench(body: PlatformBody, g: Vector, m: MotionSample) -> Wrench:
    """Return the wrench about o that moves platform and payload, in `base` [N, N m].

    Left side of Eq. (6) minus weight, with the centre of mass anywhere. With d its vector from o:

        force = (M + m)(a_o + eps x d + omega x (omega x d) - g)
        moment = [I]eps + omega x [I]omega + d x force
    """
    d = turned(m.rotation, body.centre)
    a_centre = plus(m.a, plus(product(m.epsilon, d), product(m.omega, product(m.omega, d))))
    force = times(body.mass, minus(a_centre, g))                              # Eq. (6)
    # In `platform`, where [I] is constant.
    omega, epsilon = turned_back(m.rotation, m.omega), turned_back(m.rotation, m.epsilon)
    spin = plus(_momentum(body, epsilon), product(omega, _momentum(body, omega)))
    moment = plus(turned(m.rotation, spin), product(d, force))                 # Eq. (6)
    return Wrench(force, moment)


def _momentum(body: PlatformBody, omega: Vector) -> Vector:
    xx, yy, zz = body.moments
    xy, xz, yz = body.products
    return Vector(xx * omega.x + xy * omega.y + xz * omega.z,
                  xy * omega.x + yy * omega.y + yz * omega.z,
                  xz * omega.x + yz * omega.y + zz * omega.z)


@each_chain
def specific_forces(i: int, p: RobotParameters, rods: ThreeChains) -> ChainVector:
    """Return f = a - g in C_i, where the lift is."""
    g = in_chain(p.geometry.chains[i], p.gravity)
    return ChainVector(-g.e, rods[i].slide_acceleration - g.n, rods[i].lift_acceleration - g.k)


@each_chain
def rod_reactions(
    i: int, p: RobotParameters, rods: ThreeChains, specific: Any, hinges: Any,
) -> Any:
    """Return W_i, from the moments about C_i of the rod and of the hinge."""
    m_b, l, c, f = p.masses[i].rod, p.geometry.l, rods[i], specific[i]  # noqa: E741
    W = m_b * (c.cos_u * f.k + c.sin_u * f.e) / 2.0 + m_b * l * c.u_ddot / 3.0     # Eq. (5)
    return W + hinges[i] / l


def less_rod_reactions(
    wrench: Wrench, p: RobotParameters, rods: ThreeChains, W: Any,
) -> Wrench:
    """Return a wrench on the platform less those of the rods' reactions W_i."""
    force, moment = wrench
    for i in range(CHAINS):
        unit = unit_wrench(p.geometry.chains[i], rod_normal(rods[i].cos_u, rods[i].sin_u),
                           rods[i].arm)
        force = minus(force, times(W[i], unit.force))
        moment = minus(moment, times(W[i], unit.moment))
    return Wrench(force, moment)


def chain_forces(
    mass: ChainMasses, rod_length: Value, g: ChainVector, c: ChainSample, f: ChainVector, H: Any,
    V: Any, W: Any, printed: Any,
) -> ChainForces:
    """Return reactions, drive forces and guide loads of a chain."""
    m_slide, m_lift, m_b = mass
    l, c_u, s_u = rod_length, c.cos_u, c.sin_u  # noqa: E741
    # Acceleration of the rod's middle relative to C_i.
    rise = l * (c.u_ddot * c_u - c.u_dot * c.u_dot * s_u) / 2.0
    lean = l * (c.u_ddot * s_u + c.u_dot * c.u_dot * c_u) / 2.0
    H_star = H + m_b * f.n                                                     # Eq. (9)
    V_star = V * s_u - W * c_u + m_b * rise + m_b * f.k                        # Eq. (9)
    W_star = V * c_u + W * s_u - m_b * lean - m_b * f.e                        # Eq. (9)

    # Steps 3 and 4: the chain down to the lift, then down to the slide. Printed, the rod's
    # term in Eq. (7) lacks the factor l.
    printed_rise = rise * (1.0 + printed * (1.0 / l - 1.0))
    Q_lift = (m_lift + m_b) * f.k + m_b * printed_rise + V * s_u - W * c_u     # Eq. (7)
    Q_slide = (m_slide + m_lift + m_b) * f.n + H                               # Eq. (8)

    radial = W_star - m_lift * f.e
    vertical = V_star + m_lift * f.k - m_slide * g.k
    across, along = radial - m_slide * f.e, H_star + m_lift * f.n
    slide_load = sqrt(across * across + vertical * vertical)                   # Eq. (15)
    lift_load = sqrt(along * along + radial * radial)                          # Eq. (16)
    return ChainForces(H, V, W, H_star, V_star, W_star, Q_slide, Q_lift, slide_load, lift_load)


ThreeForces = tuple[ChainForces, ChainForces, ChainForces]


def body_forces(
    p: RobotParameters, m: MotionSample, rods: ThreeChains, inverse: DriveValues, load: Wrench,
    hinges: Any, printed: Any,
) -> ThreeForces:
    """Return frictionless forces in the chains: the paper's four steps."""
    specific = specific_forces(p, rods)

    # Step 1: the rods about C_i.
    W = rod_reactions(p, rods, specific, hinges)

    # Step 2: the platform. Columns of [B]^-1 tell which reaction answers to which wrench.
    bodies = platform_wrench(p.platform, p.gravity, m)
    wrench = Wrench(plus(bodies.force, load.force), plus(bodies.moment, load.moment))
    left = less_rod_reactions(wrench, p, rods, W)
    return _forces_of_chains(p, rods, specific, W, left, inverse, printed)


@each_chain
def _forces_of_chains(
    i: int, p: RobotParameters, rods: ThreeChains, specific: Any, W: Any, left: Wrench,
    inverse: DriveValues, printed: Any,
) -> ChainForces:
    H, V = power(left, inverse.slides[i]), power(left, inverse.lifts[i])  # Eq. (6)
    return chain_forces(p.masses[i], p.geometry.l, in_chain(p.geometry.chains[i], p.gravity),
                        rods[i], specific[i], H, V, W[i], printed)
