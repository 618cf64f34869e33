# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stick-slip: a slow drive that stands, is loaded until it breaks away, slips, and stands again.

It is no force law of the drive alone but a relaxation oscillation of falling friction, the
stiffness before the drive and its controller (B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit,
Automatica 30 (1994) 1083). The effort distinguishes it from a motion that was meant to pause: it
builds up while the drive stands, and falls while it slips.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.system.json_records import JsonRecord

WINDOWS = (0.5, 1.0, 2.0, 4.0)  # over which a mean speed is taken, of several periods each [s]
SLOW = 0.25  # of the mean speed, from which on a drive is no longer taken for standing
# Share of a period in which a drive stays within a share of a slip's travel before the next slip:
# a wave that just comes to rest once in its period stays there for a quarter of it.
LEAST_STUCK, STANDING = 0.4, 0.02
LEAST_SLIPS = 8
REGULAR = 0.3  # spread of the periods over their median, up to which they are one oscillation
FASTEST = 0.95  # quantile of the speeds of slips that counts as the fastest
LARGEST_STEP = 0.1  # of the stroke, in a slip: longer ones are what was asked for
LEAST_STEP = 5.0  # quanta of the position in a slip: stairs of an encoder are no stick-slip


@dataclass(frozen=True)
class StickSlip(JsonRecord):
    """A relaxation oscillation of one drive.

    Parameters
    ----------
    frequency : float
        Slips per second [Hz].
    speed : float
        Largest mean speed at which it was seen [m/s, rad/s].
    step : float
        Travel of a slip [m, rad].
    slips : int
    share_of_time : float
        Share of the recording.
    """

    json_keys = ('frequency', 'speed', 'step', 'share_of_time')

    frequency: float
    speed: float
    step: float
    slips: int
    share_of_time: float


def sticking_drives(recordings: Sequence[Recording]) -> dict[str, StickSlip]:
    """Return the stick-slip of every drive that has it, that of most slips of all segments."""
    found: dict[str, StickSlip] = {}
    for recording in recordings:
        for d, drive in enumerate(recording.drives):
            for part in recording.segments:
                slip = find_stick_slip(recording.time[part], recording.position[part, d],
                                       recording.effort[part, d])
                if slip is not None and (drive not in found or slip.slips > found[drive].slips):
                    found[drive] = slip
    return found


def find_stick_slip(time: Array, position: Array, effort: Array) -> StickSlip | None:
    """Return the stick-slip of one drive, or None.

    Parameters
    ----------
    time, position, effort : (N,) arrays
        Of one segment without gaps [s; m, rad; N, N m].
    """
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    moved = np.abs(np.diff(position))
    if step <= 0 or not np.any(moved) or not np.all(np.isfinite(effort)):
        return None
    quantum = float(moved[moved > 0].min())
    found = [_within(time, position, effort, step, window, quantum) for window in WINDOWS]
    return max((s for s in found if s is not None), key=lambda s: s.slips, default=None)


def _within(time: Array, position: Array, effort: Array, step: float, window: float,
            quantum: float) -> StickSlip | None:
    half = round(window / step / 2)
    if half < 4 or len(time) < 4 * half:
        return None
    inner = slice(half, len(time) - half)
    mean = (position[2 * half:] - position[:-2 * half]) / (2 * half * step)
    velocity = np.gradient(position, step)[inner]
    moving = np.abs(mean) > LEAST_STEP * quantum / window
    stuck = moving & (velocity * np.sign(mean) < SLOW * np.abs(mean))
    slipping = moving & ~stuck
    begins = np.flatnonzero(stuck[:-1] & slipping[1:]) + 1
    direction, level, at = np.sign(mean), effort[inner], position[inner]
    # From one slip to the next in the same direction, without a turn between.
    pairs = [(a, b) for a, b in pairwise(begins)
             if np.all(direction[a:b] == direction[a]) and np.all(moving[a:b])]
    if len(pairs) < LEAST_SLIPS:
        return None
    a, b = np.array(pairs).T
    periods = (b - a) * step
    period = float(np.median(periods))
    if np.median(np.abs(periods - period)) > REGULAR * period / 2 or period > window * 1.5:
        return None
    ends = np.array([first + np.argmax(stuck[first:last]) for first, last in pairs])  # of slips
    rises, falls = ((level[to] - level[of]) * direction[a] for of, to in ((ends, b - 1), (a, ends)))
    travels = np.abs(at[b] - at[a])
    stood = [np.mean(np.abs(at[first:last] - at[last - 1]) < STANDING * travel)
             for first, last, travel in zip(a, b, travels, strict=True)]
    travel = float(np.median(travels))
    if (not np.median(rises) > 0 > np.median(falls) or np.median(stood) < LEAST_STUCK
            or not LEAST_STEP * quantum < travel < LARGEST_STEP * np.ptp(position)):
        return None
    speed = float(np.quantile(travels / periods, FASTEST))
    return StickSlip(1 / period, speed, travel, len(pairs), float(np.sum(b - a) / len(time)))
