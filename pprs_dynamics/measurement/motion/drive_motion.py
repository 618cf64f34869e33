# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The smooth motion of the drives at the samples of a recording, and which samples make a block."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MotionError
from pprs_dynamics.measurement.motion import differentiation
from pprs_dynamics.measurement.motion.sampling_grid import SamplingGrid, find_grid
from pprs_dynamics.measurement.motion.treatment import (
    block_duration,
    block_length,
    motion_bandwidth,
)
from pprs_dynamics.system.plain_text import counted

# Readers of files take a while to import, and a live node reads none.
if TYPE_CHECKING:
    from pprs_dynamics.measurement.files.recording import Recording

# Where fewer blocks than this share of the measured samples' have an effort in every sample,
# efforts come less often than positions, and blocks are single samples.
SPARSE_EFFORTS = 0.5


@dataclass(frozen=True)
class DriveMotion:
    """N samples in one or more segments, without edges; drives (N, D).

    Parameters
    ----------
    position, velocity, acceleration : (N, D) arrays
        Smoothed [m, m/s, m/s^2].
    index : (N,) int array
        The samples' places in the recording.
    segments : tuple of slice
        Of the N samples.
    block_starts : (M,) int array
        First sample of every block.
    block : int
        Samples per block, in the longest segment.
    smoothing : Smoothing
    grids : tuple of SamplingGrid
        Of the segments.
    from_recorded : (2, D) bool array
        Drives whose velocity, and those whose acceleration, come from recorded velocities.
    notes : tuple of str
    """

    position: Array
    velocity: Array
    acceleration: Array
    index: np.ndarray
    segments: tuple[slice, ...]
    block_starts: np.ndarray
    block: int
    smoothing: differentiation.Smoothing
    grids: tuple[SamplingGrid, ...]
    from_recorded: np.ndarray
    notes: tuple[str, ...]


def smooth_drives(recording: Recording, blocks_per_period: float = 0.0, unit: str = 'm',
                  ) -> DriveMotion:
    """Return the motion of a recording's drives, with one window for all of them.

    Parameters
    ----------
    recording : Recording
    blocks_per_period : float
        See `block_duration`.
    unit : str
        Of positions, for the notes.

    Raises
    ------
    MotionError
        Where no segment is long enough.
    """
    if recording.are_poses:
        return _held_poses(recording)
    segments = [part for part in recording.segments
                if part.stop - part.start > 2 * differentiation.SHORTEST_WINDOW]
    if not segments:
        raise MotionError(
            'recording', f'its {len(recording.segments)} segments have at most '
            f'{max((s.stop - s.start for s in recording.segments), default=0)} samples',
            f'have more than {2 * differentiation.SHORTEST_WINDOW} without a gap', 'shape')
    grids, told = _grids(recording, segments)
    stretches = differentiation.representative([
        _stretch(recording, part, grid) for part, grid in zip(segments, grids, strict=True)])
    smoothing = differentiation.choose_smoothing(stretches, unit)
    recorded = differentiation.better_recorded(stretches, smoothing)
    notes = [smoothing.text, *told, *_velocity_notes(recording, recorded)]

    duration = block_duration(motion_bandwidth(stretches, smoothing) if blocks_per_period
                              else 0.0, blocks_per_period)
    duration = _mean_over(recording, segments, grids, duration, notes)
    count, index, spans, blocks, used = 0, [], [], [], []
    for part, grid in zip(segments, grids, strict=True):
        filter_ = smoothing.polynomial(grid.step)
        kept, starts = _blocks(grid, filter_.half, block_length(grid.step, duration))
        if len(starts):
            blocks.append(count + starts)
            index.append(np.arange(part.start + kept.start, part.start + kept.stop))
            spans.append(slice(count, count := count + len(index[-1])))
            used.append(grid)
    if not used:
        raise MotionError(
            'recording', f'its longest segment has {max(s.stop - s.start for s in segments)} '
            'samples', f'have more than {filter_.window}, one smoothing window', 'shape')
    longest, none = used[int(np.argmax(list(map(len, index))))], np.zeros(0)
    motion = DriveMotion(
        none, none, none, np.concatenate(index), tuple(spans), np.concatenate(blocks),
        block_length(longest.step, duration), smoothing, tuple(used), recorded, tuple(notes))
    q, q_dot, q_ddot = smoothed_as(motion, recording, lambda position: position)
    if np.any(recorded):
        assert recording.velocity is not None
        # A spline through NaN of one drive would take the others with it.
        v, v_dot, _ = smoothed_as(motion, replace(recording, position=np.where(
            recorded.any(axis=0), recording.velocity, 0.0)), lambda velocity: velocity)
        q_dot, q_ddot = np.where(recorded[:, None], (v, v_dot), (q_dot, q_ddot))
    return replace(motion, position=q, velocity=q_dot, acceleration=q_ddot)


