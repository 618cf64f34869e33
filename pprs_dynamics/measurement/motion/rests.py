# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Rests of drives: static friction makes their efforts arbitrary within its limits."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array

SHORTEST_REST = 0.5  # [s]; reversals of a motion are over sooner
GLANCE = 0.1  # [s] over which speeds are taken to tell motion from rest
NORMAL_MEDIAN = 0.6745  # of standard deviations: median size of what is normally distributed
RESOLVED = 4.0  # steps, or deviations of the noise, of a measured position, that are no motion
SLOW_SHARE = 0.2  # of a drive's own fast speed: a slower one is a rest


def rest_speeds(position: Array, step: float, speed: float) -> Array:
    """Return the speed below which each drive stands, (D,): less for a drive that is always slow.

    Parameters
    ----------
    position : (N, D) array
        Of one segment [rad, m].
    step : float
        Between samples [s].
    speed : float
        Of a drive that also moves faster [rad/s, m/s].
    """
    window = max(1, round(SHORTEST_REST / step))
    if len(position) <= window:
        return np.full(position.shape[1], speed)
    moved = np.abs(position[window:] - position[:-window])
    fast = np.quantile(moved, 0.95, axis=0)
    is_motion = fast > 2 * RESOLVED * resolution(position)
    found: Array = np.where(is_motion, np.minimum(speed, SLOW_SHARE * fast / SHORTEST_REST), speed)
    return found


def find_rests(position: Array, step: float, speed: float | Array) -> np.typing.NDArray[np.bool_]:
    """Return where each drive stands, (N, D).

    Parameters
    ----------
    position : (N, D) array
        Of one segment [rad, m].
    step : float
        Between samples [s].
    speed : float or (D,) array
        A drive stands that moves less than this, in the mean over `SHORTEST_REST` [rad/s, m/s].
    """
    # Here and not above: only arms need it, and it takes long to import.
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    window = max(2, round(SHORTEST_REST / step))
    if len(position) < window:
        return np.zeros(position.shape, dtype=bool)
    span = (maximum_filter1d(position, window, axis=0, mode='nearest')
            - minimum_filter1d(position, window, axis=0, mode='nearest'))
    # Every sample of such a window stands, not its middle alone.
    return maximum_filter1d(span < speed * SHORTEST_REST, window, axis=0, mode='nearest')


def share_in_motion(time: Array, position: Array, moving: float = 0.0) -> float:
    """Return the share of a recording in which some drive moves.

    Parameters
    ----------
    time : (N,) array
        [s]
    position : (N, D) array
        [m, rad]
    moving : float, optional
        Share of its highest speed above which a drive moves; always by more than `resolution`.
    """
    if len(time) < 2:
        return 0.0
    # From sample to sample an encoder's steps look like motion; over a tenth of a second not.
    span = max(1, round(GLANCE / float(np.median(np.diff(time)))))
    step, moved = np.diff(time[::span]), np.diff(position[::span], axis=0)
    if not len(step):
        return 0.0
    speed = np.abs(moved) / step[:, None]
    least = RESOLVED * resolution(position) / step[:, None]
    return float(np.mean(np.any(speed > np.maximum(moving * speed.max(axis=0), least), axis=1)))


def resolution(position: Array) -> Array:
    """Return how finely positions (N, D) are measured, (D,): an encoder's step, or the noise."""
    steps = np.abs(np.diff(position, axis=0))
    finest = np.min(np.where(steps > 0, steps, np.inf), axis=0, initial=np.inf)
    # Third differences of a motion are small, those of white noise have 20 times its variance;
    # their median, as a gap of the recording is a jump in it.
    noise = (np.median(np.abs(np.diff(position, 3, axis=0)), axis=0) / (NORMAL_MEDIAN * 20 ** 0.5)
             if len(position) > 3 else np.zeros_like(finest))
    return np.maximum(np.where(np.isfinite(finest), finest, 0.0), noise)
