# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The path of the drives between the points of a trajectory, and how to stop along it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion

STOP_POINTS = 10


class DrivePath(NamedTuple):
    """Cubic Hermite interpolation of N points; beyond the last point its velocity continues.

    Parameters
    ----------
    time : (N,) array
        Strictly increasing [s].
    position, velocity : (N, D) arrays
        [m, rad], per second.
    """

    time: Array
    position: Array
    velocity: Array

    def at(self, time: Array) -> JointMotion:
        """Return the motion at M times [s]; before the first point it is that of the first."""
        since = time - self.time[0]
        if len(self.time) == 1:
            return JointMotion(
                self.position[0] + np.maximum(since, 0.0)[:, None] * self.velocity[0],
                np.repeat(self.velocity, len(time), axis=0),
                np.zeros((len(time), self.position.shape[1])))
        within = np.clip(time, self.time[0], self.time[-1])
        left = np.clip(np.searchsorted(self.time, within, 'right') - 1, 0, len(self.time) - 2)
        h = np.diff(self.time)[left][:, None]
        x = (within[:, None] - self.time[left][:, None]) / h
        q0, q1 = self.position[left], self.position[left + 1]
        v0, v1 = self.velocity[left] * h, self.velocity[left + 1] * h
        c2, c3 = 3 * (q1 - q0) - 2 * v0 - v1, 2 * (q0 - q1) + v0 + v1
        beyond = np.maximum(time - self.time[-1], 0.0)[:, None]
        return JointMotion(
            q0 + x * (v0 + x * (c2 + x * c3)) + beyond * self.velocity[-1],
            (v0 + x * (2 * c2 + 3 * x * c3)) / h,
            np.where(beyond > 0, 0.0, (2 * c2 + 6 * x * c3) / h**2))

    def stop(self, start: float, duration: float) -> JointMotion:
        """Return a motion that brakes smoothly along the path and ends at rest on it.

        The speed along the path falls as (1 - t / duration)^2.

        Parameters
        ----------
        start : float
            Where on the path the stop begins [s].
        duration : float
            Of the stop [s].

        Returns
        -------
        JointMotion
            `STOP_POINTS` samples with their times since the beginning of the stop, the first one
            later than 0 and the last one at rest.
        """
        x = 1 - np.arange(1, STOP_POINTS + 1) / STOP_POINTS
        path = self.at(start + duration / 3 * (1 - x**3))
        speed, change = (x**2)[:, None], (-2 * x / duration)[:, None]
        return JointMotion(
            path.position, path.velocity * speed,
            path.acceleration * speed**2 + path.velocity * change, (1 - x) * duration)
