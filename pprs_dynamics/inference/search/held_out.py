# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The predictive test: whether data that took no part in a fit are predicted better with it.

The gain of a drive is by how much its squared error falls, whitened by the noise, so that newtons
and newton metres can be added. The noise at each frequency is the residual of the better
model. A force that one of them takes for slow noise is then not forgiven.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.joint_fit import LEAST_SAMPLES, Regression
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.candidates import CandidateSet, Component
from pprs_dynamics.inference.search.fitted_sets import FittedSets

BLOCKS = 10
# Standard errors by which held-out data must be predicted better or worse. With ten blocks, one
# wrong effect in 30 is accepted.
SURE = 2.0


@dataclass(frozen=True)
class PredictiveGain:
    """By how much one model predicts held-out data better than another, drive by drive.

    Parameters
    ----------
    drives : tuple of str
        D of them.
    gains : (B, D) array
        Whitened squared error of the first model less that of the second, in B blocks.
    sizes : (B, D) array
        Whitened squares of the difference between the two predictions.
    """

    drives: tuple[str, ...]
    gains: Array
    sizes: Array

    @cached_property
    def by_drive(self) -> Mapping[str, float]:
        """The gain of each drive in its standard errors; 0 where nothing was predicted."""
        return {drive: _in_errors(self.gains[:, d], self.sizes[:, d])
                for d, drive in enumerate(self.drives)}

    @cached_property
    def certainty(self) -> float:
        """The gain of all drives together in its standard errors."""
        return _in_errors(self.gains.sum(axis=1), self.sizes.sum(axis=1))

    @property
    def confirms(self) -> bool:
        """Whether the second model predicts better, by more than `SURE` standard errors.

        The gain of all drives together is enough, or that of one drive beyond `_among_drives`, if
        no other drive loses. A number that is not finite confirms nothing.
        """
        found = list(self.by_drive.values())
        return bool(
            np.all(np.isfinite([self.certainty, *found])) and not self.losing
            and (self.certainty > SURE or max(found, default=0.0) > self._among_drives))

    @property
    def losing(self) -> tuple[str, ...]:
        """Drives that are predicted worse, beyond the uncertainty of their gain."""
        return tuple(drive for drive, found in self.by_drive.items()
                     if found < -self._among_drives)

    @property
    def _among_drives(self) -> float:
        """What one of D drives exceeds as rarely as a single one exceeds `SURE`."""
        from scipy.special import ndtr, ndtri  # here: a command that fits nothing starts without it

        return float(-ndtri(ndtr(-SURE) / max(len(self.drives), 1)))


def _in_errors(gains: Array, sizes: Array) -> float:
    """Return the sum of gains over blocks (B,) in its standard errors.

    Of blocks in which a model changes nothing nothing is expected: the gain is a ratio estimate,
    its error what gains differ by from their share by size (W. G. Cochran, Sampling Techniques,
    3rd ed., 1977, 6.4), and no less than noise makes, with 4 |a - b|^2 the variance of
    |noise - a|^2 - |noise - b|^2. It is no less than 1 either: two predictions that differ by less
    than the noise of one coefficient are the same.
    """
    total, size, count = float(gains.sum()), float(sizes.sum()), len(gains)
    if size <= 0:
        return 0.0
    spread = count / (count - 1) * float(np.sum((gains - total / size * sizes) ** 2))
    return total / float(np.sqrt(max(4 * size, spread, 1.0)))


