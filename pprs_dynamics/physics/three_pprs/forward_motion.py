# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forward motion: the platform's pose, twist and acceleration from the motion of the drives.

Positions by forward kinematics. Rates from Eq. (4), A q_dot = B X_dot, and from its derivative

    B X_ddot = A q_ddot + (d/dt A) q_dot - (d/dt B) X_dot,

of which the last two terms have a closed form. The centripetal acceleration of A_i about o is
c_i = omega x (omega x rho_i). A_i stays in its chain's plane: the terms of the slides are
-n_i . c_i. It stays at the distance l from C_i: those of the lifts are -(d_i . c_i + l u_dot_i^2).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array, Sample
from pprs_dynamics.errors import ConvergenceError
from pprs_dynamics.physics.mechanism.evaluation import evaluate
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.vectors import add, cross, in_chain
from pprs_dynamics.physics.three_pprs.chains import each_chain
from pprs_dynamics.physics.three_pprs.closure import (
    DriveValues,
    Twist,
    platform_twist,
    read_inverse,
)
from pprs_dynamics.physics.three_pprs.forward_kinematics import solve_forward_kinematics
from pprs_dynamics.physics.three_pprs.geometry import Geometry
from pprs_dynamics.physics.three_pprs.inverse_kinematics import (
    ThreeChains,
    chain_table,
    read_chains,
)
from pprs_dynamics.physics.three_pprs.jacobians import inverse_table
from pprs_dynamics.physics.three_pprs.kernel_parameters import GeometryParameters

# Marks that seed the samples between them are at most this much travel of any drive apart [m]:
# Newton-Raphson then converges in one or two steps, far from any other solution.
LONGEST_MOVE = 0.005
LEAST_SINE = 1e-6  # of a rod, below which its drive tells nothing
# Two solutions from different seeds agree to rounding; other solutions lie centimetres away.
SAME_POSE = 1e-6


def solve_forward_motion(
    geometry: Geometry, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike,
    seed: PlatformMotion | None = None,
) -> PlatformMotion:
    """Return the platform's motion that belongs to a continuous motion of the drives.

    Parameters
    ----------
    geometry : Geometry
    position, velocity, acceleration : (N, 6) array_like
        q [m], q_dot [m/s], q_ddot [m/s^2] in drive order; consecutive samples of one motion,
        which the solution follows.
    seed : PlatformMotion, optional
        A pose near the first sample; the home pose by default.

    Raises
    ------
    MotionError, ConvergenceError
        See `solve_forward_kinematics`.
    SingularityError
        Where det [B] = 0 or a rod lies horizontally.
    """
    q = np.asarray(position, dtype=float)
    found = solve_forward_kinematics(
        geometry, q, follow_branch(geometry, q, seed) if len(q) > 1 else seed)
    poses = PlatformMotion.at_rest(found.position, found.orientation)
    return platform_rates(geometry, poses, velocity, acceleration)


def follow_branch(
    geometry: Geometry, position: Array, seed: PlatformMotion | None = None,
) -> PlatformMotion:
    """Return poses near those that belong to drive positions (N, 6), seeds for Newton-Raphson.

    Marks along the way, at most `LONGEST_MOVE` of any drive apart, are solved each from the one
    before; between them poses are interpolated.
    """
    marks = _marks(position)
    solved = _follow_marks(geometry, position[marks], marks, seed)
    samples = np.arange(len(position))
    if len(marks) == 1:
        return solved[np.zeros(len(position), dtype=int)]
    # Of the two quaternions of each orientation those that are near each other.
    opposite = np.sum(solved.orientation[1:] * solved.orientation[:-1], axis=1) < 0
    signs = np.cumprod(np.where(np.append(False, opposite), -1.0, 1.0))
    between, turn = (
        np.stack([np.interp(samples, marks, axis) for axis in values.T], axis=1)
        for values in (solved.position, solved.orientation * signs[:, None]))
    return PlatformMotion.at_rest(between, turn / np.linalg.norm(turn, axis=1, keepdims=True))


def platform_rates(
    geometry: Geometry, poses: PlatformMotion, velocity: ArrayLike, acceleration: ArrayLike,
) -> PlatformMotion:
    """Return poses with the twist and acceleration that the drives' rates give them.

    Parameters
    ----------
    geometry : Geometry
    poses : PlatformMotion
        N poses; their own twists are not looked at.
    velocity, acceleration : (N, 6) array_like
        q_dot [m/s], q_ddot [m/s^2] in drive order.
    """
    still = PlatformMotion.at_rest(poses.position, poses.orientation)
    chains = chain_table(geometry, still, LEAST_SINE)
    rates = np.empty((len(poses), 12))
    evaluate(rates_kernel, geometry.kernel_parameters, chains,
             inverse_table(geometry, chains, np.inf), _table(velocity), _table(acceleration),
             rates)
    return PlatformMotion(poses.position, poses.orientation, rates[:, 0:3], rates[:, 3:6],
                          rates[:, 6:9], rates[:, 9:12], poses.time)


def _table(values: ArrayLike) -> Array:
    return np.ascontiguousarray(values, dtype=float)


