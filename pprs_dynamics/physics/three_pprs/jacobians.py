# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""[B]^-1 of Eq. (4) and the Jacobian [J] of Eq. (11), far enough from singular poses.

Rows of [B] are the wrenches that unit reactions H_i and V_i put on the platform, so that its
transpose also carries the reactions in Eq. (6).
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import SingularityError
from pprs_dynamics.physics.mechanism.evaluation import evaluate
from pprs_dynamics.physics.three_pprs.closure import (
    INVERSE_COLUMNS,
    InverseParameters,
    inverse_kernel,
)
from pprs_dynamics.physics.three_pprs.geometry import Geometry


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


def drive_jacobian(inverse: Array, sin_u: Array) -> Array:
    """Return [J], X_dot = J q_dot with X_dot = (v, omega) in `base`, (N, 6, 6).

    Parameters
    ----------
    inverse : (N, 36) array
        [B]^-1.
    sin_u : (N, 3) array
    """
    A = np.concatenate((np.ones_like(sin_u), sin_u), axis=1)                   # Eq. (4)
    J: Array = inverse.reshape(-1, 6, 6) * A[:, None, :]                       # Eq. (11)
    return J


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
    number = condition_number(geometry, drive_jacobian(inverse, chains[:, 12:15]))
    over = ~(number <= limit)
    if np.any(over):
        worst = int(np.argmax(over))
        raise SingularityError(
            int(samples[worst]), f'the condition number of the drive Jacobian is '
            f'{number[worst]:.4g}', f'limits.condition_number is {limit:g}')
