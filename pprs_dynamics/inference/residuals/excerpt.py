# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A few hundred samples of a recording, smoothed, and the forces of a model on them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.residuals.reconstruction import follow
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.drive_motion import DriveMotion, smooth_drives
from pprs_dynamics.measurement.motion.treatment import Treatment
from pprs_dynamics.physics.model.drive_model import DriveModel

LONGEST = 2000  # samples of a stretch that are smoothed: 4 s at 500 Hz
MOST_BLOCKS = 100  # of a stretch that are kept: a hundredth of a second each, evenly thinned
PIECE = 10  # blocks that are followed together where a whole stretch cannot be


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
    velocity : (N, D) array or None
        As recorded [m/s].
    """

    motion: DriveMotion
    time: Array
    effort: Array
    velocity: Array | None


def excerpt_of(recording: Recording, stretches: int, time_unit: float = 1.0) -> Excerpt | None:
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
    chosen = sorted({round(place) for place in np.linspace(0, len(windows) - 1, stretches)})
    scaled = replace(
        recording, time=recording.time * time_unit, segments=tuple(windows[k] for k in chosen))
    try:
        smooth = smooth_drives(scaled)
    except PprsError:
        return None
    treat = Treatment(smooth.block_starts, len(smooth.index))
    kept: list[int] = []
    segments: list[slice] = []
    for segment in smooth.segments:
        first, last = np.searchsorted(treat.starts, (segment.start, segment.stop))
        step = max(1, (last - first) // MOST_BLOCKS)
        segments.append(slice(len(kept), len(kept) + len(range(first, last, step))))
        kept += range(first, last, step)

    def means(values: Array) -> Array:
        return treat(values)[kept]

    motion = replace(
        smooth, position=means(smooth.position), velocity=means(smooth.velocity),
        acceleration=means(smooth.acceleration), index=smooth.index[treat.starts[kept]],
        segments=tuple(segments))
    velocity = None if recording.velocity is None else means(recording.velocity[smooth.index])
    return Excerpt(motion, means(scaled.time[smooth.index, None])[:, 0],
                   means(recording.effort[smooth.index]), velocity)


def forces_on(model: DriveModel, motion: DriveMotion, time: Array) -> Array | None:
    """Return the model's forces on a motion of the drives, (N, D) [N]; None where it has none.

    That the mechanism cannot follow a motion says as much as its forces: nothing is raised.
    """
    moved = replace(motion, position=motion.position - model.position_error(motion.position))
    found = np.empty_like(motion.position)
    with np.errstate(all='ignore'):
        try:
            followed = follow(model, time, moved)
            for part in motion.segments:
                state = model.initial_state()
                stretch = followed[part].with_time(time[part])
                found[part] = model.measured(model.drive_forces(stretch, state), state).total
        except (PprsError, np.linalg.LinAlgError):
            return None
    return found if np.all(np.isfinite(found)) else None