def rates_kernel(
    p: GeometryParameters, s: Sample, chains: Array, inverse: Array, q_dot: Array, q_ddot: Array,
    rates: Array,
) -> Any:
    """Fill a table of v, omega, a_o and epsilon from drives' rates."""
    rods = read_chains(chains, s)
    B_inverse = read_inverse(inverse, s)
    X_dot = platform_twist(B_inverse, DriveValues(
        _slide_rates(q_dot, s), _lift_rates(q_dot, s, rods)))  # Eq. (4)
    inward = centripetal_terms(p, rods, X_dot)
    X_ddot = platform_twist(B_inverse, DriveValues(
        _slide_accelerations(q_ddot, s, inward), _lift_accelerations(q_ddot, s, rods, inward)))
    rates[s, 0], rates[s, 1], rates[s, 2] = X_dot.v
    rates[s, 3], rates[s, 4], rates[s, 5] = X_dot.omega
    rates[s, 6], rates[s, 7], rates[s, 8] = X_ddot.v
    rates[s, 9], rates[s, 10], rates[s, 11] = X_ddot.omega
    return True


@each_chain
def _slide_rates(i: int, rates: Any, s: Sample) -> Any:
    return rates[s, i]


@each_chain
def _lift_rates(i: int, rates: Any, s: Sample, rods: ThreeChains) -> Any:
    return rods[i].sin_u * rates[s, 3 + i]


@each_chain
def _slide_accelerations(i: int, q_ddot: Any, s: Sample, inward: Any) -> Any:
    return q_ddot[s, i] - inward[i][0]


@each_chain
def _lift_accelerations(i: int, q_ddot: Any, s: Sample, rods: ThreeChains, inward: Any) -> Any:
    return rods[i].sin_u * q_ddot[s, 3 + i] - inward[i][1]


@each_chain
def centripetal_terms(
    i: int, geometry: GeometryParameters, rods: ThreeChains, X_dot: Twist,
) -> tuple[Any, Any]:
    """Return n_i . c_i, and d_i . c_i + l u_dot_i^2."""
    k, l, c = geometry.chains[i], geometry.l, rods[i]  # noqa: E741
    omega = in_chain(k, X_dot.omega)
    spin = cross(omega, c.arm)
    inward = cross(omega, spin)
    u_dot = add(in_chain(k, X_dot.v), spin).e / (l * c.sin_u)
    return inward.n, c.sin_u * inward.k - c.cos_u * inward.e + l * u_dot * u_dot


def _marks(position: Array) -> np.ndarray:
    """Return the first sample, the last, and those `LONGEST_MOVE` of travel apart between."""
    travel = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(position, axis=0)).max(axis=1))))
    # Counted by sample: a position that none can be, 10^9 m, has no list of steps in memory.
    first = np.flatnonzero(np.diff(np.floor(travel / LONGEST_MOVE))) + 1
    return np.unique([0, *first, len(position) - 1])


def _follow_marks(
    geometry: Geometry, q: Array, samples: np.ndarray, seed: PlatformMotion | None,
) -> PlatformMotion:
    """Return the poses of marks, each on the branch of the one before.

    One after another would take a millisecond each. Instead all are solved at once from the
    seed, then all again from their predecessors: where both agree, following them one by one
    would have given the same, and only from the others on are they followed one by one.
    """
    position, orientation = np.full((len(q), 3), np.nan), np.full((len(q), 4), np.nan)

    def solve(mark: int, start: PlatformMotion | None) -> None:
        try:
            found = solve_forward_kinematics(geometry, q[mark:mark + 1], start)
        except ConvergenceError as error:
            raise ConvergenceError(int(samples[mark]), error.found, error.rule) from None
        position[mark], orientation[mark] = found.position[0], found.orientation[0]

    try:
        alone = solve_forward_kinematics(geometry, q, seed)
        starts = PlatformMotion.at_rest(alone.position, alone.orientation)
        followed = solve_forward_kinematics(geometry, q[1:], starts[:-1]) if len(q) > 1 else alone
    except ConvergenceError:
        solve(0, seed)
        doubtful = [0]
    else:
        position, orientation = alone.position.copy(), alone.orientation.copy()
        doubtful = np.flatnonzero(_differ(
            followed.position, followed.orientation, position[1:], orientation[1:])).tolist()
    for first in doubtful:
        for mark in range(first + 1, len(q)):
            before = position[mark].copy(), orientation[mark].copy()
            solve(mark, PlatformMotion.at_rest(position[mark - 1], orientation[mark - 1]))
            if not _differ(*before, position[mark], orientation[mark]):
                break
    return PlatformMotion.at_rest(position, orientation)


def _differ(position: Array, orientation: Array, other: Array, turned: Array) -> np.ndarray:
    """Return a mask of poses that are different solutions; NaN differs from all."""
    cosine = np.abs(np.sum(orientation * turned, axis=-1))  # of half the angle between them
    same: np.ndarray = ((np.abs(position - other).max(axis=-1) < SAME_POSE)
                        & (1 - cosine < SAME_POSE ** 2))
    return ~same