def _held_poses(recording: Recording) -> DriveMotion:
    """Return poses that are held, a block each, as motion without velocity and acceleration.

    Static friction is the same in all samples of a pose: they are no more than one measurement.
    """
    parts = recording.segments
    index = np.concatenate([np.arange(part.start, part.stop) for part in parts])
    position = np.concatenate([np.broadcast_to(
        recording.position[part].mean(axis=0), recording.position[part].shape) for part in parts])
    lengths, still = np.array([part.stop - part.start for part in parts]), np.zeros_like(position)
    firsts = np.cumsum(lengths) - lengths
    noise = np.std(recording.position[index] - position, axis=0)
    step = float(np.median(np.diff(recording.time[index])))
    return DriveMotion(
        position, still, still, index, (slice(0, len(index)),),
        firsts, int(lengths.max()),
        differentiation.Smoothing(0.0, noise, 0 * noise, 0 * noise, ''),
        (SamplingGrid(step, np.arange(len(index), dtype=float)),),
        np.zeros((2, position.shape[1]), dtype=bool), ())


def smoothed_again(motion: DriveMotion, recording: Recording,
                   made: Callable[[Array], Array]) -> DriveMotion:
    """Return a motion smoothed over the window that suits its positions.

    Bursts of an encoder that is not where its drive is shorten the window that suits what it
    reads, and lengthen it where they look like noise.

    Parameters
    ----------
    motion : DriveMotion
        Whose velocities and accelerations from recorded velocities stay.
    recording, made
        See `smoothed_as`.
    """
    if not motion.smoothing.duration:  # poses that are held
        return replace(motion, position=made(motion.position))
    smoothing = differentiation.choose_smoothing(differentiation.representative([
        differentiation.Stretch(made(grid.at_steps(recording.position[part])), grid.step)
        for grid, part in zip(motion.grids, _segments_of(motion, recording), strict=True)]))
    q, q_dot, q_ddot = smoothed_as(motion, recording, made, smoothing)
    from_velocity, from_acceleration = motion.from_recorded
    return replace(motion, position=q, smoothing=smoothing,
                   velocity=np.where(from_velocity, motion.velocity, q_dot),
                   acceleration=np.where(from_acceleration, motion.acceleration, q_ddot))


def smoothed_as(motion: DriveMotion, recording: Recording, made: Callable[[Array], Array],
                smoothing: differentiation.Smoothing | None = None) -> tuple[Array, Array, Array]:
    """Return values made of positions, and their rates, (N, D) each, smoothed as positions are.

    Parameters
    ----------
    motion : DriveMotion
        Whose samples are taken.
    recording : Recording
    made : callable
        Takes the positions of a segment at equal steps, (n, D), and returns as many.
    smoothing : Smoothing, optional
        Other than the motion's, which stays at the ends of segments that a longer window does not
        reach.
    """
    if not motion.smoothing.duration:  # poses that are held
        values = made(recording.position[motion.index])
        return values, np.zeros_like(values), np.zeros_like(values)
    parts = []
    for span, grid, part in zip(motion.segments, motion.grids, _segments_of(motion, recording),
                                strict=True):
        first = int(motion.index[span.start]) - part.start
        kept = slice(first, int(motion.index[span.stop - 1]) + 1 - part.start)
        values = made(grid.at_steps(recording.position[part]))
        if not np.any(values):
            parts.append([np.zeros((kept.stop - kept.start, *values.shape[1:]))] * 3)
            continue
        filter_, ends = (window.polynomial(grid.step)
                         for window in (smoothing or motion.smoothing, motion.smoothing))
        reached = grid.inside(filter_.half)
        inside = slice(max(kept.start, reached.start), min(kept.stop, reached.stop))
        if inside == kept:
            parts.append(_differentiated(values, grid, filter_, kept))
            continue
        rates = [rate.copy() for rate in _differentiated(values, grid, ends, kept)]
        if inside.start < inside.stop:
            for rate, better in zip(rates, _differentiated(values, grid, filter_, inside),
                                    strict=True):
                rate[inside.start - first:inside.stop - first] = better
        parts.append(rates)
    q, q_dot, q_ddot = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return q, q_dot, q_ddot


