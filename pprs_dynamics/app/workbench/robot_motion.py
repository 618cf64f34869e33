# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robot's joints along a recording, with the error of every drive, to be drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pprs_dynamics.app.workbench.session import Session
from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.model.skeleton import Skeleton

MOST_POSES = 600


def robot_motion(session: Session) -> tuple[Skeleton, dict[str, Array]]:
    """Return F poses of all recordings, one after the other.

    Returns
    -------
    drawn : Skeleton
    arrays : dict of str to array
        `time` of the residuals (F,) [s], the `points` of the skeleton, and the error of the drives
        `before` and `now`, (F, D): rms over the samples until the next pose [N].
    """
    ticks = session.ticks
    data = ticks.fits.design.residuals
    chosen = np.unique(np.linspace(0, len(data) - 1, MOST_POSES).astype(int))
    found: list[Skeleton] = []
    first = 0
    for reconstruction in ticks.fits.design.reconstructions:
        starts = reconstruction.treat.starts
        here = chosen[(chosen >= first) & (chosen < first + len(starts))] - first
        first += len(starts)
        if len(here):
            found.append(Skeleton.of(ticks.model, reconstruction.motion[starts[here]]))
    drawn = replace(found[0], points=np.concatenate([entry.points for entry in found]))
    return drawn, {'time': data.time[chosen], 'points': drawn.points,
                   'before': _rms_between(ticks.fits.before, chosen),
                   'now': _rms_between(ticks.view.residual, chosen)}


def _rms_between(error: Array, chosen: np.typing.NDArray[np.int_]) -> Array:
    known = np.isfinite(error)
    squares = np.add.reduceat(np.where(known, error, 0.0) ** 2, chosen, axis=0)
    counts = np.add.reduceat(known.astype(float), chosen, axis=0)
    return np.sqrt(squares / np.maximum(counts, 1.0))
