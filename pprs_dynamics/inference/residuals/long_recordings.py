# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Excerpts of recordings that are longer than what a search can hold in memory.

A search keeps some thousands of columns, a number each for every block of every drive: an hour
would take tens of gigabytes and as many minutes. Stretches contain all frequencies up to that of
the blocks, unlike longer blocks. More minutes would only reduce the uncertainty. Where a robot does
the same for hours they are chosen by how much it moves, never by how it errs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.measurement.motion.drive_motion import smooth_drives
from pprs_dynamics.measurement.motion.rests import GLANCE
from pprs_dynamics.measurement.motion.treatment import block_length
from pprs_dynamics.physics.model.drive_model import DriveModel

TOO_LONG = 'too_long'
# Blocks of all recordings together. A search takes 50 to 150 kB for each, with six drives: as many
# as the first stay whole, and take up to 2 GB; beside the samples of an hour there is room for the
# second.
MOST_WHOLE, MOST_BLOCKS = 16_000, 9_000
# Stretches of one recording, and how long they are at least [s]: slow noise, and what drifts, is
# told by long ones, what changes over hours by many.
STRETCHES, SHORTEST_STRETCH = 12, 5.0


def excerpts_within_memory(model: DriveModel, recordings: Sequence[Recording]) -> list[Recording]:
    """Return recordings of which no more is used than a search can hold.

    Their findings name the omitted part. Those that are short enough stay as they are, and so
    do excerpts.
    """
    whole = [recording for recording in recordings if not _is_excerpt(recording)]
    blocks = sum(_blocks(recording, 1) for recording in whole)
    if blocks > MOST_WHOLE and model.blocks_per_period:
        blocks = sum(_blocks(recording, _block(model, recording)) for recording in whole)
    if blocks <= MOST_WHOLE:
        return list(recordings)
    return [recording if _is_excerpt(recording) else _excerpt(recording, MOST_BLOCKS / blocks)
            for recording in recordings]


def _is_excerpt(recording: Recording) -> bool:
    return any(finding.kind == TOO_LONG for finding in recording.findings)


def _step(recording: Recording) -> float:
    part = max(recording.segments, key=lambda segment: segment.stop - segment.start)
    return float(np.median(np.diff(recording.time[part])))


def _used(recording: Recording) -> int:
    return sum(part.stop - part.start for part in recording.segments)


def _blocks(recording: Recording, times: int) -> float:
    """Return how many blocks of so many usual ones a recording has."""
    if recording.are_poses or not recording.segments:
        return float(len(recording.segments))
    return _used(recording) / (times * block_length(_step(recording)))


def _block(model: DriveModel, recording: Recording) -> int:
    """Return how many usual blocks make one of a model whose blocks follow the motion."""
    if not recording.segments:
        return 1
    length = block_length(_step(recording))
    pieces = _pieces(recording, STRETCHES * round(SHORTEST_STRETCH / _step(recording)))
    busiest = pieces[int(np.argmax(_moved(recording, pieces)))]
    try:
        smooth = smooth_drives(replace(recording, segments=(busiest,)),
                               model.blocks_per_period)
    except PprsError:
        return 1
    return max(1, smooth.block // length)


def _excerpt(recording: Recording, share: float) -> Recording:
    """Return a recording of which that share is used, in stretches where the drives move most."""
    if not recording.segments:
        return recording
    step, used = _step(recording), _used(recording)
    length = max(round(share * used / STRETCHES), round(SHORTEST_STRETCH / step))
    pieces = _pieces(recording, length)
    groups = np.array_split(np.arange(len(pieces)), max(1, round(share * len(pieces))))
    moved = _moved(recording, pieces)
    segments = [pieces[group[int(np.argmax(moved[group]))]] for group in groups]
    kept = sum(part.stop - part.start for part in segments)
    finding = Defect(TOO_LONG, used - kept,
                     f'{used * step:.0f} s at {1 / step:.4g} Hz are too many for the memory of '
                     f'a search: {len(segments)} stretches of {length * step:.3g} s, spread over '
                     'them, are fitted')
    return replace(recording, segments=tuple(segments), findings=(finding, *recording.findings))


def _pieces(recording: Recording, length: int) -> list[slice]:
    """Return the segments in pieces of a length; a remainder of half that length is one."""
    pieces = []
    for part in recording.segments:
        starts = list(range(part.start, part.stop, length))
        if len(starts) > 1 and part.stop - starts[-1] < length / 2:
            del starts[-1]
        pieces += [slice(first, min(first + length, part.stop)) for first in starts]
    return pieces


def _moved(recording: Recording, pieces: Sequence[slice]) -> Array:
    """Return how far the drives move in pieces, each by its own range of positions, summed."""
    glance = max(1, round(GLANCE / _step(recording)))
    seen = [recording.position[part][::glance] for part in pieces]
    ways = np.array([np.abs(np.diff(positions, axis=0)).sum(axis=0) for positions in seen])
    span = np.ptp(np.concatenate([np.array([positions.min(axis=0), positions.max(axis=0)])
                                  for positions in seen]), axis=0)
    total: Array = (ways / np.where(span > 0, span, np.inf)).sum(axis=1)
    return total
