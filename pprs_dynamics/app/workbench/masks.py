# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Marked samples, scatter plots and the robot's motion, as the workbench draws them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pprs_dynamics.app.report.charts import extremes
from pprs_dynamics.app.workbench.tick_fits import TickFits
from pprs_dynamics.app.workbench.ticks import SessionError, Ticks
from pprs_dynamics.app.workbench.view_state import Share, ViewState
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError
from pprs_dynamics.physics.model.skeleton import Skeleton

Mask = NDArray[np.bool_]
"""Samples and drives that are meant, (M, D)."""

EFFORTS = ('measured', 'error before', 'error now')
MOST_SPANS = 200  # of time, in which samples of a mask lie
MOST_POINTS = 20_000  # of a scatter
SHORT = 5  # samples between two spans that count as one
MOST_POSES = 600  # of the robot in motion


def span_mask(ticks: Ticks, start: float, end: float, drives: Sequence[str] | None = None) -> Mask:
    """Return the samples between two times [s], on some drives or all."""
    time = ticks.fits.design.residuals.time
    return ((time >= start) & (time <= end))[:, None] & _on(ticks, drives)


def region_mask(ticks: Ticks, x: str, y: str, x_range: tuple[float, float],
                y_range: tuple[float, float], drive: str) -> Mask:
    """Return a drive's samples in a region of the scatter of two quantities."""
    on = _on(ticks, [drive])
    inside = np.ones(len(ticks.fits.before), bool)
    for name, span in ((x, x_range), (y, y_range)):
        values = quantity(ticks.fits, ticks.view, name, int(np.argmax(on)))
        inside &= (values >= min(span)) & (values <= max(span))
    return inside[:, None] & on


def spans_of(data: Residuals, mask: Mask) -> list[tuple[float, float]]:
    """Return the times [s] in which a mask's samples lie, the longest first."""
    at = np.flatnonzero(mask.any(axis=1))
    if not len(at):
        return []
    cuts = np.flatnonzero(np.diff(at) > SHORT) + 1
    parts = [part for part in np.split(at, cuts) if len(part)]
    parts.sort(key=len, reverse=True)
    return [(float(data.time[part[0]]), float(data.time[part[-1]])) for part in parts[:MOST_SPANS]]


def quantity(fits: TickFits, view: ViewState, name: str, drive: int) -> Array:
    """Return anything that may be drawn over anything, as a drive sees it, (M,).

    Raises
    ------
    ResidualsError
        For an unknown name.
    """
    data = fits.design.residuals
    table = {'measured': fits.measured, 'error before': fits.before, 'error now': view.residual}
    found = table[name][:, drive] if name in table else data.variable(name, drive)
    if found is None:
        raise ResidualsError('variable', f'{name!r} is not known',
                             f'be one of {", ".join(quantities(data))}')
    return found


def quantities(data: Residuals) -> list[str]:
    """Return the names of the quantities that can be plotted."""
    return ['time', *(name for name in data.variables), *EFFORTS]


def drawn_samples(x: Array, y: Array) -> NDArray[np.int_]:
    """Return the samples of a scatter that are drawn: as dense as all, and every peak of both."""
    if len(x) <= MOST_POINTS:
        return np.arange(len(x))
    evenly = np.arange(0, len(x), -(-2 * len(x) // MOST_POINTS))
    return np.union1d(evenly, extremes(x, y, points=MOST_POINTS // 4))


def shares_in(mask: Mask, fits: TickFits, view: ViewState) -> list[Share]:
    """Return the share of the squared error that each unticked effect explains, largest first.

    Raises
    ------
    ResidualsError
        For a mask of another shape.
    """
    if mask.shape != fits.measured.shape:
        raise ResidualsError('mask', f'its shape is {mask.shape}',
                             f'be {fits.measured.shape}, samples by drives')
    chosen = mask & np.isfinite(fits.measured)
    left = float(np.sum(fits.residual(view.free)[chosen] ** 2))
    shares = []
    for offer in view.offers:
        after = float(np.sum(offer.residual[chosen] ** 2, dtype=float))
        explained = 1 - after / left if left > 0 else 0.0
        paid = max(offer.evidence, 0.0) / offer.gain if offer.gain > 0 else 0.0
        shares.append(Share(offer.candidate.name, fits.design.named(offer.candidate.drives),
                            explained, explained * paid))
    return sorted(shares, key=lambda share: (-share.net, -share.explained))


def _on(ticks: Ticks, drives: Sequence[str] | None) -> Mask:
    known = ticks.fits.drives
    for name in drives or ():
        if name not in known:
            raise SessionError(f'unknown drive {name!r}, must be one of {", ".join(known)}')
    return np.array([[drives is None or name in drives for name in known]])


def robot_motion(ticks: Ticks) -> tuple[Skeleton, dict[str, Array]]:
    """Return F poses of all recordings, one after the other.

    Returns
    -------
    drawn : Skeleton
    arrays : dict of str to array
        `time` of the residuals (F,) [s], the `points` of the skeleton, and the error of the drives
        `before` and `now`, (F, D): rms over the samples until the next pose [N].
    """
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
