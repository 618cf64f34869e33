"""Inverse dynamics without friction, in the paper's four steps: Eq. (5) to (8).

Gravity enters as the acceleration that each body would need to feel weightless, f = a - g, so
that any direction of gravity is exact; with g = (0, 0, -9.81) the paper's formulas remain.
A positive drive force is what the drive must apply along its positive coordinate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pprs_dynamics.mechanism.inverse_kinematics import ChainKinematics
from pprs_dynamics.mechanism.jacobians import Jacobians, wrench_rows
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.robot import Array, ChainVector, Robot, cross_rows


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
    reactions : Reactions
    guide_load : (N, 6) array
        Normal force on the guide of every drive [N], the root in Eq. (15) and (16).
    """

    force: Array
    reactions: Reactions
    guide_load: Array


def platform_wrench(robot: Robot, motion: PlatformMotion) -> Array:
    """Return the wrench about o that moves platform and payload, (N, 6) in `base` [N, N m].

    Left side of Eq. (6) minus weight, with the centre of mass anywhere: with d its vector from
    o, force (M + m)(a_o + eps x d + omega x (omega x d) - g) and moment
    [I]eps + omega x [I]omega + d x force.
    """
    masses, rotation = robot.masses, motion.rotation
    omega, epsilon = motion.angular_velocity, motion.angular_acceleration
    d = rotation @ np.asarray(masses.centre)
    inertia = rotation @ masses.inertia_tensor @ np.swapaxes(rotation, 1, 2)
    a_centre = (motion.linear_acceleration + cross_rows(epsilon, d)
                + cross_rows(omega, cross_rows(omega, d)))
    force = masses.total * (a_centre - np.asarray(robot.gravity))              # Eq. (6)
    I_epsilon = (inertia @ epsilon[..., None])[..., 0]
    I_omega = (inertia @ omega[..., None])[..., 0]
    moment = I_epsilon + cross_rows(omega, I_omega) + cross_rows(d, force)         # Eq. (6)
    return np.concatenate((force, moment), axis=1)


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
    frames, l = robot.geometry.frames, robot.geometry.rod_length
    m_slide, m_lift = np.asarray(robot.masses.slides), np.asarray(robot.masses.lifts)
    m_b = np.asarray(robot.masses.rods)
    c_u, s_u, u_dot, u_ddot = chains.cos_u, chains.sin_u, chains.u_dot, chains.u_ddot
    g = frames.components(np.asarray(robot.gravity)[None, :])
    f = ChainVector(-g.e, chains.acceleration[:, :3] - g.n, chains.acceleration[:, 3:] - g.k)

    # Step 1: the rod about C_i.
    W = m_b * (c_u * f.k + s_u * f.e) / 2 + m_b * l * u_ddot / 3               # Eq. (5)
    wrench = platform_wrench(robot, motion)
    if load is not None:
        W, wrench = W + load.hinge / l, wrench + load.wrench

    # Step 2: the platform. Rows of [B] are the wrenches of unit H_i and V_i.
    pushed = np.einsum('ni,nij->nj', W, wrench_rows(frames, chains.rod_normal, chains.arm))
    remaining = wrench - pushed
    HV = np.einsum('nij,ni->nj', jacobians.B_inverse, remaining)               # Eq. (6)
    H, V = HV[:, :3], HV[:, 3:]

    # Acceleration of the rod's middle relative to C_i.
    rise = l * (u_ddot * c_u - u_dot * u_dot * s_u) / 2
    lean = l * (u_ddot * s_u + u_dot * u_dot * c_u) / 2
    H_star = H + m_b * f.n                                                     # Eq. (9)
    V_star = V * s_u - W * c_u + m_b * rise + m_b * f.k                        # Eq. (9)
    W_star = V * c_u + W * s_u - m_b * lean - m_b * f.e                        # Eq. (9)

    # Steps 3 and 4: the chain down to the lift, then down to the slide.
    printed_rise = rise / l if printed else rise
    Q_lift = (m_lift + m_b) * f.k + m_b * printed_rise + V * s_u - W * c_u     # Eq. (7)
    Q_slide = (m_slide + m_lift + m_b) * f.n + H                               # Eq. (8)

    radial = W_star - m_lift * f.e
    vertical = V_star + m_lift * f.k - m_slide * g.k
    slide_load = np.sqrt((radial - m_slide * f.e) ** 2 + vertical ** 2)        # Eq. (15)
    lift_load = np.sqrt((H_star + m_lift * f.n) ** 2 + radial ** 2)            # Eq. (16)
    return RigidBody(
        np.concatenate((Q_slide, Q_lift), axis=1),
        Reactions(H, V, W, H_star, V_star, W_star),
        np.concatenate((slide_load, lift_load), axis=1))
