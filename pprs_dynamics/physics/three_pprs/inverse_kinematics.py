# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Inverse kinematics: drives and rods from the platform's motion, Eq. (3) and its derivatives.

In chain i, with unit vectors e_i (radial), n_i (revolute axis) and k (up):
C_i = R e_i + q_i n_i + q_(i+3) k and A_i = C_i + l (-cos u_i e_i + sin u_i k).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array, Sample, Value
from pprs_dynamics.errors import SingularityError, WorkspaceError
from pprs_dynamics.physics.mechanism.arithmetic import sqrt
from pprs_dynamics.physics.mechanism.evaluation import evaluate
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.motion_sample import (
    MotionSample,
    Rotation,
    motion_sample,
    turned,
)
from pprs_dynamics.physics.mechanism.vectors import ChainVector, Vector, add, cross, in_chain
from pprs_dynamics.physics.three_pprs.chains import CHAINS, each_chain
from pprs_dynamics.physics.three_pprs.geometry import Geometry
from pprs_dynamics.physics.three_pprs.kernel_parameters import Chain, GeometryParameters

CHAIN_COLUMNS = 48


@dataclass(frozen=True)
class ChainKinematics:
    """Motion of every chain; all arrays (N, 3), chains last.

    Parameters
    ----------
    arm : ChainVector
        rho_i = A_i - P, from the platform's origin to the spherical joint [m].
    cos_u, sin_u : (N, 3) arrays
        Cosine and sine of the rod angle u_i.
    u_dot, u_ddot : (N, 3) arrays
        Rate and acceleration of u_i [rad/s, rad/s^2].
    position, velocity, acceleration : (N, 6) arrays
        Of the drives, in drive order [m, m/s, m/s^2].
    angular_velocity : ChainVector
        omega in every chain frame [rad/s].
    """

    arm: ChainVector
    cos_u: Array
    sin_u: Array
    u_dot: Array
    u_ddot: Array
    position: Array
    velocity: Array
    acceleration: Array
    angular_velocity: ChainVector

    @property
    def rod_normal(self) -> ChainVector:
        """Unit vectors w_i: minus the direction in which the rod's tip moves as u_i grows."""
        return rod_normal(self.cos_u, self.sin_u)

    @property
    def rod_angle(self) -> Array:
        """u_i [rad], (N, 3)."""
        return np.arctan2(self.sin_u, self.cos_u)

    @classmethod
    def from_table(cls, table: Array) -> ChainKinematics:
        """Return the chains of a table that a kernel has filled, (N, `CHAIN_COLUMNS`)."""
        e, n, k, c_u, s_u, u_dot, u_ddot = (
            np.ascontiguousarray(table[:, column:column + 3]) for column in range(0, 21, 3))
        q, q_dot, q_ddot = (
            np.ascontiguousarray(table[:, column:column + 6]) for column in (21, 27, 33))
        omega = ChainVector(*(
            np.ascontiguousarray(table[:, column:column + 3]) for column in (39, 42, 45)))
        return cls(ChainVector(e, n, k), c_u, s_u, u_dot, u_ddot, q, q_dot, q_ddot, omega)


class ChainSample(NamedTuple):
    """One chain at one sample, see `ChainKinematics`."""

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


def write_chain(i: int, table: Array, s: Sample, c: ChainSample) -> None:
    """Write chain i of sample s to a table, see `ChainKinematics.from_table`."""
    table[s, i], table[s, 3 + i], table[s, 6 + i] = c.arm.e, c.arm.n, c.arm.k
    table[s, 9 + i], table[s, 12 + i] = c.cos_u, c.sin_u
    table[s, 15 + i], table[s, 18 + i] = c.u_dot, c.u_ddot
    table[s, 21 + i], table[s, 24 + i] = c.slide, c.lift
    table[s, 27 + i], table[s, 30 + i] = c.slide_velocity, c.lift_velocity
    table[s, 33 + i], table[s, 36 + i] = c.slide_acceleration, c.lift_acceleration
    table[s, 39 + i], table[s, 42 + i], table[s, 45 + i] = c.omega.e, c.omega.n, c.omega.k


