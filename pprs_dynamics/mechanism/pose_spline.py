"""Velocities and accelerations of poses that come without, by a spline through them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.errors import MotionError
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.robot import Array

FEWEST_POSES = 4


def spline_derivatives(
    time: ArrayLike, position: ArrayLike, orientation: ArrayLike,
) -> tuple[Array, Array]:
    """Return the twists and their derivatives on the spline of `PlatformMotion.from_poses`.

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
        Linear, then angular; NaN throughout where poses or times are so far apart that no
        spline can be computed.

    Raises
    ------
    MotionError
        For poses or times that are none.
    """
    try:
        # Absurd poses overflow, and are told by what is not finite.
        with np.errstate(all='ignore'):
            motion = PlatformMotion.from_poses(time, position, orientation)
    except MotionError as error:
        if error.quantity in ('position', 'orientation', 'time', 'poses'):
            raise
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        pass
    else:
        return (np.hstack((motion.linear_velocity, motion.angular_velocity)),
                np.hstack((motion.linear_acceleration, motion.angular_acceleration)))
    unknown = np.full((len(np.atleast_1d(time)), 6), np.nan)
    return unknown, unknown
