# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motion of drives that move what they move by themselves: a single axis, joints of an arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.motion_checks import checked_matrix, checked_times
from pprs_dynamics.physics.mechanism.pose_spline import spline_through


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
    """

    position: Array
    velocity: Array
    acceleration: Array
    time: Array | None = None
    channels: Mapping[str, Array] = field(default_factory=dict, kw_only=True)

    def __len__(self) -> int:
        return len(self.position)

    def __getitem__(self, samples: Any) -> Self:
        """Return the samples that a slice, a mask or indices select."""
        return replace(self, position=self.position[samples], velocity=self.velocity[samples],
                       acceleration=self.acceleration[samples],
                       time=None if self.time is None else self.time[samples],
                       channels={name: each[samples] for name, each in self.channels.items()})

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
                       time=np.zeros(1), channels={})


def position_spline_derivatives(time: Array, position: Array) -> tuple[Array, Array]:
    """Return velocities and accelerations of splines through positions, at the positions.

    Parameters
    ----------
    time : (N,) array
        Strictly increasing [s], at least four.
    position : (N, D) array

    Returns
    -------
    velocity, acceleration : (N, D) arrays
        NaN throughout where positions or times are so far apart that no spline can be computed.

    Raises
    ------
    MotionError
        For positions or times that are none.
    """
    places = checked_matrix('position', position, position.shape[1])
    knots = checked_times(time, len(places))
    _, velocity, acceleration = spline_through(knots, places, knots)
    return velocity, acceleration
