# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What to draw of an effect: the error with it taken out of the model again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, FoundEffect
from pprs_dynamics.inference.diagnosis.statements import UNITS
from pprs_dynamics.inference.residuals.profiles import Profile, bin_edges, bin_of, error_profile
from pprs_dynamics.inference.residuals.residuals import Residuals

FINE_BINS = 24
# Of the variance of an effect, what means over bins of a variable must tell to draw it along it.
TELLING = 0.5
SPAN = 5.0  # [s], of what is drawn over time


@dataclass(frozen=True)
class PartialResidual:
    """One drive's error with one effect taken out of the model again.

    Parameters
    ----------
    drive : int
        Where the effect is strongest.
    error, force : (M,) array
        That error, and the effect [N].
    profile : Profile or None
        Of the error, along `variable`; None where no variable explains much of the effect.
    variable : str
    fitted : (K,) array
        Mean force of the effect in the bins of the profile [N].
    span : slice
        Samples in which the effect is large.
    """

    drive: int
    error: Array
    force: Array
    profile: Profile | None
    variable: str
    fitted: Array
    span: slice


def partial_residual(diagnosis: Diagnosis, effect: FoundEffect, remaining: Array,
                     ) -> PartialResidual:
    """Return what the recordings say of one effect when all others are in the model.

    `remaining` is the residual of the row of the effect, (M, D) [N].
    """
    drive = int(np.argmax(np.sqrt(np.mean(effect.force ** 2, axis=0))))
    force = effect.force[:, drive]
    without = with_error(diagnosis.residuals, remaining + effect.force)
    variable, share = _most_telling(without, drive, force)
    profile, fitted = None, np.zeros(0)
    noise = diagnosis.noise.get(without.drives[drive])
    if share > TELLING and noise is not None:
        profile = error_profile(without, drive, variable, noise, FINE_BINS)
    if profile is not None:
        values = without.variable(variable, drive)
        assert values is not None
        fitted = _means(force, values, profile.edges)
    return PartialResidual(drive, without.error[:, drive], force, profile, variable, fitted,
                           _largest_span(without, force))


def with_error(residuals: Residuals, error: Array) -> Residuals:
    """Return residuals with another error (M, D) [N] of the same model."""
    return replace(residuals, measured=residuals.model + error, parts={})


def _most_telling(residuals: Residuals, drive: int, force: Array) -> tuple[str, float]:
    """Return the variable whose bins explain most of the variance of a force, and their share."""
    variance = float(np.var(force))
    best, most = 'time', 0.0
    for name in UNITS:
        values = residuals.variable(name, drive)
        if values is None or name == 'time' or np.ptp(values) == 0 or variance == 0:
            continue
        edges = bin_edges(values, FINE_BINS)
        means = _means(force, values, edges)
        share = float(np.nanvar(means[bin_of(values, edges)])) / variance
        if share > most:
            best, most = name, share
    return best, most


def _means(force: Array, values: Array, edges: Array) -> Array:
    place = bin_of(values, edges)
    count = np.bincount(place, minlength=len(edges) - 1)
    total = np.bincount(place, force, minlength=len(edges) - 1)
    means: Array = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
    return means


def _largest_span(residuals: Residuals, force: Array) -> slice:
    """Return the samples of `SPAN` in which a force changes most."""
    length = min(len(force), max(2, round(SPAN / residuals.period)))
    energy = np.concatenate(([0.0], np.cumsum((force - force.mean()) ** 2)))
    start = int(np.argmax(energy[length:] - energy[:-length]))
    return slice(start, start + length)
