# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Fourier series of joints from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion

GRID = 512  # points of a period at which peaks are looked for


@cache
def resting_series(harmonics: tuple[int, ...]) -> Array:
    """Return a basis of all (a, b) that start and end at rest, each of unit peak, (2 K, p)."""
    # Here and not above: only designed and played motions need it, commands start sooner.
    from scipy.linalg import null_space

    k = np.array(harmonics, dtype=float)
    zero = np.zeros_like(k)
    conditions = np.stack([np.concatenate(row) for row in (
        (zero, k / k.max()), ((k / k.max()) ** 2, zero), (zero, (k / k.max()) ** 3))])
    basis = null_space(conditions)
    angle = 2 * np.pi * k[:, None] * np.arange(GRID) / GRID
    waves = np.concatenate((np.cos(angle) - 1, np.sin(angle)))
    result: Array = basis / np.abs(basis.T @ waves).max(axis=1)
    return result


@dataclass(frozen=True)
class JointSeries:
    """One motion of n joints: q = middle + sum a_k (cos k w t - 1) + b_k sin k w t.

    Parameters
    ----------
    coefficients : (n, p) array
        Of the resting series [rad, m].
    middle : (n,) array
        Where it starts and ends [rad, m].
    duration : float
        [s]
    harmonics : int
        Of one over the duration.
    """

    coefficients: Array
    middle: Array
    duration: float
    harmonics: int

    @staticmethod
    def size(harmonics: int) -> int:
        """Return the number p of coefficients per joint."""
        return int(resting_series(tuple(range(1, harmonics + 1))).shape[1])

    def scaled(self, factor: float) -> JointSeries:
        """Return the same motion with all excursions times a factor."""
        return replace(self, coefficients=factor * self.coefficients)

    def motion(self, time: Array) -> JointMotion:
        """Return the motion at times [s], with exact velocities and accelerations."""
        K = self.harmonics
        ab = self.coefficients @ resting_series(tuple(range(1, K + 1))).T
        a, b = ab[:, :K].T, ab[:, K:].T
        omega = 2 * np.pi * np.arange(1, K + 1) / self.duration
        s, c = np.sin(np.outer(time, omega)), np.cos(np.outer(time, omega))
        w = omega[:, None]
        return JointMotion(self.middle + (c - 1) @ a + s @ b, c @ (w * b) - s @ (w * a),
                           -(c @ (w * w * a)) - s @ (w * w * b), time)
