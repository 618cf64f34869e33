# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forward kinematics: the platform's pose from drive positions, by Newton-Raphson on Eq. (3).

Six drive positions belong to several poses. The solver therefore follows the branch: it moves
from a known pose to the wanted drive positions in steps. It accepts only poses whose det [B] has
the sign of the home pose, and whose rods lean as `geometry.elbow` demands. Other poses that meet
both conditions are turned by more than 150 degrees; only a seed near them leads there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array, Sample, Value
from pprs_dynamics.errors import ConvergenceError, MotionError, SingularityError
from pprs_dynamics.physics.mechanism.arithmetic import everywhere, larger, sqrt
from pprs_dynamics.physics.mechanism.evaluation import evaluate
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.motion_checks import checked_matrix
from pprs_dynamics.physics.mechanism.motion_sample import Rotation, rotation, vector
from pprs_dynamics.physics.mechanism.vectors import (
    ChainVector,
    Vector,
    add,
    dot,
    in_chain,
    plus,
    times,
)
from pprs_dynamics.physics.three_pprs.chains import CHAINS, each_chain
from pprs_dynamics.physics.three_pprs.closure import (
    DriveValues,
    eliminate,
    rows_of_chains,
    solve_closure,
)
from pprs_dynamics.physics.three_pprs.geometry import Geometry
from pprs_dynamics.physics.three_pprs.inverse_kinematics import chain_arm, solve_inverse_kinematics
from pprs_dynamics.physics.three_pprs.kernel_parameters import GeometryParameters

RESIDUAL_TOLERANCE = 1e-13  # of the lengths involved; a few rounding errors of the closure
MAXIMUM_STEPS = 30
# Where det [B] has fallen to this share of its value at home, two solutions are about to meet.
NEAR_BRANCH = 0.1
SINGULAR_HOME = 1e-9
POSE = 7  # columns of a motion that are position and orientation


@dataclass(frozen=True)
class ForwardKinematics:
    """Poses that belong to N sets of drive positions.

    Parameters
    ----------
    position : (N, 3) array
        P [m].
    orientation : (N, 4) array
        Unit quaternions x, y, z, w.
    steps : (N,) int array
        Newton steps taken.
    near_branch : (N,) bool array
        True where another solution is close: abs(det [B]) below a tenth of its value at home.
        Poses there are sensitive to the measurement and may have left the true branch.
    """

    position: Array
    orientation: Array
    steps: np.ndarray
    near_branch: np.ndarray


def home_pose() -> PlatformMotion:
    """Return the platform at rest, unturned, above the base's centre.

    Any height is as good for kinematics, which only shifts the lifts.
    """
    return PlatformMotion.at_rest((0.0, 0.0, 0.5))


def solve_forward_kinematics(
    geometry: Geometry, drive_positions: ArrayLike, seed: PlatformMotion | None = None,
) -> ForwardKinematics:
    """Return the platform's pose for drive positions, Eq. (3) solved by Newton-Raphson.

    Parameters
    ----------
    geometry : Geometry
    drive_positions : (N, 6) array_like
        q in drive order [m].
    seed : PlatformMotion, optional
        One pose, or one for every sample, to start from; the home pose by default.

    Raises
    ------
    MotionError
        For a wrong shape or a non-finite number.
    ConvergenceError
        Where no pose of the home pose's assembly mode is found.
    SingularityError
        Where the geometry's home pose is itself singular.
    """
    q = checked_matrix('drive positions', drive_positions, 6)
    home = home_pose()
    start = home if seed is None else seed
    if len(start) not in (1, len(q)):
        raise MotionError('seed', f'it has {len(start)} poses',
                          f'have 1 or {len(q)}, as the drive positions', 'shape')
    pose = np.array(np.broadcast_to(start.rows[:, :POSE], (len(q), POSE)))
    if seed is None:
        pose[:, 2] += q[:, 3:].mean(axis=1) - _drive_positions(geometry, home)[0, 3:].mean()
    home_determinant = float(_newton(
        geometry, _drive_positions(geometry, home), home.rows[:, :POSE].copy()).determinant[0])
    # In units of the platform's radius det [B] is a pure number, 0.6 for the paper's robot.
    if not abs(home_determinant) >= SINGULAR_HOME * geometry.platform_radius ** 3:
        raise SingularityError(0, 'det [B] is 0 at the home pose of this geometry',
                               'home must tell which assembly mode is meant')

    steps = np.zeros(len(q), dtype=int)
    determinant = np.full(len(q), np.nan)
    pending = np.arange(len(q))
    # The straight way first; what fails follows the branch in ever smaller moves of the drives.
    for moves in (1, 4, 16, 64):
        moved, target = (pose.copy(), q) if moves == 1 else (pose[pending], q[pending])
        good = np.ones(len(pending), dtype=bool)
        count = np.zeros(len(pending), dtype=int)
        if moves > 1:
            q_start = _drive_positions(
                geometry, PlatformMotion.at_rest(moved[:, :3], moved[:, 3:]))
            for move in range(1, moves):
                found = _newton(geometry, q_start + (target - q_start) * (move / moves), moved)
                good &= found.converged
                count += found.steps
                if not good.any():
                    break
        if not good.any():
            continue
        found = _newton(geometry, target, moved)
        good &= found.converged & found.upright
        count += found.steps
        relative = found.determinant / home_determinant
        good &= relative > 0
        if moves == 1 and good.all():
            pose, determinant, steps = moved, relative, count
            break
        done = pending[good]
        pose[done], determinant[done] = moved[good], relative[good]
        steps[pending] += count
        if good.all():
            break
        pending = pending[~good]
    else:
        raise ConvergenceError(
            int(pending[0]), f'no pose found for drive positions {q[pending[0]].tolist()} m',
            'they must close the mechanism in the assembly mode of the home pose')
    return ForwardKinematics(np.ascontiguousarray(pose[:, :3]), np.ascontiguousarray(pose[:, 3:]),
                             steps, determinant < NEAR_BRANCH)


