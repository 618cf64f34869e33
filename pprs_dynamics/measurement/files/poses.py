# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of poses that are held: they show gravity and offsets, and no motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pprs_dynamics.arrays import Array

LEAST_POSES = 5  # of a recording of held poses
# Range of a drive that visits them [rad, m], and the share of it within which the drive stands.
LEAST_RANGE, STILL = 0.05, 3e-3
# Third differences over first ones, from which on positions are not those of one motion, and the
# duration of a pose [s], from which on no source of positions is that slow.
NO_MOTION, LONG_POSE = 1.0, 1.0
# Distance between poses over that which recorded velocities make, below which they are a motion.
FARTHER = 10.0
FEW = 34  # samples that show no motion: two of the shortest windows that derivatives are of


def held_poses(position: Array, time: Array, velocity: Array | None) -> NDArray[np.int64]:
    """Return the first sample of each pose, where poses are held throughout; none of a motion.

    A pose is one sample, as in a table that is written by hand, or several. The way from one pose
    to the next is not recorded.

    Parameters
    ----------
    position : (N, D) array
        [rad, m]
    time : (N,) array
        [s]
    velocity : (N, D) array or None
        As recorded [rad/s, m/s].
    """
    motion = np.zeros(0, dtype=np.int64)
    if len(position) < LEAST_POSES:
        return motion
    span = np.ptp(position, axis=0)
    still = np.where(span > LEAST_RANGE, STILL * span, np.inf)
    moved = np.abs(np.diff(position, axis=0)) > still
    firsts = np.concatenate([[0], np.flatnonzero(np.any(moved, axis=1)) + 1])
    lengths = np.diff(firsts, append=len(position))
    is_single = np.median(lengths) == 1
    if len(firsts) < LEAST_POSES or (not is_single and np.min(lengths) == 1):
        return motion
    drift = np.maximum.reduceat(position, firsts) - np.minimum.reduceat(position, firsts)
    poses = position[firsts][:, span > LEAST_RANGE]
    steps, third = (np.diff(poses, order, axis=0) for order in (1, 3))
    is_rough = np.any(np.std(third, axis=0) > NO_MOTION * np.std(steps, axis=0))
    lasting = float(np.median(np.diff(time[firsts])))
    if velocity is not None and np.isfinite(velocity).any() and np.median(
            np.abs(steps)) < FARTHER * lasting * np.nanmedian(np.abs(velocity)):
        return motion
    is_rough |= is_single and len(position) <= FEW
    # Two of three signs: no smooth motion, several samples each, a long time each.
    is_held = sum((bool(is_rough), not is_single, lasting >= LONG_POSE)) >= 2
    return firsts if is_held and np.all(drift < 2 * still) else motion
