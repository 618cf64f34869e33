# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Closure and energies of the 3-PPRS from points and distances alone, and differences of them.

Nothing here knows rod angles, Jacobians or reactions: rods are thin rods between two points.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

UP = np.array([0.0, 0.0, 1.0])


def chain_vectors(geometry):
    """Return e_i and n_i, (3, 3) each: chains, components."""
    c, s, zero = np.cos(geometry.chain_angles), np.sin(geometry.chain_angles), np.zeros(3)
    return np.stack((c, s, zero), axis=1), np.stack((-s, c, zero), axis=1)


def platform_points(geometry):
    """Return the spherical joints in the platform frame, (3, 3): chains, components."""
    angles = np.asarray(geometry.platform_angles)
    return geometry.platform_radius * np.stack(
        (np.cos(angles), np.sin(angles), np.zeros(3)), axis=1)


def closure(geometry, q, P, turn):
    """Return Eq. (3) from its text: n_i . (A_i - C_i), then (|A_i - C_i|^2 - l^2) / (2 l).

    `turn` is a rotation vector in the base frame.
    """
    e, n = chain_vectors(geometry)
    A = P + Rotation.from_rotvec(turn).apply(platform_points(geometry))
    C = geometry.base_radius * e + q[:3, None] * n + q[3:, None] * UP
    rod, l = A - C, geometry.rod_length  # noqa: E741
    return np.concatenate((np.sum(rod * n, axis=1), (np.sum(rod * rod, axis=1) - l * l) / (2 * l)))


def rod_ends(geometry, motion):
    """Return positions and velocities of A_i and C_i, (N, 3, 3) each: A, v_A, C, v_C."""
    e, n = chain_vectors(geometry)
    rotation = Rotation.from_quat(motion.orientation).as_matrix()
    arms = np.einsum('njk,ik->nij', rotation, platform_points(geometry))
    A = motion.position[:, None] + arms
    v_A = motion.linear_velocity[:, None] + np.cross(motion.angular_velocity[:, None], arms)
    span = geometry.base_radius - np.einsum('nij,ij->ni', A, e)
    rise = np.sqrt(geometry.rod_length ** 2 - span ** 2)
    if geometry.elbow == 'down':
        rise = -rise
    along = np.einsum('nij,ij->ni', A, n)
    C = (geometry.base_radius * e + along[..., None] * n + (A[..., 2] - rise)[..., None] * UP)
    # The rod keeps its length: (A - C) . (v_A - v_C) = 0 gives the lift's velocity.
    v_C = np.einsum('nij,ij->ni', v_A, n)[..., None] * n
    rod = A - C
    climb = np.sum(rod * (v_A - v_C), axis=-1) / rod[..., 2]
    return A, v_A, C, v_C + climb[..., None] * UP


def drive_motion(geometry, motion):
    """Return drive positions and velocities, (N, 6) each."""
    _, n = chain_vectors(geometry)
    _, _, C, v_C = rod_ends(geometry, motion)
    return tuple(np.concatenate((np.einsum('nij,ij->ni', x, n), x[..., 2]), axis=1)
                 for x in (C, v_C))


def moved(motion, change):
    """Return a pose displaced by a small twist: translation and turn in the base frame."""
    from pprs_dynamics import PlatformMotion

    turn = Rotation.from_rotvec(change[3:]) * Rotation.from_quat(motion.orientation[0])
    return PlatformMotion.at_rest(motion.position[0] + change[:3], turn.as_quat()[None])


def central_difference(function, size, step=1e-4):
    """Return the derivative with respect to `size` small displacements, to O(step^4)."""
    columns = []
    for displacement in step * np.eye(size):
        near = function(displacement) - function(-displacement)
        far = function(2 * displacement) - function(-2 * displacement)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)
