# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Splines through poses, for poses that come without velocities and accelerations.

Orientations are unit quaternions, made continuous in sign, with a spline through each of their
components. Between the poses its length n is not 1; the orientation is s / n, and
omega = 2 Im(s_dot s*) / n^2, epsilon = 2 Im(s_ddot s*) / n^2 - 2 (s . s_dot) / n^2 omega. No Euler
angle wraps, and the ends are as good as those of the positions: a spline of rotation vectors
(scipy.spatial.transform.RotationSpline) has angular accelerations of its own choice there, and
the first point is the one that is executed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MotionError
from pprs_dynamics.physics.mechanism.motion_checks import checked_matrix, checked_times, normalised

FEWEST_POSES = 4
QUINTIC_FROM = 6  # points; below, the splines are cubic


def load_splines() -> None:
    """Load what `spline_derivatives` needs: half a second, that nobody else should wait for."""
    import scipy.interpolate  # noqa: F401


def spline_derivatives(
    time: ArrayLike, position: ArrayLike, orientation: ArrayLike,
) -> tuple[Array, Array]:
    """Return velocities and accelerations of splines through poses, at the poses.

    Parameters
    ----------
    time : (N,) array_like
        Strictly increasing times [s], at least four.
    position : (N, 3) array_like
        [m].
    orientation : (N, 4) array_like
        Unit quaternions x, y, z, w.

    Returns
    -------
    velocity, acceleration : (N, 6) arrays
        Linear, then angular, in `base`; NaN throughout where poses or times are so far apart
        that no spline can be computed.

    Raises
    ------
    MotionError
        For poses or times that are none, or fewer than four.
    """
    knots, places, turns = checked_poses(time, position, orientation)
    rows = spline_rows(knots, places, turns, knots)
    return rows[:, 7:13], rows[:, 13:]


def checked_poses(
    time: ArrayLike, position: ArrayLike, orientation: ArrayLike,
) -> tuple[Array, Array, Array]:
    """Return times, positions and unit quaternions of poses that a spline can go through.

    Raises
    ------
    MotionError
        For poses or times that are none, or fewer than four.
    """
    places = checked_matrix('position', position, 3)
    turns = normalised(checked_matrix('orientation', orientation, 4, len(places)))
    knots = checked_times(time, len(places))
    if len(knots) < FEWEST_POSES:
        raise MotionError('poses', f'{len(knots)} were given', f'be at least {FEWEST_POSES} for '
                          'velocities and accelerations', 'shape')
    return knots, places, turns


def spline_rows(knots: Array, position: Array, orientation: Array, at: Array) -> Array:
    """Return poses, velocities and accelerations of splines at any times, (K, 19).

    Quintic from six poses on, below that cubic.

    Parameters
    ----------
    knots : (N,) array
        Strictly increasing times of the poses [s].
    position : (N, 3) array
        [m].
    orientation : (N, 4) array
        Unit quaternions x, y, z, w.
    at : (K,) array
        [s].

    Returns
    -------
    (K, 19) array
        Columns of `PlatformMotion.rows`.

    NaN throughout where poses or times are so far apart that no spline can be computed.
    """
    place, first, second = spline_through(
        knots, np.hstack((position, _continuous(orientation))), at)
    s = place[:, 3:]
    with np.errstate(all='ignore'):
        square = np.sum(s * s, axis=1, keepdims=True)
        omega = 2 * _vector_part(first[:, 3:], s) / square
        growth = 2 * np.sum(s * first[:, 3:], axis=1, keepdims=True) / square
        epsilon = 2 * _vector_part(second[:, 3:], s) / square - growth * omega
        return np.hstack((place[:, :3], s / np.sqrt(square), first[:, :3], omega,
                          second[:, :3], epsilon))


def spline_through(knots: Array, values: Array, at: Array) -> tuple[Array, Array, Array]:
    """Return values, first and second derivatives of splines at any times, (K, D) each.

    Parameters
    ----------
    knots : (N,) array
        Strictly increasing times [s].
    values : (N, D) array
    at : (K,) array
        [s].

    NaN throughout where values or times are so far apart that no spline can be computed.
    """
    from scipy.interpolate import make_interp_spline

    try:
        with np.errstate(all='ignore'):
            spline = make_interp_spline(knots, values, k=5 if len(knots) >= QUINTIC_FROM else 3)
            return spline(at), spline.derivative(1)(at), spline.derivative(2)(at)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        unknown = np.full((len(at), values.shape[1]), np.nan)
        return unknown, unknown, unknown


def _continuous(quaternion: Array) -> Array:
    """Return quaternions with signs chosen such that neighbours are near each other."""
    turned = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0
    signs = np.concatenate(([1.0], np.cumprod(np.where(turned, -1.0, 1.0))))
    return quaternion * signs[:, None]


def _vector_part(a: Array, b: Array) -> Array:
    """Return the vector part of quaternion a times the conjugate of b, (N, 3)."""
    return b[:, 3:] * a[:, :3] - a[:, 3:] * b[:, :3] - np.cross(a[:, :3], b[:, :3])
