# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Jacobians of the mechanism: [A], [B], [J], [J_u], [J_omega] of Eq. (4), (10) and (11).

Rows of [B] are the wrenches that unit reactions H_i and V_i put on the platform, so that its
transpose also carries the reactions in Eq. (6).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import SingularityError
from pprs_dynamics.physics.mechanism.evaluation import evaluate
from pprs_dynamics.physics.three_pprs.closure import (
    INVERSE_COLUMNS,
    InverseParameters,
    Wrench,
    closure_rows,
    inverse_kernel,
    rod_row,
)
from pprs_dynamics.physics.three_pprs.geometry import Geometry
from pprs_dynamics.physics.three_pprs.inverse_kinematics import ChainKinematics


@dataclass(frozen=True)
class Jacobians:
    """Jacobians at N poses, evaluated where they are asked for.

    Parameters
    ----------
    geometry : Geometry
    chains : ChainKinematics
    B_inverse : (N, 6, 6) array

    Attributes
    ----------
    A : (N, 6) array
        Diagonal of [A]: 1 for the slides, sin u_i for the lifts.
    B : (N, 6, 6) array
        [B] with A q_dot = B X_dot, X_dot = (v, omega) in `base`.        Eq. (4)
    J : (N, 6, 6) array
        [J] = [B]^-1 [A], X_dot = J q_dot.                               Eq. (11)
    J_u : (N, 3, 6) array
        u_dot = J_u q_dot.                                               Eq. (10)
    J_omega : (N, 3, 6) array
        Lower half of [J], omega = J_omega q_dot.
    """

    geometry: Geometry
    chains: ChainKinematics
    B_inverse: Array

    @cached_property
    def A(self) -> Array:
        """Diagonal of [A], (N, 6)."""
        return np.concatenate((np.ones_like(self.chains.sin_u), self.chains.sin_u),
                              axis=1)                                          # Eq. (4)

    @cached_property
    def B(self) -> Array:
        """[B], (N, 6, 6)."""
        chains = self.chains
        rows = closure_rows(self.geometry.frames, chains.arm, chains.cos_u, chains.sin_u)
        return np.concatenate([_matrix(wrench) for wrench in rows], axis=1)

    @cached_property
    def J(self) -> Array:
        """[J], (N, 6, 6)."""
        return self.B_inverse * self.A[:, None, :]                    # Eq. (11)

    @cached_property
    def J_u(self) -> Array:
        """[J_u], (N, 3, 6)."""
        chains = self.chains
        rows = _matrix(rod_row(self.geometry.frames, self.geometry.rod_length, chains.arm,
                               chains.sin_u))
        return rows @ self.J                                          # Eq. (10)

    @property
    def J_omega(self) -> Array:
        """Lower half of [J], (N, 3, 6)."""
        return self.J[:, 3:]


def _matrix(wrench: Wrench) -> Array:
    """Return wrenches as rows, (N, 3, 6)."""
    return np.stack((*wrench.force, *wrench.moment), axis=-1)


def inverse_table(geometry: Geometry, chains: Array, condition_limit: float) -> Array:
    """Return [B]^-1, (N, 36), at the poses of a table of chains.

    Parameters
    ----------
    geometry : Geometry
    chains : (N, 48) array
        See `chain_table`.
    condition_limit : float
        Largest allowed condition number, see `condition_number`.

    Raises
    ------
    SingularityError
        Where det [B] = 0 (the drives cannot hold the platform) or the conditioning is over its
        limit.
    """
    inverse, bound = np.empty((len(chains), INVERSE_COLUMNS)), np.empty((len(chains), 1))
    parameters = geometry.kernel_parameters.extended(
        InverseParameters, condition_limit ** 2, geometry.platform_radius)
    if evaluate(inverse_kernel, parameters, chains, inverse, bound) >= 0:
        _require_regular(inverse)
        # The Frobenius condition number is never below the 2-norm one and costs a twentieth:
        # only samples that it does not clear are looked at closely.
        doubtful = np.flatnonzero(~(bound[:, 0] <= condition_limit ** 2))
        if np.isfinite(condition_limit) and len(doubtful):
            _require_conditioning(geometry, chains[doubtful], inverse[doubtful], doubtful,
                                  condition_limit)
    return inverse


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


def _require_regular(inverse: Array) -> None:
    singular = ~np.isfinite(inverse).all(axis=1)
    if np.any(singular):
        raise SingularityError(int(np.argmax(singular)), 'det [B] is 0',
                               'the drives cannot hold the platform here')


def _require_conditioning(
    geometry: Geometry, chains: Array, inverse: Array, samples: np.ndarray, limit: float,
) -> None:
    A = np.concatenate((np.ones((len(chains), 3)), chains[:, 12:15]), axis=1)
    number = condition_number(geometry, inverse.reshape(-1, 6, 6) * A[:, None, :])  # Eq. (11)
    over = ~(number <= limit)
    if np.any(over):
        worst = int(np.argmax(over))
        raise SingularityError(
            int(samples[worst]), f'the condition number of the drive Jacobian is '
            f'{number[worst]:.4g}', f'limits.condition_number is {limit:g}')
