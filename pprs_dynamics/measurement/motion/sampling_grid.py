# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""From stamps as they are to the equal steps that differentiation needs, and back.

Positions are brought onto a grid of equal steps; the motion that comes out is taken at the
instants of the samples again. Efforts stay where they were measured: they are never interpolated.

Stamps that jitter can mean two things: the samples were taken at equal steps and stamped late
(a busy computer), or they were taken when the stamps say. The wrong reading adds noise to the
positions, of the size of jitter times velocity, so the data decide. Where jitter is too small to
matter against the noise of the positions, the steps are taken as equal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.stamps import gaps
from pprs_dynamics.measurement.motion.differentiation import (
    SHORTEST_WINDOW,
    Stretch,
    position_noise,
    representative,
)

# Jitter whose error in positions stays below this part of their noise is not looked at.
HARMLESS_JITTER = 0.3
# Interpolation between samples smooths their noise by up to a fifth, whatever the stamps mean.
CLEARLY_LESS = 0.8


@dataclass(frozen=True)
class SamplingGrid:
    """Equal steps under the n samples of a segment.

    Parameters
    ----------
    step : float
        [s].
    places : (n,) array
        Where the samples lie, in steps from the first one.
    """

    step: float
    places: Array

    @property
    def is_regular(self) -> bool:
        """Whether there is a sample at each step."""
        return bool(self.places[-1] == len(self.places) - 1 and np.all(np.diff(self.places) == 1))

    def at_steps(self, values: Array) -> Array:
        """Return values of the samples, (n, D), at equal steps: by a cubic spline."""
        if self.is_regular:
            return values
        return _spline(self.places, values, np.arange(int(self.places[-1]) + 1.0))

    def inside(self, edge: int) -> slice:
        """Return the samples that lie at least `edge` steps from both ends."""
        last = int(self.places[-1]) - edge
        return slice(int(np.searchsorted(self.places, edge)),
                     int(np.searchsorted(self.places, last, side='right')))

    def at_samples(self, values: Array, edge: int, kept: slice) -> Array:
        """Return values at equal steps without the edges, (n - 2 edge, D), at samples `kept`."""
        places = self.places[kept] - edge
        whole = places.astype(int)
        found: Array = values[whole] if np.all(places == whole) else _spline(
            np.arange(float(len(values))), values, places)
        return found


def _spline(x: Array, values: Array, at: Array) -> Array:
    """Return values (n, D) at places x (n,) between these, by a spline: cubic from four values."""
    from scipy.interpolate import make_interp_spline

    found: Array = make_interp_spline(x, values, k=min(3, len(x) - 1))(at)
    return found


def find_grid(time: Array, position: Array) -> tuple[SamplingGrid, str]:
    """Return the grid of a segment, and a remark on it ('' for none).

    Parameters
    ----------
    time : (n,) array
        Strictly increasing [s], without gaps.
    position : (n, D) array
        [m].
    """
    steps = np.diff(time)
    lost = gaps(time, slice(0, len(time)))[1]
    counts = np.ones(len(steps))
    counts[lost - 1] = np.rint(steps[lost - 1] / np.median(steps))
    places = np.concatenate(([0.0], np.cumsum(counts)))
    step = float((time[-1] - time[0]) / places[-1])
    jitter = float(np.sqrt(np.mean((steps - counts * step) ** 2) / 2))
    missing = int(places[-1]) - len(steps)
    equal = SamplingGrid(step, places)
    told = (f'{missing} lost samples are bridged by a cubic spline through the positions; their '
            'efforts stay unknown' if missing else '')

    noise = _noise(equal, position)
    speed = np.sqrt(np.mean((np.diff(position, axis=0) / steps[:, None]) ** 2, axis=0))
    if not np.any(jitter * speed > HARMLESS_JITTER * noise):
        return equal, told
    stamped = SamplingGrid(step, (time - time[0]) / step)
    as_stamped = _noise(stamped, position)
    grid, what = (stamped, 'positions are smoother when the stamps are taken as true, and are '
                  'interpolated to equal steps by a cubic spline') if (
        np.sum(as_stamped ** 2) < CLEARLY_LESS ** 2 * np.sum(noise ** 2)) else (
        equal, 'positions are no smoother when they are taken as true, so steps are taken as equal')
    return grid, '. '.join(filter(None, (
        told, f'stamps jitter by {jitter * 1e6:.3g} us rms; {what}')))


def _noise(grid: SamplingGrid, position: Array) -> Array:
    parts = representative([Stretch(grid.at_steps(position), grid.step)])
    return position_noise([part for part in parts if len(part.position) > SHORTEST_WINDOW])
