# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Suspicious positions, velocities and efforts: spikes, jumps, frozen and constant values."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.samples import Indices, Mask, Samples
from pprs_dynamics.measurement.files.stamps import runs

# A step of position this many times faster than 99 % of all, and than its own surroundings, is
# no motion: real motion gains speed over several samples.
JUMP_RATIO = 10.0
# Steps to either side that count as surroundings; their median survives two jumps among them.
SURROUNDINGS = 5
# A jump that is undone within this many samples is a spike; the remainder may be this part.
SPIKE_SAMPLES = 3
SPIKE_REMAINDER = 0.1
MOSTLY = 0.8  # of the steps of a position go back: messages of two publishers in turn
# Damaged rows: at most this share of the values, farther from the middle of all others than this
# many of their ranges.
FEW, FAR = 0.005, 10.0
# Sensors with any noise do not repeat all their values for so long [s], nor in so many samples.
FROZEN_TIME = 0.1
FROZEN_SAMPLES = 10
# An effort that stays the same for so long [s] while its drive visits this many positions.
STUCK_TIME = 0.5
STUCK_POSITIONS = 10
# At most so many zeros in a row are an answer that did not come, where those before and after are
# this many times as far from 0 as from each other, and as nine steps of ten are large.
ZERO_SAMPLES = 3
ZERO_RATIO = 5.0
ZERO_QUANTILE = 0.9
# The highest or lowest effort is a limit where so many samples have it, this many times as many as
# any of the next values, and while the drive moves.
CUT_SAMPLES, CUT_RATIO, CUT_BESIDE = 10, 5.0, 5
# Values that are new only every so many samples, in this share of the changes, are held. Steps of
# an encoder are no held values: most of those have one size.
HELD_CHANGES, HELD_SHARE, HELD_LEAST = 30, 0.9, 1.9


def find_jumps(samples: Samples) -> tuple[Mask, list[tuple[int, int, float]]]:
    """Return steps of position that are no motion; where the clock was set back there is none.

    Returns
    -------
    spikes : (N, D) mask
        Positions that lie apart from both their sides.
    jumps : list of (sample, drive, size)
        The first sample after each lasting jump [m].
    """
    spikes, jumps = np.zeros(samples.position.shape, dtype=bool), []
    steps = np.diff(samples.time)
    for drive in range(len(samples.drives)):
        moved = np.diff(samples.position[:, drive])
        fast = _too_fast(moved, steps)
        at = 0
        while at < len(fast):
            first = fast[at]
            # Later steps that return to where this one left.
            back = next((k for k in fast[at + 1:at + 1 + SPIKE_SAMPLES]
                         if k - first <= SPIKE_SAMPLES
                         and abs(moved[first:k + 1].sum()) < SPIKE_REMAINDER * abs(moved[first])),
                        None)
            if back is None:
                jumps.append((int(first) + 1, drive, float(moved[first])))
                at += 1
            else:
                spikes[first + 1:back + 1, drive] = True
                at = int(np.searchsorted(fast, back)) + 1
    return spikes, sorted(jumps)


def alternates(values: Array) -> bool:
    """Return whether positions (N,) are those of two motions in turn, as of two publishers."""
    steps = np.diff(values[np.isfinite(values)])
    if len(steps) < 2:
        return False
    back = np.abs(steps[1:] + steps[:-1]) < SPIKE_REMAINDER * np.abs(steps[1:])
    return bool(np.mean(back) > MOSTLY)


def far_from_the_rest(values: Array, longest: int) -> Mask:
    """Return which values, (N,), are few, short and far from the range of all others."""
    found = np.zeros(len(values), dtype=bool)
    known = values[np.isfinite(values)]
    if not len(known):
        return found
    low, high = np.quantile(known, (FEW, 1 - FEW), method='nearest')
    far = np.isfinite(values) & (np.abs(values - (low + high) / 2) > FAR * (high - low))
    if high > low and far.sum() <= FEW * len(known):
        for first, last in runs(far):
            found[first:last + 1] = last - first < longest
    return found


def frozen_runs(samples: Samples) -> list[tuple[int, int]]:
    """Return (first, last) samples between which every value of every drive is repeated.

    Only where some effort is measured: positions alone stay the same whenever a robot rests.
    """
    same = _repeats(samples.position) & _repeats(samples.effort)
    if samples.velocity is not None:
        same &= _repeats(samples.velocity)
    same &= np.any(np.isfinite(samples.effort), axis=1)[1:]
    return _lasting(samples.time, same, FROZEN_TIME)


def stuck_efforts(samples: Samples, drive: int) -> list[tuple[int, int]]:
    """Return (first, last) samples between which a drive moves and its effort stays the same."""
    effort = samples.effort[:, drive]
    same = effort[1:] == effort[:-1]
    return [(first, last) for first, last in _lasting(samples.time, same, STUCK_TIME)
            if len(np.unique(samples.position[first:last + 1, drive])) > STUCK_POSITIONS]


