# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Limits of the drives, checked for motions and for forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.errors import LimitError, WorkspaceError
from pprs_dynamics.physics.mechanism.evaluation import run

LOWER, UPPER, EFFORT = 0, 1, 2  # rows of the kernel's table


@dataclass(frozen=True, eq=False)
class DriveLimits:
    """Strokes and efforts of D drives; infinite where there are none.

    Parameters
    ----------
    drives : tuple of D str
    units : tuple of D DriveUnits
    lower, upper : (D,) arrays
        Lowest and highest position of each drive [m, rad].
    efforts : (D,) array
        Largest absolute effort of each drive [N, N m].
    sources : tuple of D str
        Where the positions of each drive are limited, for a sentence.
    effort_source : str
        Where efforts are limited, for a sentence.
    """

    drives: tuple[str, ...]
    units: tuple[DriveUnits, ...]
    lower: Array
    upper: Array
    efforts: Array
    sources: tuple[str, ...]
    effort_source: str

    @property
    def strokes(self) -> tuple[Array, Array]:
        """Lowest and highest position of each drive [m, rad], (D,) each."""
        return self.lower, self.upper

    @cached_property
    def _table(self) -> Array:
        return np.array((self.lower, self.upper, self.efforts), dtype=float)

    def with_efforts(self, effort: Sequence[float]) -> DriveLimits:
        """Return these limits with the smaller of two limits on every drive's effort."""
        return replace(self, efforts=np.minimum(self.efforts, effort))

    def clamped(self, forces: Array) -> Array:
        """Return efforts, (N, D), moved to the limit where they are over it."""
        return np.clip(forces, -self.efforts, self.efforts)

    def allow(self, forces: Array, drive_motion: tuple[Array, ...]) -> bool:
        """Return whether all is finite, and neither a stroke nor an effort is exceeded.

        In a tenth of the time of `check_strokes` and `check_efforts`, which name what is exceeded.

        Parameters
        ----------
        forces : (N, D) array
            [N, N m].
        drive_motion : three (N, D) arrays
            Position, velocity and acceleration; all of it C-contiguous.
        """
        return bool(run(_are_allowed, forces, *drive_motion, self._table))

    def check_strokes(self, positions: Array) -> None:
        """Raise WorkspaceError for the first drive position, (N, D), outside its stroke."""
        lower, upper = self.strokes
        outside = ~((positions >= lower) & (positions <= upper))
        if np.any(outside):
            sample, drive = (int(i) for i in np.argwhere(outside)[0])
            unit = self.units[drive].position
            raise WorkspaceError(
                sample,
                f'{self.drives[drive]} would have to be at {positions[sample, drive]:.6g} {unit}',
                f'{self.sources[drive]} is [{lower[drive]:g}, {upper[drive]:g}] {unit}')

    def check_efforts(self, forces: Array) -> None:
        """Raise LimitError for the first effort, (N, D), over its limit."""
        over = ~(np.abs(forces) <= self.efforts)
        if np.any(over):
            sample, drive = (int(i) for i in np.argwhere(over)[0])
            raise LimitError(sample, self.drives[drive], float(forces[sample, drive]),
                             float(self.efforts[drive]), self.units[drive].effort,
                             self.effort_source)


def _are_allowed(forces: Any, position: Any, velocity: Any, acceleration: Any, limits: Any) -> bool:
    """Return whether all is finite and within a table of LOWER, UPPER and EFFORT, (3, D)."""
    for s in range(len(forces)):
        for i in range(limits.shape[1]):
            force, q = forces[s, i], position[s, i]
            # 0 times infinity or NaN is NaN.
            if not (0.0 * force + 0.0 * velocity[s, i] + 0.0 * acceleration[s, i] == 0.0
                    and limits[LOWER, i] <= q <= limits[UPPER, i]
                    and abs(force) <= limits[EFFORT, i]):
                return False
    return True
