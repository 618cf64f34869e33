"""Inverse dynamics without friction, in the paper's four steps: Eq. (5) to (8).

Gravity enters as the acceleration that each body would need to feel weightless, f = a - g, so
that any direction of gravity is exact; with g = (0, 0, -9.81) the paper's formulas remain.
A positive drive force is what the drive must apply along its positive coordinate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.mechanism.arithmetic import sqrt
from pprs_dynamics.mechanism.closure import Inverse, Wrench, power, read_inverse, unit_wrench
from pprs_dynamics.mechanism.evaluation import evaluate
from pprs_dynamics.mechanism.inverse_kinematics import (
    ChainKinematics,
    ChainSample,
    read_chain,
    rod_normal,
)
from pprs_dynamics.mechanism.jacobians import Jacobians
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.numbers import (
    ROBOT_NUMBERS,
    Carriages,
    Chain,
    Platform,
    carriages,
    chain,
    gravity,
    platform,
)
from pprs_dynamics.mechanism.robot import Robot
from pprs_dynamics.mechanism.sample import (
    MotionSample,
    motion_sample,
    turned,
    turned_back,
    vector,
)
from pprs_dynamics.mechanism.vectors import ChainVector, Vector, in_chain, plus, product, times


class StructureLoad(NamedTuple):
    """What the drives must overcome beside bodies and gravity.

    Parameters
    ----------
    wrench : (N, 6) array
        Force [N] and moment about o [N m] on the platform, in `base`.
    hinge : (N, 3) array
        Moment about n_i that resists growing u_i in C_i [N m].
    """

    wrench: Array
    hinge: Array

    def __add__(self, other: StructureLoad) -> StructureLoad:  # type: ignore[override]
        return StructureLoad(self.wrench + other.wrench, self.hinge + other.hinge)


class Reactions(NamedTuple):
    """Reactions of the spherical joints on the platform, and loads of the joints below.

    All (N, 3) [N], chains last. H along n_i, V along the rod from C_i to A_i, W along w_i.
    The starred ones are the same force one joint further down, in C_i: H_star along n_i,
    V_star vertical, W_star radial (Eq. 9).
    """

    H: Array
    V: Array
    W: Array
    H_star: Array
    V_star: Array
    W_star: Array


@dataclass(frozen=True)
class RigidBody:
    """Frictionless drive forces and reactions.

    Parameters
    ----------
    force : (N, 6) array
        Q_i [N] in drive order.
    guide_load : (N, 6) array
        Normal force on the guide of every drive [N], the root in Eq. (15) and (16).
    reaction_table : (N, 18) array
        `reactions` as kernels take them.
    """

    force: Array
    guide_load: Array
    reaction_table: Array

    @cached_property
    def reactions(self) -> Reactions:
        """Reactions of the spherical joints, and loads of the joints below."""
        return Reactions(*(np.ascontiguousarray(self.reaction_table[:, column:column + 3])
                           for column in range(0, 18, 3)))


class ChainForces(NamedTuple):
    """Forces in one chain at one sample, see `Reactions` and `RigidBody`."""

    H: Any
    V: Any
    W: Any
    H_star: Any
    V_star: Any
    W_star: Any
    slide: Any
    lift: Any
    slide_load: Any
    lift_load: Any


def platform_wrench(body: Platform, g: Vector, m: MotionSample) -> Wrench:
    """Return the wrench about o that moves platform and payload, in `base` [N, N m].

    Left side of Eq. (6) minus weight, with the centre of mass anywhere: with d its vector from
    o, force (M + m)(a_o + eps x d + omega x (omega x d) - g) and moment
    [I]eps + omega x [I]omega + d x force.
    """
    d = turned(m.rotation, body.centre)
    a_centre = plus(m.a, plus(product(m.epsilon, d), product(m.omega, product(m.omega, d))))
    force = times(body.mass, _minus(a_centre, g))                              # Eq. (6)
    # In `platform`, where [I] is constant.
    omega, epsilon = turned_back(m.rotation, m.omega), turned_back(m.rotation, m.epsilon)
    spin = plus(_momentum(body, epsilon), product(omega, _momentum(body, omega)))
    moment = plus(turned(m.rotation, spin), product(d, force))                 # Eq. (6)
    return Wrench(force, moment)


def _momentum(body: Platform, omega: Vector) -> Vector:
    xx, yy, zz = body.moments
    xy, xz, yz = body.products
    return Vector(xx * omega.x + xy * omega.y + xz * omega.z,
                  xy * omega.x + yy * omega.y + yz * omega.z,
                  xz * omega.x + yz * omega.y + zz * omega.z)


def _minus(a: Vector, b: Vector) -> Vector:
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


def felt(c: ChainSample, g: ChainVector) -> ChainVector:
    """Return f = a - g in C_i, where the lift is."""
    return ChainVector(-g.e, c.slide_acceleration - g.n, c.lift_acceleration - g.k)


def rod_reaction(m_b: Any, l: Any, c: ChainSample, f: ChainVector, hinge: Any) -> Any:
    """Return W_i, from the moments about C_i of the rod and of the hinge."""
    W = m_b * (c.cos_u * f.k + c.sin_u * f.e) / 2.0 + m_b * l * c.u_ddot / 3.0     # Eq. (5)
    return W + hinge / l


def pushed(k: Chain, c: ChainSample, W: Any) -> Wrench:
    """Return what W_i does to the platform."""
    unit = unit_wrench(k, rod_normal(c.cos_u, c.sin_u), c.arm)
    return Wrench(times(W, unit.force), times(W, unit.moment))


def remaining(wrench: Wrench, a: Wrench, b: Wrench, c: Wrench) -> Wrench:
    """Return a wrench less three others."""
    return Wrench(_minus(wrench.force, plus(a.force, plus(b.force, c.force))),
                  _minus(wrench.moment, plus(a.moment, plus(b.moment, c.moment))))


def chain_forces(
    mass: Carriages, l: Any, g: ChainVector, c: ChainSample, f: ChainVector, H: Any, V: Any,
    W: Any, printed: Any,
) -> ChainForces:
    """Return reactions, drive forces and guide loads of a chain."""
    m_slide, m_lift, m_b = mass
    c_u, s_u = c.cos_u, c.sin_u
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


class Bodies(NamedTuple):
    """Forces in all chains at one sample."""

    one: ChainForces
    two: ChainForces
    three: ChainForces


def body_forces(
    p: Any, m: MotionSample, one: ChainSample, two: ChainSample, three: ChainSample,
    inverse: Inverse, load: Wrench, hinges: Vector, printed: Any,
) -> Bodies:
    """Return frictionless forces: the paper's four steps; p is the robot's row of numbers."""
    l, g = p[1], gravity(p)
    k1, k2, k3 = chain(p, 0), chain(p, 1), chain(p, 2)
    mass_1, mass_2, mass_3 = carriages(p, 0), carriages(p, 1), carriages(p, 2)
    g1, g2, g3 = in_chain(k1, g), in_chain(k2, g), in_chain(k3, g)
    f1, f2, f3 = felt(one, g1), felt(two, g2), felt(three, g3)

    # Step 1: the rods about C_i.
    W1 = rod_reaction(mass_1.rod, l, one, f1, hinges.x)
    W2 = rod_reaction(mass_2.rod, l, two, f2, hinges.y)
    W3 = rod_reaction(mass_3.rod, l, three, f3, hinges.z)

    # Step 2: the platform. Columns of [B]^-1 tell which reaction answers to which wrench.
    bodies = platform_wrench(platform(p), g, m)
    wrench = Wrench(plus(bodies.force, load.force), plus(bodies.moment, load.moment))
    left = remaining(wrench, pushed(k1, one, W1), pushed(k2, two, W2), pushed(k3, three, W3))
    H1, V1 = power(left, inverse.slide_1), power(left, inverse.lift_1)         # Eq. (6)
    H2, V2 = power(left, inverse.slide_2), power(left, inverse.lift_2)         # Eq. (6)
    H3, V3 = power(left, inverse.slide_3), power(left, inverse.lift_3)         # Eq. (6)
    return Bodies(chain_forces(mass_1, l, g1, one, f1, H1, V1, W1, printed),
                  chain_forces(mass_2, l, g2, two, f2, H2, V2, W2, printed),
                  chain_forces(mass_3, l, g3, three, f3, H3, V3, W3, printed))


def body_kernel(
    p: Any, s: Any, motion: Any, chains: Any, inverse: Any, load: Any, force: Any,
    guide_load: Any, reactions: Any,
) -> Any:
    """Fill tables of forces, guide loads and reactions; p is the robot, then `printed`.

    A load has nine columns, the platform's wrench and the moments in the hinges.
    """
    bodies = body_forces(
        p, motion_sample(motion, s), read_chain(chains, s, 0), read_chain(chains, s, 1),
        read_chain(chains, s, 2), read_inverse(inverse, s),
        Wrench(vector(load, s, 0), vector(load, s, 3)), vector(load, s, 6), p[ROBOT_NUMBERS])
    write_forces(force, guide_load, reactions, s, 0, bodies.one)
    write_forces(force, guide_load, reactions, s, 1, bodies.two)
    write_forces(force, guide_load, reactions, s, 2, bodies.three)
    return True


def write_forces(
    force: Any, guide_load: Any, reactions: Any, s: Any, i: int, forces: ChainForces,
) -> None:
    """Write the forces in chain i at sample s."""
    force[s, i], force[s, 3 + i] = forces.slide, forces.lift
    guide_load[s, i], guide_load[s, 3 + i] = forces.slide_load, forces.lift_load
    reactions[s, i], reactions[s, 3 + i], reactions[s, 6 + i] = forces.H, forces.V, forces.W
    reactions[s, 9 + i], reactions[s, 12 + i] = forces.H_star, forces.V_star
    reactions[s, 15 + i] = forces.W_star


def solve_inverse_dynamics(
    robot: Robot, motion: PlatformMotion, chains: ChainKinematics, jacobians: Jacobians,
    *, printed: bool = False, load: StructureLoad | None = None,
) -> RigidBody:
    """Return frictionless drive forces, reactions and guide loads.

    Parameters
    ----------
    robot : Robot
    motion : PlatformMotion
    chains : ChainKinematics
    jacobians : Jacobians
    printed : bool
        Take Eq. (7) to the letter, which lacks the factor l in its rod term.
    load : StructureLoad, optional
        Loads beside bodies and gravity.
    """
    return solve_bodies(robot, motion, chains.table(), jacobians.B_inverse.reshape(-1, 36),
                        printed, load)


def solve_bodies(
    robot: Robot, motion: PlatformMotion, chains: Array, inverse: Array, printed: bool,
    load: StructureLoad | None,
) -> RigidBody:
    """Return the same from tables of chains and of [B]^-1."""
    samples = len(motion)
    force, guide_load = np.empty((samples, 6)), np.empty((samples, 6))
    reactions = np.empty((samples, 18))
    loads = (np.zeros((samples, 9)) if load is None
             else np.concatenate((load.wrench, load.hinge), axis=1))
    evaluate(body_kernel, np.append(robot.numbers, float(printed)), motion.rows, chains,
             np.ascontiguousarray(inverse), loads, force, guide_load, reactions)
    return RigidBody(force, guide_load, reactions)