def lost_to_zero(effort: Array) -> tuple[Mask, float]:
    """Return the efforts, (N,), that drop out to 0, and the bound of what counts as 0.

    At most `ZERO_SAMPLES` in a row, between efforts of one sign that differ from each other by much
    less than from 0. What passes through 0, or rests there, is none. Noise counts as 0, too.
    """
    found = np.zeros(len(effort), dtype=bool)
    known = np.flatnonzero(np.isfinite(effort))
    steps = np.abs(np.diff(effort[known]))
    if not np.any(steps):
        return found, 0.0
    # Of a coarse converter most steps are 0.
    usual = float(max(np.quantile(steps, ZERO_QUANTILE), np.min(steps[steps > 0])))
    for first, last in runs(np.abs(effort) <= usual):
        before, after = np.searchsorted(known, (first, last + 1)).tolist()
        if last - first >= ZERO_SAMPLES or not 0 < before <= after < len(known):
            continue
        left, right = effort[known[before - 1]], effort[known[after]]
        far = min(abs(left), abs(right))
        if left * right > 0 and far > ZERO_RATIO * max(usual, abs(right - left)):
            found[first:last + 1] = True
    return found, usual


def cut_off(effort: Array, position: Array) -> Mask:
    """Return the efforts, (N,), at a level that clips all higher or lower ones."""
    found = np.zeros(len(effort), dtype=bool)
    levels, counts = np.unique(effort[np.isfinite(effort)], return_counts=True)
    moves = np.diff(position, prepend=position[:1]) != 0
    for level, sizes in ((levels[:1], counts[:CUT_BESIDE + 1]),
                         (levels[-1:], counts[:-CUT_BESIDE - 2:-1])):
        if len(sizes) > CUT_BESIDE and level != 0 and sizes[0] >= max(
                CUT_SAMPLES, CUT_RATIO * sizes[1:].max()):
            at = effort == level
            if 2 * np.sum(at & moves) > np.sum(at):
                found |= at
    return found


def held_for(values: Array) -> int:
    """Return for how many samples each value, (N, D), is held; 1 where that varies."""
    steps = np.diff(np.nan_to_num(values, posinf=0.0, neginf=0.0), axis=0)
    at = np.flatnonzero(np.any(steps != 0, axis=1))
    if len(at) <= HELD_CHANGES:
        return 1
    spans = np.diff(at)
    mean = float(np.mean(spans[spans <= 2 * np.median(spans)]))
    sizes = np.abs(steps[steps != 0])
    is_regular = np.mean((spans >= np.floor(mean)) & (spans <= np.ceil(mean))) > HELD_SHARE
    of_one_size = np.mean(sizes < 1.5 * sizes.min())
    return int(mean) if mean > HELD_LEAST and is_regular and of_one_size < HELD_SHARE else 1


def first_of_held(values: Array, count: int) -> Mask:
    """Return the first sample of each value, (N, D), that is held for `count` samples."""
    changed = np.concatenate(([True], np.any(values[1:] != values[:-1], axis=1)))
    place = np.arange(len(values))
    first: Mask = (place - np.maximum.accumulate(np.where(changed, place, 0))) % count == 0
    return first


def is_constant(values: Array) -> bool:
    """Return whether measured values, (N,), are there and all the same."""
    known = values[np.isfinite(values)]
    return len(known) > 1 and bool(np.all(known == known[0]))


def _too_fast(moved: Array, steps: Array) -> Indices:
    """Return the steps of a drive that no motion explains."""
    nothing = np.array([], dtype=np.int64)
    if not len(moved):
        return nothing
    # Where the clock was set back nothing is known about the speed.
    with np.errstate(over='ignore'):
        speed = np.abs(moved) / np.where(steps > 0, steps, np.inf)
    moving = speed[speed > 0]
    if not len(moving):
        return nothing
    # Lower: of few steps the 99 % point would be the jump itself.
    usual = float(np.quantile(moving, 0.99, method='lower'))
    if len(moving) == 1:
        usual = 0.0
    suspects = np.flatnonzero(speed > JUMP_RATIO * usual)
    padded = np.pad(speed, SURROUNDINGS, mode='reflect') if len(speed) > SURROUNDINGS else speed
    return np.array([k for k in suspects.tolist()
                     if speed[k] > JUMP_RATIO * np.median(padded[k:k + 2 * SURROUNDINGS + 1])],
                    dtype=np.int64)


def _repeats(values: Array) -> Mask:
    """Return which samples, from the second on, repeat all of the one before, NaN as NaN."""
    later, earlier = values[1:], values[:-1]
    same: Mask = np.all((later == earlier) | (np.isnan(later) & np.isnan(earlier)), axis=1)
    return same


def _lasting(time: Array, same: Mask, least: float) -> list[tuple[int, int]]:
    """Return (first, last) samples of runs of repeats that last some time [s]."""
    # The sample before the first repeat is the first of those that are the same.
    return [(first, last + 1) for first, last in runs(same)
            if time[last + 1] - time[first] >= least and last + 1 - first >= FROZEN_SAMPLES]
