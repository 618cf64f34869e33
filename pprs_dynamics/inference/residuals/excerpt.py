# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A few hundred samples of a recording, smoothed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.drive_motion import DriveMotion, smooth_drives
from pprs_dynamics.measurement.motion.treatment import Treatment

LONGEST = 1000  # samples of a stretch that are smoothed: 2 s at 500 Hz
MOST_BLOCKS = 200  # that are kept, of a hundredth of a second each, evenly thinned


@dataclass(frozen=True)
class Excerpt:
    """Means over N short blocks of a recording.

    Parameters
    ----------
    motion : DriveMotion
        Position, velocity and acceleration of the drives, (N, D) [m, m/s, m/s^2].
    time : (N,) array
        [s]
    effort : (N, D) array
        [N]; NaN where it was not measured.
    """

    motion: DriveMotion
    time: Array
    effort: Array

    def slower(self, unit: float) -> Excerpt:
        """Return the same samples with a unit of time so many times as long."""
        motion = replace(self.motion, velocity=self.motion.velocity / unit,
                         acceleration=self.motion.acceleration / unit ** 2)
        return replace(self, motion=motion, time=self.time * unit)


def excerpt_of(recording: Recording, stretches: int, time_unit: float = 1.0,
               ) -> Excerpt | None:
    """Return an excerpt; None where no stretch is long enough.

    Parameters
    ----------
    recording : Recording
    stretches : int
        How many are taken at most, evenly over the recording.
    time_unit : float
        Unit of its times [s].
    """
    windows = [slice(first, min(first + LONGEST, part.stop)) for part in recording.segments
               for first in range(part.start, part.stop, LONGEST)
               if min(first + LONGEST, part.stop) - first >= LONGEST // 10
               or part.stop - part.start < LONGEST]
    if not windows:
        return None
    count = MOST_BLOCKS if recording.are_poses else stretches
    chosen = sorted({round(place) for place in np.linspace(0, len(windows) - 1, count)})
    scaled = replace(
        recording, time=recording.time * time_unit, segments=tuple(windows[k] for k in chosen))
    try:
        smooth = smooth_drives(scaled)
    except PprsError:
        return None
    treat = Treatment(smooth.block_starts, len(smooth.index))
    step = max(1, len(treat) // MOST_BLOCKS)
    kept: list[int] = []
    segments: list[slice] = []
    for segment in smooth.segments:
        first, last = np.searchsorted(treat.starts, (segment.start, segment.stop))
        segments.append(slice(len(kept), len(kept) + len(range(first, last, step))))
        kept += range(first, last, step)

    def means(values: Array) -> Array:
        return treat(values)[kept]

    motion = replace(
        smooth, position=means(smooth.position), velocity=means(smooth.velocity),
        acceleration=means(smooth.acceleration), index=smooth.index[treat.starts[kept]],
        segments=tuple(segments))
    return Excerpt(motion, means(scaled.time[smooth.index, None])[:, 0],
                   means(recording.effort[smooth.index]))
