# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forward kinematics: the platform's motion from that of the drives.

Six drive positions belong to several poses. The closures of the tree are followed from the home
pose, or from the last sample, and only poses are accepted whose determinant has the sign that it
has at home.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ConvergenceError, WorkspaceError
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.motion_checks import checked_matrix
from pprs_dynamics.physics.three_pprs.geometry import Geometry
from pprs_dynamics.physics.three_pprs.tree import structure_of


def solve_forward_motion(
    geometry: Geometry, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike,
    closed: dict[Any, Array] | None = None,
) -> PlatformMotion:
    """Return the platform's motion that belongs to a continuous motion of the drives.

    Parameters
    ----------
    geometry : Geometry
    position, velocity, acceleration : (N, 6) array_like
        q [m], q_dot [m/s], q_ddot [m/s^2] in drive order.
    closed : dict of Structure to array, optional
        Coordinates at the last sample of another motion, from which this one goes on; brought up
        to date.

    Raises
    ------
    MotionError
        For a wrong shape or a non-finite number.
    ConvergenceError
        Where no pose of the home pose's assembly mode is found.
    ModelError
        Where the geometry's home pose is itself singular.
    """
    q = checked_matrix('drive positions', position, 6)
    structure, closed = structure_of(geometry), {} if closed is None else closed
    try:
        links = LinkMotion.of(structure, q, np.asarray(velocity), np.asarray(acceleration),
                              nearby=closed.get(structure))
    except WorkspaceError as error:
        raise ConvergenceError(
            error.sample, f'no pose found for drive positions {q[error.sample].tolist()} m',
            'they must close the mechanism in the assembly mode of the home pose') from None
    m, (row, _) = links.motion, structure.links[structure.tool]
    closed[structure] = m.q[-1].copy()
    return PlatformMotion(m.p[:, row], _orientation(*(m.q[:, structure.coordinates.index(
        f'platform.{angle}')] for angle in ('yaw', 'pitch', 'roll'))),
        m.u[:, row], m.w[:, row], m.ud[:, row], m.wd[:, row])


def _orientation(yaw: Array, pitch: Array, roll: Array) -> Array:
    """Return the quaternions x, y, z, w of turns about z, then the new y, then the new x."""
    (z, y, x), (c_z, c_y, c_x) = ([turn(angle / 2) for angle in (yaw, pitch, roll)]
                                  for turn in (np.sin, np.cos))
    return np.column_stack((x * c_y * c_z - c_x * y * z, c_x * y * c_z + x * c_y * z,
                            c_x * c_y * z - x * y * c_z, c_x * c_y * c_z + x * y * z))
