# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Periodic motions of the platform: a Fourier series per degree of freedom, from rest to rest.

Each of x, y, z and the turns about z, y and x follows

    c(t) = sum_k a_k (cos(k w t) - 1) + b_k sin(k w t),    w = 2 pi / duration,

with sum k b_k = sum k^2 a_k = sum k^3 b_k = 0: at its ends the platform is where it started, and
velocity, acceleration and the first derivative of acceleration are zero.

References
----------
J. Swevers, C. Ganseman, D. Bilgin, J. De Schutter, H. Van Brussel, Optimal robot excitation and
identification, IEEE Trans. Robotics and Automation 13 (1997) 730-740 (Fourier series as
excitation).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.joint_series import resting_series
from pprs_dynamics.physics.mechanism.motion import PlatformMotion

FREEDOMS = 6  # x, y, z [m]; turns about z, then y, then x [rad]
CONDITIONS = 3  # on each series, for rest at its ends


@dataclass(frozen=True)
class FourierPath:
    """One motion; see the module.

    Parameters
    ----------
    duration : float
        [s]
    harmonics : (6, K) int array
        Of each degree of freedom, K of at least 2, different and at least 1.
    centre : 3 floats
        Where the platform starts and ends, unturned [m].
    parameters : (size,) array
        Lengths [m], then angles [rad]: each is about the excursion of one series that satisfies
        the conditions.
    """

    duration: float
    harmonics: np.typing.NDArray[np.int_]
    centre: tuple[float, float, float]
    parameters: Array

    @classmethod
    def at_rest(cls, duration: float, harmonics: np.typing.NDArray[np.int_],
                centre: tuple[float, float, float]) -> FourierPath:
        """Return the path that stays at the centre."""
        size = FREEDOMS * (2 * int(harmonics.shape[1]) - CONDITIONS)
        return cls(duration, harmonics, centre, np.zeros(size))

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return len(self.parameters)

    def with_parameters(self, parameters: Array) -> FourierPath:
        """Return the path of the same harmonics with other parameters, (size,)."""
        return replace(self, parameters=parameters)

    def scaled(self, factor: float) -> FourierPath:
        """Return the same motion with all excursions times a factor."""
        return self.with_parameters(factor * self.parameters)

    def motion(self, time: Array) -> PlatformMotion:
        """Return the motion at times [s], with exact velocities and accelerations."""
        value, rate, gain = self._coordinates(np.asarray(time, dtype=float))
        (psi, theta, phi), w, e = value[3:], rate[3:], gain[3:]
        zero, one = np.zeros_like(psi), np.ones_like(psi)
        # Axes of the three turns in `base`; the earlier turns carry the later axes along.
        z = np.stack((zero, zero, one), axis=1)
        y = np.stack((-np.sin(psi), np.cos(psi), zero), axis=1)
        x = np.stack((np.cos(psi) * np.cos(theta), np.sin(psi) * np.cos(theta),
                      -np.sin(theta)), axis=1)
        about_z, about_y, about_x = (
            rate_of[:, None] * axis for rate_of, axis in zip(w, (z, y, x), strict=True))
        omega = about_z + about_y + about_x
        epsilon = (e[0][:, None] * z + e[1][:, None] * y + e[2][:, None] * x
                   + np.cross(about_z, about_y) + np.cross(about_z + about_y, about_x))
        return PlatformMotion(value[:3].T + self.centre, _quaternions(psi, theta, phi),
                              rate[:3].T, omega, gain[:3].T, epsilon, time)

    def _coordinates(self, t: Array) -> tuple[Array, Array, Array]:
        """Return coordinates from the centre and their derivatives, (6, N) each."""
        rows = np.reshape(self.parameters, (FREEDOMS, -1))
        coefficients = np.stack([resting_series(tuple(row.tolist())) @ own
                                 for row, own in zip(self.harmonics, rows, strict=True)])
        a, b = np.split(coefficients[:, :, None], 2, axis=1)
        omega = 2 * np.pi / self.duration * self.harmonics[:, :, None]
        c, s = np.cos(omega * t), np.sin(omega * t)
        return (np.sum(a * (c - 1) + b * s, axis=1), np.sum(omega * (b * c - a * s), axis=1),
                -np.sum(omega ** 2 * (a * c + b * s), axis=1))


def _quaternions(psi: Array, theta: Array, phi: Array) -> Array:
    """Return the orientations of turns about z, then the new y, then the new x, (N, 4)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler('ZYX', np.stack((psi, theta, phi), axis=1)).as_quat()