def sample_gains(before: Residuals, after: Residuals) -> tuple[Array, Array]:
    """Return `gains` and `sizes` of a `PredictiveGain` sample by sample, (M, D) each.

    A drive with fewer than `LEAST_SAMPLES` measurements has gains of 0.

    Parameters
    ----------
    before, after : Residuals
        Of two models on the same recordings.
    """
    # One of them may show that some efforts are of motion before their segment.
    known = np.isfinite(before.measured) & np.isfinite(after.measured)
    before, after = (replace(error, measured=np.where(known, error.measured, np.nan))
                     for error in (before, after))
    gains, sizes = np.zeros(before.error.shape), np.zeros(before.error.shape)
    counts = np.isfinite(before.measured).sum(axis=0)
    if counts.max() < LEAST_SAMPLES:
        return gains, sizes
    fits = [(regression, regression.fit(())) for regression in map(Regression, (before, after))]
    for d in fits[0][0].drives:
        series = fits[0][0].series[d]
        power = np.minimum(*(regression.noise(fit)[d].power(series.frequency)
                             for regression, fit in fits))
        first, second = (series.inverse(series.cosines(error[:, d]) / np.sqrt(power))
                         for error in (before.error, after.error))
        gains[series.index, d] = first ** 2 - second ** 2
        sizes[series.index, d] = (first - second) ** 2
    return gains, sizes


def predictive_gain(before: Residuals, after: Residuals) -> PredictiveGain:
    """Return the gain of a second model over a first on recordings that neither was fitted to."""
    edges = np.linspace(0, len(before), BLOCKS + 1).astype(int)[:-1]
    return PredictiveGain(before.drives, *(
        np.add.reduceat(values, edges, axis=0) for values in sample_gains(before, after)))


@dataclass(frozen=True)
class HeldOut:
    """A set's predictions of blocks of the recordings, each from a fit to the other blocks.

    Parameters
    ----------
    error : float
        Root of the mean square over samples and drives, reversals as the model has them [N].
    penalties : (BLOCKS,) array
        Of numbers that the fits to the other blocks move beyond their tolerances.
    residuals : Residuals
        Errors of the predictions.
    """

    error: float
    penalties: Array
    residuals: Residuals

    def gain(self, other: HeldOut) -> PredictiveGain:
        """Return the predictive gain of another set over this one."""
        found = predictive_gain(self.residuals, other.residuals)
        # Each fit pays for the numbers that it moves, all drives alike.
        share = (self.penalties - other.penalties) / (BLOCKS * len(found.drives))
        return replace(found, gains=found.gains + share[:, None])


def hold_out(fits: FittedSets, fitted: CandidateSet,
             only: Collection[Component] | None = None) -> HeldOut:
    """Return how a set predicts blocks of the recordings from the others.

    The fits to the other blocks have the priors and the noise of the whole fit.

    Parameters
    ----------
    fits : FittedSets
    fitted : CandidateSet
    only : collection of Component, optional
        Whose forces the predictions of `error` contain; by default those of all effects.
    """
    regression, fit = fits.regression, fitted.fit
    parts = regression.residuals.blocks(BLOCKS)
    others = regression.from_others(fit, parts)
    coefficients = np.stack([fit.coefficients for fit in others])
    plain = coefficients.copy()
    plain[:, [k for k, column in enumerate(fits.design.base) if not column.in_model]] = 0.0
    left_out = fitted.nuisance_blocks if only is None else [
        block for block in fit.blocks if block not in [fitted.blocks[key] for key in only]]
    plain[:, fit.index_of(left_out)] = 0.0
    left = np.full(regression.residuals.measured.shape, np.nan)
    squares, count = 0.0, 0
    for d, series in regression.series.items():
        index, transformed = regression.rows(fit, d)
        samples, rows = series.index, series.inverse(transformed)
        block = parts[samples]
        left[samples, d] = rows[-1] - np.sum(coefficients[block][:, index].T * rows[:-1], axis=0)
        rest = rows[-1] - np.sum(plain[block][:, index].T * rows[:-1], axis=0)
        squares, count = squares + float(rest @ rest), count + len(rest)
    return HeldOut(float(np.sqrt(squares / max(count, 1))),
                   np.array([other.penalty for other in others]),
                   replace(regression.residuals, measured=left, model=np.zeros_like(left),
                           parts={}, variables={}))
