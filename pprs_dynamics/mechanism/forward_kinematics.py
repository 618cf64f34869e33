"""From measured drive positions to the pose of the platform: Newton-Raphson on Eq. (3).

Six drive positions belong to several poses. The solver therefore follows the branch: it moves
from a known pose to the wanted drive positions in steps, and accepts only poses whose det [B]
has the sign that it has at the home pose, and whose rods lean the way that the elbow says. These
two conditions alone do not single out one pose: others that meet them are turned by more than
150 degrees against it, and are found only from a seed that lies there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.errors import ConvergenceError, MotionError, SingularityError
from pprs_dynamics.mechanism.inverse_kinematics import (
    solve_inverse_kinematics,
    spherical_joint_arms,
)
from pprs_dynamics.mechanism.motion import PlatformMotion, checked_matrix
from pprs_dynamics.mechanism.robot import Array, Geometry

RESIDUAL_TOLERANCE = 1e-13  # of the lengths involved; a few rounding errors of the closure
MAXIMUM_STEPS = 30
# Where det [B] has fallen to this share of its value at home, two solutions are about to meet.
NEAR_BRANCH = 0.1
SINGULAR_HOME = 1e-9


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


def home_pose(geometry: Geometry, height: float = 0.5) -> PlatformMotion:
    """Return the platform at rest, unturned, above the base's centre.

    Parameters
    ----------
    geometry : Geometry
    height : float
        Z of the platform [m]; any height is as good for kinematics, which only shifts the lifts.
    """
    return PlatformMotion.at_rest((0.0, 0.0, height))


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
        Where the geometry's home pose is itself singular, so that it tells no mode.
    """
    q = checked_matrix('drive positions', drive_positions, 6)
    home = home_pose(geometry)
    start = home if seed is None else seed
    if len(start) not in (1, len(q)):
        raise MotionError('seed', f'it has {len(start)} poses',
                          f'have 1 or {len(q)}, as the drive positions', 'shape')
    P = np.array(np.broadcast_to(start.position, (len(q), 3)))
    rotation = np.array(np.broadcast_to(start.rotation, (len(q), 3, 3)))
    if seed is None:
        P[:, 2] += q[:, 3:].mean(axis=1) - _drive_positions(geometry, home)[0, 3:].mean()
    home_B = _closure(geometry, home.position, home.rotation, _drive_positions(geometry, home))[1]
    home_determinant = float(np.linalg.det(home_B)[0])
    # In units of the platform's radius det [B] is a pure number, 0.6 for the paper's robot.
    if abs(home_determinant) < SINGULAR_HOME * geometry.platform_radius ** 3:
        raise SingularityError(0, 'det [B] is 0 at the home pose of this geometry',
                               'home must tell which assembly mode is meant')

    steps = np.zeros(len(q), dtype=int)
    determinant = np.full(len(q), np.nan)
    pending = np.arange(len(q))
    # The straight way first; what fails follows the branch in ever smaller moves of the drives.
    for moves in (1, 4, 16, 64):
        P_new, rotation_new, target = P[pending].copy(), rotation[pending].copy(), q[pending]
        good = np.ones(len(pending), dtype=bool)
        count = np.zeros(len(pending), dtype=int)
        if moves > 1:
            q_start = _drive_positions(
                geometry, PlatformMotion.at_rest(P_new, _quaternions(rotation_new)))
            for move in range(1, moves):
                way = q_start + (target - q_start) * (move / moves)
                good &= _newton(geometry, way, P_new, rotation_new, count)[0]
                if not good.any():
                    break
        if not good.any():
            continue
        converged, B = _newton(geometry, target, P_new, rotation_new, count)
        good &= converged
        with np.errstate(all='ignore'):
            found = np.linalg.det(B) / home_determinant
        good &= (found > 0) & _elbow_agrees(geometry, P_new, rotation_new, q[pending])
        done = pending[good]
        P[done], rotation[done] = P_new[good], rotation_new[good]
        determinant[done] = found[good]
        steps[pending] += count
        pending = pending[~good]
        if not len(pending):
            break
    else:
        raise ConvergenceError(
            int(pending[0]), f'no pose found for drive positions {q[pending[0]].tolist()} m',
            'they must close the mechanism in the assembly mode of the home pose')
    return ForwardKinematics(P, _quaternions(rotation), steps, determinant < NEAR_BRANCH)