class _Found(NamedTuple):
    """Where Newton-Raphson ended: whether it arrived there, and det [B] times a constant."""

    converged: np.ndarray
    determinant: Array
    upright: np.ndarray
    steps: np.ndarray


def _newton(geometry: Geometry, q: Array, pose: Array) -> _Found:
    """Improve poses in place."""
    found = np.empty((len(q), 4))
    evaluate(newton_kernel, geometry.kernel_parameters, np.ascontiguousarray(q), pose, found)
    return _Found(found[:, 0] > 0, found[:, 1], found[:, 2] > 0, found[:, 3].astype(int))


class Closure(NamedTuple):
    """Residuals of Eq. (3) in a chain, at a pose that does not yet close it.

    `slide` and `lift` are residuals [m]; the rod is given as it then is.
    """

    arm: ChainVector
    cos_u: Value
    sin_u: Value
    slide: Value
    lift: Value


@each_chain
def chain_closures(
    i: int, geometry: GeometryParameters, P: Vector, R: Rotation, q: Any, s: Sample,
) -> Closure:
    """Return the residuals of Eq. (3) in chain i for the drive positions of sample s.

    The rod may point out of its chain's plane. That part of its row in [B] is a multiple of the
    slide's row, which is taken off here: the rows are then those of `closure_rows`.
    """
    k, l = geometry.chains[i], geometry.l  # noqa: E741
    arm = chain_arm(k, R)
    A = add(in_chain(k, P), arm)
    rod = ChainVector(A.e - geometry.R, A.n - q[s, i], A.k - q[s, CHAINS + i])
    # The squared rod equation is divided by 2 l, so that both halves are in metres.
    length = (rod.e * rod.e + rod.n * rod.n + rod.k * rod.k - l * l) / (2.0 * l)
    return Closure(arm, -rod.e / l, rod.k / l, rod.n, length - rod.n * rod.n / l)  # Eq. (3)


def newton_kernel(p: GeometryParameters, s: Sample, q: Any, pose: Array, found: Any) -> Any:
    """Improve a table of poses until they belong to drive positions."""
    P = vector(pose, s, 0)
    x, y, z, w = pose[s, 3], pose[s, 4], pose[s, 5], pose[s, 6]
    # Heights far from 0 carry their own rounding.
    tolerance = RESIDUAL_TOLERANCE * (p.l + _largest(_farthest_positions(q, s)))
    steps, upright, arrived = 0.0 * x, 0.0 * x, x > 2.0
    determinant: Value = 0.0 * x
    for k in range(MAXIMUM_STEPS + 1):
        rods = chain_closures(p, P, rotation(x, y, z, w), q, s)
        # The smallest sine of the rods, positive where all lean as `geometry.elbow` demands.
        upright = -_largest(_downward_sines(p, rods))
        arrived = _largest(_residuals(rods)) <= tolerance
        # The last step moves nothing that the determinant could tell.
        if k > 0 and everywhere(arrived):
            break
        eliminated = eliminate(p, rows_of_chains(p, rods), rods)
        determinant = eliminated.determinant
        v, omega = solve_closure(p, eliminated, rods, DriveValues(
            (-rods[0].slide, -rods[1].slide, -rods[2].slide),
            (-rods[0].lift, -rods[1].lift, -rods[2].lift)))
        # A Newton step longer than the mechanism leaves the branch: shorten it.
        reach = larger(sqrt(dot(v, v)) / p.l, sqrt(dot(omega, omega)))
        share = (1.0 - 1.0 * arrived) * 0.5 / larger(reach, 0.5)
        steps = steps + (1.0 - 1.0 * arrived)
        P = plus(P, times(share, v))
        x, y, z, w = turned_quaternion(times(0.5 * share, omega), x, y, z, w)
    pose[s, 0], pose[s, 1], pose[s, 2] = P.x, P.y, P.z
    pose[s, 3], pose[s, 4], pose[s, 5], pose[s, 6] = x, y, z, w
    found[s, 0], found[s, 1] = 1.0 * arrived, determinant
    found[s, 2], found[s, 3] = upright, steps
    return True


@each_chain
def _farthest_positions(i: int, q: Any, s: Sample) -> Any:
    return larger(abs(q[s, i]), abs(q[s, CHAINS + i]))


@each_chain
def _residuals(i: int, rods: Any) -> Any:
    return larger(abs(rods[i].slide), abs(rods[i].lift))


@each_chain
def _downward_sines(i: int, geometry: GeometryParameters, rods: Any) -> Any:
    return -geometry.elbow * rods[i].sin_u


def _largest(values: Any) -> Any:
    return larger(larger(values[0], values[1]), values[2])


def turned_quaternion(
    half: Vector, x: Value, y: Value, z: Value, w: Value,
) -> tuple[Any, Any, Any, Any]:
    """Return a unit quaternion after a turn whose vector in `base`, halved, is given.

    Exact to the turn's second order.
    """
    X = x + w * half.x + half.y * z - half.z * y
    Y = y + w * half.y + half.z * x - half.x * z
    Z = z + w * half.z + half.x * y - half.y * x
    W = w - half.x * x - half.y * y - half.z * z
    scale = 1.0 / sqrt(X * X + Y * Y + Z * Z + W * W)
    return scale * X, scale * Y, scale * Z, scale * W


def _drive_positions(geometry: Geometry, pose: PlatformMotion) -> Array:
    return solve_inverse_kinematics(geometry, pose).position
