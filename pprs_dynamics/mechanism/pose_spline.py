"""Velocities and accelerations of poses that come without, by splines through them.

Orientations are unit quaternions q, made continuous in sign, with a spline through each of
their components. At the poses themselves |q| = 1, and there omega = 2 Im(q_dot q*) and
epsilon = 2 Im(q_ddot q*): what the spline has along q is real and drops out. No Euler angle
wraps, and the ends are as good as those of the positions: a spline of rotation vectors
(scipy.spatial.transform.RotationSpline) has angular accelerations of its own choice there, and
the first point is the one that is executed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.errors import MotionError
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.robot import Array

FEWEST_POSES = 4
QUINTIC_FROM = 6  # poses; below, the splines are cubic


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
    from scipy.interpolate import make_interp_spline

    zero = np.zeros((len(np.atleast_2d(position)), 3))
    poses = PlatformMotion(position, orientation, zero, zero, zero, zero, time)
    if poses.time is None or len(poses) < FEWEST_POSES:
        raise MotionError('poses', f'{len(poses)} were given', f'be at least {FEWEST_POSES} for '
                          'velocities and accelerations', 'shape')
    quaternion = _continuous(poses.orientation)
    coordinates = np.hstack((poses.position, quaternion))
    try:
        # Absurd poses overflow, and are told by what is not finite.
        with np.errstate(all='ignore'):
            spline = make_interp_spline(
                poses.time, coordinates, k=5 if len(poses) >= QUINTIC_FROM else 3)
            first, second = (spline.derivative(order)(poses.time) for order in (1, 2))
            return _twists(first, quaternion), _twists(second, quaternion)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        unknown = np.full((len(poses), 6), np.nan)
        return unknown, unknown


def _continuous(quaternion: Array) -> Array:
    """Return the same orientations with signs such that neighbours are near each other."""
    turned = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0
    signs = np.concatenate(([1.0], np.cumprod(np.where(turned, -1.0, 1.0))))
    continuous: Array = quaternion * signs[:, None]
    return continuous


def _twists(rates: Array, quaternion: Array) -> Array:
    """Return linear rates, and twice the vector part of quaternion rate times conjugate."""
    linear, rate, rate_w = rates[:, :3], rates[:, 3:6], rates[:, 6:]
    vector, scalar = quaternion[:, :3], quaternion[:, 3:]
    angular = 2 * (scalar * rate - rate_w * vector - np.cross(rate, vector))
    return np.hstack((linear, angular))