def _differentiated(values: Array, grid: SamplingGrid, filter_: differentiation.LocalPolynomial,
                    samples: slice) -> list[Array]:
    """Return values at equal steps, and their rates, at the samples of a recording."""
    return [grid.at_samples(rate, filter_.half, samples) for rate in filter_.differentiated(values)]


def _segments_of(motion: DriveMotion, recording: Recording) -> list[slice]:
    """Return the segments of a recording that those of a motion are of."""
    firsts = [int(motion.index[span.start]) for span in motion.segments]
    return [next(part for part in recording.segments if part.start <= first < part.stop)
            for first in firsts]


def _grids(recording: Recording, segments: Sequence[slice]) -> tuple[list[SamplingGrid], list[str]]:
    grids, sayings = [], []
    for part in segments:
        grid, told = find_grid(recording.time[part], recording.position[part])
        grids.append(grid)
        if told:
            sayings.append(f'from {recording.time[part.start]:.6g} s: {told}')
    most = 5
    if len(sayings) > most:
        sayings[most:] = [f'{len(sayings) - most} more segments have such stamps']
    return grids, sayings


def _stretch(recording: Recording, part: slice, grid: SamplingGrid) -> differentiation.Stretch:
    velocity = None
    if recording.velocity is not None:
        # A drive with a velocity that is missing anywhere is not considered; a spline through
        # NaN would take the others with it.
        known = recording.velocity[part]
        complete = np.isfinite(known).all(axis=0)
        velocity = grid.at_steps(np.where(complete, known, 0.0))
        velocity = np.where(complete, velocity, np.nan)
    return differentiation.Stretch(grid.at_steps(recording.position[part]), grid.step, velocity)


def _velocity_notes(recording: Recording, recorded: np.ndarray) -> list[str]:
    if recording.velocity is None or np.all(np.isnan(recording.velocity)):
        return []
    notes = []
    for quantity, better in zip(('velocities', 'accelerations'), recorded, strict=True):
        names = ', '.join(drive for drive, yes in zip(recording.drives, better, strict=True) if yes)
        if names:
            notes.append(f'{quantity} of {names} come from recorded velocities: they have less '
                         'than half the mean squared error of differentiated positions')
    return notes or ['recorded velocities are not used: they are not clearly better than '
                     'differentiated positions']


def _mean_over(
    recording: Recording, segments: Sequence[slice], grids: Sequence[SamplingGrid],
    duration: float, notes: list[str],
) -> float:
    """Return the duration of blocks [s], 0 for single samples where efforts are too sparse."""
    measured = whole = 0
    for part, grid in zip(segments, grids, strict=True):
        known = np.isfinite(recording.effort[part])
        block = block_length(grid.step, duration)
        measured += int(known.sum())
        count = len(known) // block * block
        whole += block * int(known[:count].reshape(-1, block, known.shape[1]).all(axis=1).sum())
    if measured and whole < SPARSE_EFFORTS * measured:
        notes.append('efforts come less often than positions: single samples are compared, '
                     'without a mean')
        return 0.0
    block = block_length(grids[0].step, duration)
    notes.append(f'effort and model are both averaged over blocks of {counted(block, "sample")}. A '
                 'block with a missing effort does not count')
    return duration


def _blocks(grid: SamplingGrid, edge: int, block: int) -> tuple[slice, np.ndarray]:
    """Return the samples of whole blocks, and the first of each block counted from there."""
    kept = grid.inside(edge)
    if kept.stop - kept.start < block:
        return kept, np.array([], dtype=np.int64)
    # Blocks are of equal time: one in which a sample is lost has one less. A stamp that is
    # early by rounding still belongs to its own block.
    number = np.floor((grid.places[kept] - grid.places[kept.start]) / block + 1e-6)
    starts = np.flatnonzero(np.diff(number, prepend=-1.0))
    if len(number) - starts[-1] < block:
        kept, starts = slice(kept.start, kept.start + int(starts[-1])), starts[:-1]
    return kept, starts
