# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motions of drives: samples, paths between points, and Fourier series from rest to rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.motion import checked_matrix, checked_times

GRID = 512  # points of a period at which peaks are looked for
STOP_POINTS = 10


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
        """Return the motion with all excursions multiplied by a factor."""
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

        The speed along the path falls as (1 - t / duration)^2. Before the first point of the path
        nothing moves yet.

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
        moments = start + duration / 3 * (1 - x**3)
        path, moves = self.at(moments), moments >= self.time[0]
        speed, change = (moves * x**2)[:, None], (moves * -2 * x / duration)[:, None]
        return JointMotion(
            path.position, path.velocity * speed,
            path.acceleration * speed**2 + path.velocity * change, (1 - x) * duration)


@dataclass(frozen=True)
class JointMotion:
    """N samples of the motion of D drives.

    Parameters
    ----------
    position, velocity, acceleration : (N, D) arrays
        [m, m/s, m/s^2], and of revolute joints [rad, rad/s, rad/s^2].
    time : (N,) array, optional
        [s]
    channels : mapping of str to (N, D) array
        Further measurements of the drives, such as `temperature` [degC].
    kept : dict of Structure to LinkMotion, optional
        Where the kinematics of this motion are kept for another evaluation of it.
    """

    position: Array
    velocity: Array
    acceleration: Array
    time: Array | None = None
    channels: Mapping[str, Array] = field(default_factory=dict, kw_only=True)
    kept: dict[Any, Any] | None = field(default=None, kw_only=True, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.position)

    def __getitem__(self, samples: Any) -> Self:
        """Return the samples that a slice, a mask or indices select."""
        return replace(self, position=self.position[samples], velocity=self.velocity[samples],
                       acceleration=self.acceleration[samples],
                       time=None if self.time is None else self.time[samples], kept=None,
                       channels={name: values[samples] for name, values in self.channels.items()})

    def with_time(self, time: ArrayLike) -> Self:
        """Return the motion at given times."""
        return replace(self, time=checked_times(time, len(self)))

    def with_channels(self, channels: Mapping[str, Array]) -> Self:
        """Return the motion with measured channels."""
        return replace(self, channels=channels)

    @classmethod
    def checked(cls, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike,
                time: ArrayLike, drives: int) -> Self:
        """Return the motion of so many drives.

        Raises
        ------
        MotionError
            For a wrong shape, a non-finite number, or times that do not strictly increase.
        """
        try:
            whole = np.array((position, velocity, acceleration), dtype=float)
        except (TypeError, ValueError):
            whole = np.empty(0)
        if whole.ndim == 3 and whole.shape[2] == drives and whole.size and (
                np.isfinite(whole).all()):
            q, v, a = whole
            return cls(q, v, a, checked_times(time, len(q)))
        # Something is wrong, and is named; or a row stands alone.
        q = checked_matrix('position', position, drives)
        v, a = (checked_matrix(name, values, drives, len(q)) for name, values in (
            ('velocity', velocity), ('acceleration', acceleration)))
        return cls(q, v, a, checked_times(time, len(q)))

    def held(self) -> Self:
        """Return the last position, at rest, at time 0."""
        rest = np.zeros_like(self.position[-1:])
        return replace(self, position=self.position[-1:], velocity=rest, acceleration=rest,
                       time=np.zeros(1), channels={}, kept=None)
