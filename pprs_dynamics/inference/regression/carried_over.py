# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a reference run says of the forces in other recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import ReferenceDirection
from pprs_dynamics.inference.regression.terms import FullRate
from pprs_dynamics.inference.residuals.bands import OpenForces
from pprs_dynamics.inference.residuals.residuals import Residuals

MOVED = 1e-4  # [m, rad], for derivatives of what is carried over by positions


@dataclass(frozen=True)
class CarriedOver:
    """What a reference run says of recordings; see `pprs_dynamics.inference.fit.reference`.

    Parameters
    ----------
    of_base : (M, D) array
        Forces that the model lacks there as well by the numbers of its base [N].
    repeating : callable
        Gives those that no number explains, (N, D), of positions and velocities (N, D) and the
        time over which they are means [s].
    directions : tuple of ReferenceDirection
        In which they are uncertain most.
    open_forces : mapping of drive to OpenForces
        In which they are uncertain beyond.
    covered : float
        Share of the samples whose states the reference knows.
    """

    of_base: Array
    repeating: Callable[[Array, Array, float], Array]
    directions: tuple[ReferenceDirection, ...]
    open_forces: Mapping[int, OpenForces]
    covered: float

    def shown(self, residuals: Residuals) -> Array:
        """Return the forces that the model lacks there as well, (M, D) [N].

        Of residuals of the same samples, whose positions may be read otherwise.
        """
        q, v = (residuals.variables[name] for name in ('position', 'velocity'))
        return self.of_base + self.repeating(q, v, residuals.period)

    def per_position(self, residuals: Residuals) -> Array:
        """Return how the forces change with the position of each drive, (D, M, D) [N/m]."""
        q, v = (residuals.variables[name] for name in ('position', 'velocity'))
        return np.stack([
            (self.repeating(q + step, v, residuals.period)
             - self.repeating(q - step, v, residuals.period)) / (2 * MOVED)
            for step in MOVED * np.eye(q.shape[1])])

    def at_full_rate(self, recordings: Sequence[FullRate], time: Array) -> list[Array]:
        """Return the forces at every sample of recordings, (N, D) [N]; `time` (M,) of means."""
        found, end = [], 0
        for recording in recordings:
            part = slice(end, end := end + len(recording.treat))
            of_base = [np.interp(recording.time, time[part], row) for row in self.of_base[part].T]
            found.append(self.repeating(recording.position, recording.velocity, 0.0)
                         + np.stack(of_base, axis=1))
        return found
