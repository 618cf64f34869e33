# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Physically consistent inertial parameters of links (pseudo-inertia), and their prior.

A body's pseudo-inertia P (4 x 4: second moments, first moment, mass) is positive definite, and
every such P belongs to a body. P = L_0 M M^T L_0^T with L_0 L_0^T = P_0, the description's, and M
lower triangular: M = 1 is the description. Its distance is |L_0^-1 P L_0^-T - 1|, which does not
depend on frames or units.

References
----------
T. Lee, P. M. Wensing, F. C. Park, Geometric robot dynamic identification: a convex programming
approach, IEEE Transactions on Robotics 36 (2020).
C. Rucker, P. M. Wensing, Smooth parameterization of rigid-body inertia, IEEE Robotics and
Automation Letters 7 (2022).
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.description import (
    PARAMETERS,
    from_pseudo_inertia,
    pseudo_inertia,
)

LEAST_MASS = 1e-3  # [kg]; links without mass are given this, and
LEAST_RADIUS = 0.02  # [m] this radius: thin rods of a drawing have none across
ROWS, COLUMNS = np.tril_indices(4)


class Bodies:
    """Links as points of a flat space, n times 10 numbers, 0 for the description.

    Parameters
    ----------
    described : (n, 10) array
        Inertial parameters of the description; see `Mechanism`.
    """

    def __init__(self, described: Array) -> None:
        self.roots = np.stack([np.linalg.cholesky(_thick(pseudo_inertia(one)))
                               for one in described])

    def __len__(self) -> int:
        return PARAMETERS * len(self.roots)

    def inertial(self, point: Array) -> Array:
        """Return the inertial parameters (n, 10) at a point (10 n,)."""
        P = self.roots @ self._relative(point) @ self.roots.transpose(0, 2, 1)
        return np.array([from_pseudo_inertia(one) for one in P])

    def distance(self, point: Array) -> Array:
        """Return the distance from the description, element by element, (16 n,)."""
        return (self._relative(point) - np.eye(4)).ravel()

    def _relative(self, point: Array) -> Array:
        M = np.tile(np.eye(4), (len(self.roots), 1, 1))
        M[:, ROWS, COLUMNS] += point.reshape(-1, PARAMETERS)
        return M @ M.transpose(0, 2, 1)


def _thick(P: Array) -> Array:
    """Return a pseudo-inertia of a body with mass and extent."""
    mass = max(float(P[3, 3]), LEAST_MASS)
    centre = P[:3, 3] / mass
    about = P[:3, :3] - mass * np.outer(centre, centre)
    values, axes = np.linalg.eigh((about + about.T) / 2)
    values = np.maximum(values, mass * LEAST_RADIUS ** 2)
    thick = np.empty((4, 4))
    thick[:3, :3] = axes @ np.diag(values) @ axes.T + mass * np.outer(centre, centre)
    thick[:3, 3] = thick[3, :3] = mass * centre
    thick[3, 3] = mass
    return thick
