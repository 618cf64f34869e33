# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Order and spacing of stamps: resets, disorder, duplicates, gaps, lost samples.

Each function looks at times, (N,), within `starts`: the first samples of the stretches that are
already known to be apart. Thresholds are relative to the stretch's own median step.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices, Mask

# A stamp that goes back is late if the clock is ahead again within this many samples and it is
# late by less than this [s]; otherwise the clock was set back. Sorting the latter would mix two
# stretches of motion.
MOST_LATE_SAMPLES = 10
MOST_LATE_TIME = 1.0
# With fewer samples than this from one setting back to the next, on average, no stretch of motion
# is left between them: the rows were shuffled, and are all sorted.
LEAST_BETWEEN_RESETS = 50
# Longer than this many median steps: samples are missing. Below 2, which is one lost sample, and
# above what jitter makes.
LOST_STEPS = 1.5
MOST_LOST = 1e12  # samples that are counted as lost in one step
# Longer than this many median steps and longer than this time [s]: nothing is known in between.
# A cubic through 20 ms of a 3 Hz motion of 50 mm errs by (2 pi 3 0.02)^4/384 50 mm = 3 um, about
# the resolution of an encoder; longer gaps cannot be interpolated.
GAP_STEPS = 2.5
GAP_TIME = 0.02
# Steps that are this much longer than the median in a twentieth of all vary by jitter: gaps are
# longer than some of those.
USUAL, JITTER, JITTER_STEPS = 0.95, 1.8, 2.5
# Steps that are no whole number of medians, by this part of one, in a twentieth of all: no clock
# sent samples that were lost.
WHOLE = 0.25
# Differences of stamps that are floats may be this much off, relatively.
STAMP_ROUNDING = 1e-6
# The middle 90 % of the steps spread over more than this part of the median: irregular.
IRREGULAR_SPREAD = 0.5


def stretches(numbers: Indices) -> list[slice]:
    """Return the stretches of samples, which have the same number each, as slices."""
    edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist(), len(numbers)]
    return [slice(first, end) for first, end in pairwise(edges) if end > first]


def runs(mask: Mask) -> list[tuple[int, int]]:
    """Return the runs of a mask as (first, last)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def clock_resets(time: Array) -> Indices:
    """Return the first sample after each setting back of the clock; none in shuffled rows."""
    resets: list[int] = []
    highest, seen = -np.inf, 0
    for k in np.flatnonzero(np.diff(time) < 0).tolist():
        highest = max(highest, float(time[seen:k + 1].max()))
        seen = k + 1
        ahead = time[k + 1:k + 2 + MOST_LATE_SAMPLES]
        catches_up = bool(np.any(ahead >= highest)) or len(time) <= k + 2 + MOST_LATE_SAMPLES
        if not catches_up or highest - float(ahead[0]) > MOST_LATE_TIME:
            resets.append(k + 1)
            highest = -np.inf
        if len(resets) > max(2, len(time) // LEAST_BETWEEN_RESETS):
            return np.array([], dtype=np.int64)
    return np.array(resets, dtype=np.int64)


def late_samples(time: Array, numbers: Indices) -> Mask:
    """Return which stamps lie before an earlier sample's of the same stretch."""
    late = np.zeros(len(time), dtype=bool)
    for part in stretches(numbers):
        late[part] = time[part] < np.maximum.accumulate(time[part])
    return late


def gaps(time: Array, part: slice) -> tuple[Indices, Indices, int]:
    """Return the steps of a stretch that are gaps, those with lost samples, and how many lost.

    A step is named by its second sample. A long step that a short neighbour makes up for is a
    late stamp, not a lost sample, and of samples without a regular clock none is lost.
    """
    steps = np.diff(time[part])
    if len(steps) < 2:
        nothing = np.array([], dtype=np.int64)
        return nothing, nothing, 0
    step = float(np.median(steps))
    longest = max(GAP_STEPS * step, GAP_TIME)
    usual = float(np.quantile(steps, USUAL))
    is_irregular = usual > JITTER * step
    if is_irregular:  # steps that vary much are no gaps
        longest = max(longest, JITTER_STEPS * usual)
    gap = steps > longest * (1 + STAMP_ROUNDING)
    # Damaged stamps may be as far off as numbers reach.
    counts = np.minimum(steps, MOST_LOST * step) / step
    is_irregular |= bool(np.quantile(np.abs(counts - np.rint(counts)), USUAL) > WHOLE)
    padded = np.concatenate(([step], steps, [step]))
    not_made_up = np.minimum(padded[:-2], padded[2:]) + steps > (LOST_STEPS + 1) * step
    lost = (steps > LOST_STEPS * step) & not_made_up & ~gap & (not is_irregular)
    return (part.start + 1 + np.flatnonzero(gap), part.start + 1 + np.flatnonzero(lost),
            int(np.sum(np.rint(counts[lost]) - 1)))