@each_chain
def read_chains(i: int, table: Array, s: Sample) -> ChainSample:
    """Return chain i of sample s of a table, see `ChainKinematics.from_table`."""
    return ChainSample(
        ChainVector(table[s, i], table[s, 3 + i], table[s, 6 + i]),
        table[s, 9 + i], table[s, 12 + i], table[s, 15 + i], table[s, 18 + i],
        table[s, 21 + i], table[s, 24 + i], table[s, 27 + i], table[s, 30 + i],
        table[s, 33 + i], table[s, 36 + i],
        ChainVector(table[s, 39 + i], table[s, 42 + i], table[s, 45 + i]))


def are_within_reach(rods: ThreeChains, minimum_sine: Any) -> Any:
    """Return whether all rods reach and none is too nearly horizontal; false for NaN."""
    within = abs(rods[0].sin_u) >= minimum_sine
    for i in range(1, CHAINS):
        within = within & (abs(rods[i].sin_u) >= minimum_sine)
    return within


class ReachParameters(NamedTuple):
    """Parameters of `chain_kernel`: the smallest |sin u_i| allowed."""

    geometry: GeometryParameters
    minimum_sine: Value


def chain_kernel(p: ReachParameters, s: Sample, motion: Array, chains: Array) -> Any:
    """Fill a table of chains from a table of motions."""
    rods = chain_motions(p.geometry, motion_sample(motion, s))
    for i in range(CHAINS):
        write_chain(i, chains, s, rods[i])
    return are_within_reach(rods, p.minimum_sine)


@dataclass(frozen=True)
class JointPositions:
    """Where the joints are, in `base`; each (N, 3, 3): samples, chains, components [m].

    `foot` is the slide on its guide at height 0, `elbow` C_i on the lift, `tip` A_i.
    """

    foot: Array
    elbow: Array
    tip: Array


def joint_positions(geometry: Geometry, motion: PlatformMotion) -> JointPositions:
    """Return the joints' positions at the poses of a motion, to draw the mechanism."""
    chains = solve_inverse_kinematics(geometry, motion)
    slide, lift = chains.position[:, :3], chains.position[:, 3:]
    R, zero = np.full_like(slide, geometry.base_radius), np.zeros_like(slide)
    base = geometry.frames.base
    return JointPositions(base(ChainVector(R, slide, zero)), base(ChainVector(R, slide, lift)),
                          motion.position[:, None, :] + base(chains.arm))


def solve_inverse_kinematics(
    geometry: Geometry, motion: PlatformMotion, minimum_sine: float = 1e-6,
) -> ChainKinematics:
    """Return the motion of drives and rods that belongs to a platform motion, Eq. (3) and (4).

    Parameters
    ----------
    geometry : Geometry
    motion : PlatformMotion
    minimum_sine : float
        Smallest allowed abs(sin u_i); rates grow without bound towards 0.

    Raises
    ------
    WorkspaceError
        Where a rod is too short to reach: abs(R - A_i . e_i) > l.
    SingularityError
        Where abs(sin u_i) < `minimum_sine`: the rod lies (almost) horizontally.
    """
    return ChainKinematics.from_table(chain_table(geometry, motion, minimum_sine))


def chain_table(geometry: Geometry, motion: PlatformMotion, minimum_sine: float) -> Array:
    """Return the motion of the chains as a table for kernels, see `solve_inverse_kinematics`."""
    table = np.empty((len(motion), CHAIN_COLUMNS))
    parameters = geometry.kernel_parameters.extended(ReachParameters, minimum_sine)
    if evaluate(chain_kernel, parameters, motion.rows, table) >= 0:
        _require_reach(table[:, 9:12], geometry)
        _require_upright_rods(table[:, 12:15], minimum_sine)
    return table


def _require_reach(cos_u: Array, geometry: Geometry) -> None:
    beyond = ~(np.abs(cos_u) <= 1.0)
    if np.any(beyond):
        sample, chain = (int(i) for i in np.argwhere(beyond)[0])
        raise WorkspaceError(
            sample, f'the rod of chain {chain + 1} would have to span '
            f'{abs(cos_u[sample, chain]) * geometry.rod_length:.6g} m radially',
            f'its length is geometry.rod_length = {geometry.rod_length:g} m')


def _require_upright_rods(sin_u: Array, minimum: float) -> None:
    flat = np.abs(sin_u) < minimum
    if np.any(flat):
        sample, chain = (int(i) for i in np.argwhere(flat)[0])
        raise SingularityError(
            sample, f'|sin u| of chain {chain + 1} is {abs(sin_u[sample, chain]):.3g} '
            '(its rod lies horizontally)', f'it must be at least {minimum:g} (limits.rod_sine)')
