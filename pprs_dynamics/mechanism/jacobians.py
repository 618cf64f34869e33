"""Jacobians of the mechanism: [A], [B], [J], [J_u], [J_omega] of Eq. (4), (10) and (11).

Rows of [B] are the wrenches that unit reactions H_i and V_i put on the platform, so that its
transpose also carries the reactions in Eq. (6).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.errors import SingularityError
from pprs_dynamics.mechanism.inverse_kinematics import ChainKinematics
from pprs_dynamics.mechanism.robot import Array, ChainFrames, ChainVector, Geometry, cross


@dataclass(frozen=True)
class Jacobians:
    """Jacobians at N poses.

    Parameters
    ----------
    A : (N, 6) array
        Diagonal of [A]: 1 for the slides, sin u_i for the lifts.
    B : (N, 6, 6) array
        [B] with A q_dot = B X_dot, X_dot = (v, omega) in `base`.        Eq. (4)
    B_inverse : (N, 6, 6) array
    J : (N, 6, 6) array
        [J] = [B]^-1 [A], X_dot = J q_dot.                               Eq. (11)
    J_u : (N, 3, 6) array
        u_dot = J_u q_dot.                                               Eq. (10)
    """

    A: Array
    B: Array
    B_inverse: Array
    J: Array
    J_u: Array

    @property
    def J_omega(self) -> Array:
        """Lower half of [J], omega = J_omega q_dot, (N, 3, 6)."""
        return self.J[:, 3:]


def wrench_rows(frames: ChainFrames, direction: ChainVector, arm: ChainVector) -> Array:
    """Return [f, rho x f] per chain for unit forces at A_i, in `base`, (N, 3, 6)."""
    moment = frames.base(cross(arm, direction))
    return np.concatenate((frames.base(direction), moment), axis=-1)


def compute_jacobians(
    geometry: Geometry, chains: ChainKinematics, condition_limit: float = np.inf,
) -> Jacobians:
    """Return the Jacobians at the poses of `chains`.

    Parameters
    ----------
    geometry : Geometry
    chains : ChainKinematics
    condition_limit : float
        Largest allowed condition number, see `condition_number`.

    Raises
    ------
    SingularityError
        Where det [B] = 0 (the drives cannot hold the platform) or the conditioning is over its
        limit.
    """
    frames, zero = geometry.frames, np.zeros_like(chains.cos_u)
    one = np.ones_like(zero)
    axis, radial = ChainVector(zero, one, zero), ChainVector(one, zero, zero)
    A = np.concatenate((one, chains.sin_u), axis=1)                            # Eq. (4)
    B = np.concatenate((
        wrench_rows(frames, axis, chains.arm),
        wrench_rows(frames, chains.rod_direction, chains.arm)), axis=1)        # Eq. (4)
    try:
        B_inverse = np.asarray(np.linalg.inv(B), dtype=np.float64)
    except np.linalg.LinAlgError:
        sample = int(np.argmax([np.linalg.matrix_rank(matrix) < 6 for matrix in B]))
        raise SingularityError(sample, 'det [B] is 0',
                               'the drives cannot hold the platform here') from None
    J = B_inverse * A[:, None, :]                                              # Eq. (11)
    # The rod follows its tip: u_dot_i = e_i . v_Ai / (l sin u_i).
    rod_rows: Array = wrench_rows(frames, radial, chains.arm)
    J_u: Array = (rod_rows / (geometry.rod_length * chains.sin_u)[..., None]) @ J  # Eq. (10)
    jacobians = Jacobians(A, B, B_inverse, J, J_u)
    if np.isfinite(condition_limit):
        _require_conditioning(geometry, jacobians, condition_limit)
    return jacobians


def condition_number(geometry: Geometry, J: Array) -> Array:
    """Return the condition number of the drive Jacobian, (N,).

    Rotations are multiplied by the platform's radius r as characteristic length, so that both
    halves of a twist are in m/s.

    References
    ----------
    J. Angeles, Fundamentals of Robotic Mechanical Systems, on the characteristic length.
    """
    singular = np.linalg.svd(_homogeneous(geometry, J), compute_uv=False)
    with np.errstate(divide='ignore'):
        number: Array = singular[:, 0] / singular[:, -1]
    return number


def _homogeneous(geometry: Geometry, J: Array) -> Array:
    r = geometry.platform_radius
    scaled: Array = J * np.array([1.0, 1.0, 1.0, r, r, r])[:, None]
    return scaled


def _require_conditioning(geometry: Geometry, jacobians: Jacobians, limit: float) -> None:
    # The Frobenius condition number is never below the 2-norm one and costs a twentieth: only
    # samples that it does not clear are looked at closely.
    r, sin_u = geometry.platform_radius, jacobians.A
    J = _homogeneous(geometry, jacobians.J)
    J_inverse = jacobians.B / sin_u[..., None] / np.array([1.0, 1.0, 1.0, r, r, r])
    bound = np.sqrt(np.einsum('nij,nij->n', J, J) * np.einsum('nij,nij->n', J_inverse, J_inverse))
    doubtful = np.flatnonzero(~(bound <= limit))
    if not len(doubtful):
        return
    number = condition_number(geometry, np.nan_to_num(jacobians.J[doubtful], posinf=0, neginf=0))
    over = ~(number <= limit)
    if np.any(over):
        worst = int(np.argmax(over))
        raise SingularityError(
            int(doubtful[worst]), f'the condition number of the drive Jacobian is '
            f'{number[worst]:.4g}', f'limits.condition_number is {limit:g}')