def _newton(
    geometry: Geometry, q: Array, P: Array, rotation: Array, steps: np.ndarray,
) -> tuple[np.ndarray, Array]:
    """Improve poses in place, count steps, and return where they converged, with [B] there."""
    active = np.arange(len(q))
    converged = np.zeros(len(q), dtype=bool)
    found = np.full((len(q), 6, 6), np.nan)
    for _ in range(MAXIMUM_STEPS):
        residual, B = _closure(geometry, P[active], rotation[active], q[active])
        size = np.abs(residual).max(axis=1)
        # Heights far from 0 carry their own rounding.
        arrived = size <= RESIDUAL_TOLERANCE * (
            geometry.rod_length + np.abs(q[active]).max(axis=1))
        converged[active[arrived]], found[active[arrived]] = True, B[arrived]
        active, residual, B = active[~arrived], residual[~arrived], B[~arrived]
        if not len(active):
            break
        with np.errstate(all='ignore'):
            try:
                step = np.linalg.solve(B, -residual[..., None])[..., 0]
            except np.linalg.LinAlgError:
                # One exactly singular matrix stops all: go on with the others.
                regular = np.isfinite(B).all(axis=(1, 2)) & (np.linalg.det(B) != 0.0)
                active, residual, B = active[regular], residual[regular], B[regular]
                step = np.linalg.solve(B, -residual[..., None])[..., 0]
            # A Newton step longer than the mechanism leaves the branch: shorten it.
            length = np.maximum(np.linalg.norm(step[:, :3], axis=1) / geometry.rod_length,
                                np.linalg.norm(step[:, 3:], axis=1))
            step *= np.minimum(1.0, 0.5 / np.maximum(length, 1e-300))[:, None]
        steps[active] += 1
        usable = np.isfinite(step).all(axis=1)
        active, step = active[usable], step[usable]
        P[active] += step[:, :3]
        rotation[active] = _turned(rotation[active], step[:, 3:])
    return converged, found


def _closure(geometry: Geometry, P: Array, rotation: Array, q: Array) -> tuple[Array, Array]:
    """Return the residual of Eq. (3) [m] and its Jacobian with respect to (P, rotation)."""
    frames = geometry.frames
    arms = spherical_joint_arms(geometry, rotation)
    A = P[:, None, :] + arms
    n = np.stack((-frames.sin, frames.cos, np.zeros(3)), axis=-1)
    C = (geometry.base_radius * np.stack((frames.cos, frames.sin, np.zeros(3)), axis=-1)
         + q[:, :3, None] * n + q[:, 3:, None] * np.array([0.0, 0.0, 1.0]))
    rod = A - C
    along = np.broadcast_to(n, rod.shape)
    # The squared rod equation is divided by 2 l, so that both halves are in metres.
    residual = np.concatenate((
        np.einsum('nij,ij->ni', rod, n),
        (np.einsum('nij,nij->ni', rod, rod) - geometry.rod_length ** 2)
        / (2 * geometry.rod_length)), axis=1)                                  # Eq. (3)
    directions = np.concatenate((along, rod / geometry.rod_length), axis=1)
    moments = np.cross(np.concatenate((arms, arms), axis=1), directions)
    return residual, np.concatenate((directions, moments), axis=2)


def _elbow_agrees(geometry: Geometry, P: Array, rotation: Array, q: Array) -> np.ndarray:
    height = P[:, None, 2] + spherical_joint_arms(geometry, rotation)[..., 2] - q[:, 3:]
    agrees: np.ndarray = np.all(height * geometry.elbow_sign > 0, axis=1)
    return agrees


def _drive_positions(geometry: Geometry, pose: PlatformMotion) -> Array:
    return solve_inverse_kinematics(geometry, pose).position


def _turned(rotation: Array, turn: Array) -> Array:
    """Return rotations after small turns about axes of `base` (Rodrigues)."""
    angle = np.linalg.norm(turn, axis=1)
    x, y, z = turn.T
    zero = np.zeros_like(x)
    K = np.stack((zero, -z, y, z, zero, -x, -y, x, zero), axis=-1).reshape(-1, 3, 3)
    a = np.sinc(angle / np.pi)[:, None, None]
    b = (0.5 * np.sinc(angle / (2 * np.pi)) ** 2)[:, None, None]
    turned: Array = rotation + a * (K @ rotation) + b * (K @ (K @ rotation))
    return turned


def _quaternions(rotation: Array) -> Array:
    from scipy.spatial.transform import Rotation

    quaternions: Array = Rotation.from_matrix(rotation).as_quat()
    return quaternions
