# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motions of the platform of which six coordinates are Fourier series from rest to rest."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.joint_series import JointSeries
from pprs_dynamics.physics.mechanism.motion import PlatformMotion


def platform_motion(series: JointSeries, time: Array) -> PlatformMotion:
    """Return the motion of x, y, z [m] and of turns about z, the new y, the new x [rad].

    Velocities and accelerations are exact.

    Parameters
    ----------
    series : JointSeries
        Of the six coordinates in this order.
    time : (N,) array
        [s]
    """
    from scipy.spatial.transform import Rotation  # commands without it start sooner

    moved = series.motion(time)
    psi, theta, _ = moved.position[:, 3:].T
    zero, one = np.zeros_like(psi), np.ones_like(psi)
    # Axes of the three turns in `base`; the earlier turns carry the later axes along.
    axes = [np.stack(axis, axis=1) for axis in (
        (zero, zero, one), (-np.sin(psi), np.cos(psi), zero),
        (np.cos(psi) * np.cos(theta), np.sin(psi) * np.cos(theta), -np.sin(theta)))]
    about_z, about_y, about_x = (
        rate[:, None] * axis for rate, axis in zip(moved.velocity[:, 3:].T, axes, strict=True))
    epsilon = (np.cross(about_z, about_y) + np.cross(about_z + about_y, about_x) + sum(
        gain[:, None] * axis for gain, axis in zip(
            moved.acceleration[:, 3:].T, axes, strict=True)))
    return PlatformMotion(
        moved.position[:, :3], Rotation.from_euler('ZYX', moved.position[:, 3:]).as_quat(),
        moved.velocity[:, :3], about_z + about_y + about_x, moved.acceleration[:, :3], epsilon,
        time)
