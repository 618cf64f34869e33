# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Normal equations of a joint fit, from sums of products over bands of frequency.

References
----------
K. G. Murty, Note on a Bard-type scheme for solving the complementarity problem, Opsearch 11 (1974).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs
from scipy.special import log_ndtr

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.inference.regression.base_columns import BaseColumn, ModelNumber
from pprs_dynamics.inference.regression.sensitivities import DEVIATIONS

# A tolerance is a limit: beyond it a number's prior is this many times as steep.
BEYOND_TOLERANCE = 25.0
# Rounds until the numbers at their limits are known, and those in which all change at once.
MOST_LIMITED, ALL_AT_ONCE = 200, 8


@dataclass(frozen=True, eq=False)
class Block:
    """Columns of one term, transformed, with the Gaussian prior of their coefficients.

    Parameters
    ----------
    rows : mapping of drive to (k, n) array
        DCT coefficients [N]; drives that are not in it feel nothing.
    precision : (k, k) array
        Of the prior.
    mean : (k,) array, optional
        Of the prior; by default 0.
    """

    rows: Mapping[int, Array]
    precision: Array
    mean: Array | None = None

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.precision)

    @cached_property
    def log_det(self) -> float:
        """Logarithm of the determinant of the precision."""
        return float(np.linalg.slogdet(self.precision)[1])


def term_gains(S: Array, b: Array, precision: Array, mean: Array) -> Array:
    """Return by how much the deviance falls with each of n terms, (n,).

    Parameters
    ----------
    S : (n, k, k) array
        Whitened sums of products of the rows, less what is fitted already.
    b : (n, k) array
        Whitened sums of products with the residual.
    precision : (n, k, k) array
        Of the prior.
    mean : (n, k) array
        Of the prior.
    """
    # At the mean of the prior, and from there on.
    at_mean = np.einsum('nkj,nj->nk', S, mean)
    gained = np.sum((2 * b - at_mean) * mean, axis=1)
    b = b - at_mean
    posterior = (S + S.transpose(0, 2, 1)) / 2 + precision
    # What is fitted already can take all of a row, to rounding; then only the prior is left.
    floor = 1e-6 * np.einsum('nkk->nk', precision)
    diagonal = np.einsum('nkk->nk', posterior)
    np.einsum('nkk->nk', posterior)[:] = np.maximum(diagonal, floor)
    scale = 1 / np.sqrt(np.einsum('nkk->nk', posterior))
    scaled = posterior * scale[:, :, None] * scale[:, None, :]
    values, axes = (np.linalg.eigh(scaled) if b.shape[1] > 1
                    else (scaled[:, :, 0], np.ones_like(scaled)))
    kept = values > 1e-7
    along = np.einsum('nkj,nk->nj', axes, b * scale)
    quadratic = np.sum(np.where(kept, along ** 2 / np.where(kept, values, 1.0), 0.0), axis=1)
    log_det = (np.sum(np.log(np.maximum(values, 1e-7)), axis=1) - 2 * np.sum(np.log(scale), axis=1)
               - np.linalg.slogdet(precision)[1])
    gains: Array = gained + quadratic - log_det
    return gains


@dataclass(frozen=True)
class Prior:
    """The Gaussian prior of all coefficients of a fit, steeper beyond a tolerance.

    Parameters
    ----------
    precision : (P, P) array
    mean : (P,) array
    log_det : float
        Of the precision.
    limited : (P,) bool array
        Numbers with a tolerance.
    """

    precision: Array
    mean: Array
    log_det: float
    limited: np.typing.NDArray[np.bool_]

    @classmethod
    def of(cls, columns: Sequence[BaseColumn], blocks: Sequence[Block]) -> Prior:
        """Return the prior of base columns, then of blocks in order."""
        first = np.array([column.precision for column in columns])
        at = len(first)
        count = at + sum(block.size for block in blocks)
        precision, mean = np.zeros((count, count)), np.zeros(count)
        precision[np.arange(at), np.arange(at)] = first
        log_det = float(np.log(first).sum()) + sum(block.log_det for block in blocks)
        for block in blocks:
            place = slice(at, at + block.size)
            precision[place, place] = block.precision
            if block.mean is not None:
                mean[place] = block.mean
            at += block.size
        limited = np.zeros(count, dtype=bool)
        limited[:len(columns)] = [isinstance(column, ModelNumber) for column in columns]
        return cls(precision, mean, log_det, limited)

    def posterior(self, gram: Array, side: Array, beyond: Array | None = None) -> Posterior:
        """Return the posterior of coefficients, given X^T S^-1 X and X^T S^-1 y.

        A number beyond its tolerance is held back by a prior that is much steeper there.

        Parameters
        ----------
        gram : (P, P) array
        side : (P,) array
        beyond : (P,) array, optional
            Where numbers are tried first, see `Posterior`; there is one solution.
        """
        if not len(side):
            return Posterior(self.mean, gram, 0.0, 0.0, side)
        b = side - gram @ self.mean
        beyond = np.zeros(len(b)) if beyond is None else beyond.copy()
        open_prior = gram + self.precision
        diagonal = np.diag(open_prior) * (1 + 1e-12)  # of Cholesky's factor rounding is as small
        for number in range(MOST_LIMITED):
            np.einsum('ii->i', open_prior)[:] = diagonal + BEYOND_TOLERANCE * np.abs(beyond)
            factor, minor = dpotrf(open_prior)
            if minor:
                raise np.linalg.LinAlgError(f'minor {minor} of the normal equations is negative')
            away = dpotrs(factor, b + BEYOND_TOLERANCE * DEVIATIONS * beyond)[0]
            now = np.sign(away) * (self.limited & (np.abs(away) > DEVIATIONS))
            changed = np.flatnonzero(now != beyond)
            if not len(changed):
                break
            # All at once may come back to where they were; one at a time ends (Murty).
            changed = changed if number < ALL_AT_ONCE else changed[:1]
            beyond[changed] = now[changed]
        else:
            raise np.linalg.LinAlgError('numbers with a tolerance did not settle')
        upper = dpotri(factor)[0]  # 0 below the diagonal, as the factor is
        covariance = upper + upper.T
        np.einsum('ii->i', covariance)[:] = np.einsum('ii->i', upper)
        penalty = float(away @ self.precision @ away + BEYOND_TOLERANCE * np.sum(
            np.abs(beyond) * (np.abs(away) - DEVIATIONS) ** 2))
        log_det = 2 * float(np.log(np.einsum('ii->i', factor)).sum())
        log_det += self._both_sides(away, np.einsum('ii->i', covariance), beyond)
        return Posterior(self.mean + away, covariance, penalty, log_det - self.log_det, beyond)

    def _both_sides(self, away: Array, variance: Array, beyond: Array) -> float:
        """Return the correction of -2 ln of the integral for numbers with a tolerance.

        The prior of such a number is one Gaussian within its tolerance and a narrower one beyond,
        so that its posterior is, too. The determinant is that of the side on which its mode lies,
        as if it went on there; integrated is over both sides, each with the probability that its
        own Gaussian has there. Else the cost would have a step where a mode passes a tolerance.
        """
        k = np.flatnonzero(self.limited)
        mode, variance, is_beyond = np.abs(away[k]), variance[k], beyond[k] != 0
        # Of the number alone, the others as they are: its Gaussian within, and beyond.
        precise = 1 / variance - BEYOND_TOLERANCE * is_beyond
        steep = precise + BEYOND_TOLERANCE
        pulled = mode / variance - BEYOND_TOLERANCE * DEVIATIONS * is_beyond
        within, outside = pulled / precise, (pulled + BEYOND_TOLERANCE * DEVIATIONS) / steep
        # By how much the least of the steep parabola lies above that of the other one.
        above = BEYOND_TOLERANCE * precise / steep * (within - DEVIATIONS) ** 2
        inner = log_ndtr((DEVIATIONS - within) * np.sqrt(precise))
        outer = log_ndtr((outside - DEVIATIONS) * np.sqrt(steep)) - (
            above + np.log(steep / precise)) / 2
        more = -2 * np.logaddexp(inner, outer) - is_beyond * (above + np.log(steep / precise))
        return float(more.sum())


@dataclass(frozen=True)
class Posterior:
    """Coefficients given a noise: mean, covariance, c'Lc of the prior, and ln det (H + L) / L.

    `beyond` is +-1 for numbers beyond their tolerance, else 0.
    """

    coefficients: Array
    covariance: Array
    penalty: float
    log_det: float
    beyond: Array


class DriveEquations:
    """Band sums of one drive's columns with each other and with the error.

    Columns are those of the base, then of the blocks in order.

    Parameters
    ----------
    base : (B, K + 1, K + 1) array
        Of the columns of the base and the error with each other.
    acting : sequence of Block
        With rows on the drive.
    products : mapping of (Block, Block or None) to array
        Of pairs of blocks, and of each with the base and the error (None).
    """

    def __init__(self, base: Array, acting: Sequence[Block],
                 products: Mapping[tuple[Block, Block | None], Array]) -> None:
        count, first = base.shape[0], base.shape[1] - 1
        size = first + sum(block.size for block in acting)
        gram = np.empty((count, size, size))
        side = np.empty((count, size))
        gram[:, :first, :first] = base[:, :-1, :-1]
        side[:, :first] = base[:, :-1, -1]
        places = dict(zip(acting, accumulate((block.size for block in acting), initial=first),
                          strict=False))
        for (a, b), product in products.items():
            rows = slice(places[a], places[a] + a.size)
            if b is None:
                gram[:, rows, :first] = product[:, :, :-1]
                gram[:, :first, rows] = product[:, :, :-1].transpose(0, 2, 1)
                side[:, rows] = product[:, :, -1]
            else:
                other = slice(places[b], places[b] + b.size)
                gram[:, rows, other] = product
                gram[:, other, rows] = product.transpose(0, 2, 1)
        self.gram, self.side, self.squares = gram, side, base[:, -1, -1]
        self._flat = gram.reshape(count, -1)

    def weighted(self, weights: Array) -> tuple[Array, Array]:
        """Return X^T S^-1 X and X^T S^-1 y."""
        size = self.gram.shape[1]
        return (weights @ self._flat).reshape(size, size), weights @ self.side

    def left(self, coefficients: Array) -> Array:
        """Return the sums of squares that coefficients leave in the bands, (B,)."""
        explained = self.gram @ coefficients
        left: Array = self.squares - 2 * self.side @ coefficients + explained @ coefficients
        return np.maximum(left, 1e-12 * self.squares)

    def leverage(self, covariance: Array, weights: Array) -> Array:
        """Return the degrees of freedom spent in the bands, (B,), by a flat covariance."""
        spent: Array = weights * (self._flat @ covariance)
        return spent


@dataclass(frozen=True, eq=False)
class Solution:
    """A fit at some noise.

    Parameters
    ----------
    coefficients : (P,) array
        Of the base columns, then of the blocks in order.
    covariance : (P, P) array
    deviance : float
        See `joint_fit`.
    squares : (D, B) array
        Sums of squares of the residual in the bands [N^2].
    """

    coefficients: Array
    covariance: Array
    deviance: float
    squares: Array


class NormalEquations:
    """The normal equations of all drives.

    Parameters
    ----------
    columns : sequence of BaseColumn
    base_index : mapping of drive to int array
        Places of those that a drive feels.
    blocks : sequence of Block
    equations : callable
        Returns those of a drive and the blocks that it feels.
    """

    def __init__(self, columns: Sequence[BaseColumn], base_index: Mapping[int, Integers],
                 blocks: Sequence[Block],
                 equations: Callable[[int, tuple[Block, ...]], DriveEquations]) -> None:
        self.prior = Prior.of(columns, blocks)
        place = len(columns)
        self.places: dict[Block, slice] = {}
        for block in blocks:
            self.places[block] = slice(place, place + block.size)
            place += block.size
        self.drives: list[DriveEquations] = []
        self.indices: list[Integers] = []
        self._pairs: list[Integers] = []  # of these, in a flat (P, P) array
        self._beyond: Array | None = None  # of the solution before
        for d, index in base_index.items():
            acting = tuple(block for block in blocks if d in block.rows)
            self.drives.append(equations(d, acting))
            self.indices.append(np.concatenate([index, *(
                np.arange(self.places[block].start, self.places[block].stop) for block in acting)]))
            self._pairs.append(np.add.outer(place * self.indices[-1], self.indices[-1]).ravel())

    def weighted(self, weights: Array) -> tuple[Array, Array]:
        """Return X^T S^-1 X and X^T S^-1 y of all drives, for weights (D, B)."""
        gram, side = np.zeros_like(self.prior.precision), np.zeros(len(self.prior.mean))
        for k, (drive, index, pairs) in enumerate(zip(
                self.drives, self.indices, self._pairs, strict=True)):
            products, with_error = drive.weighted(weights[k])
            gram.reshape(-1)[pairs] += products.reshape(-1)
            side[index] += with_error
        return gram, side

    def uncertainty(self, spectra: Array) -> Array:
        """Return the reported covariance (P, P) of coefficients, under noise spectra (D, B).

        A tolerance +-a says nothing of where within it a number lies: a variance of a^2 / 3 (Guide
        to the Expression of Uncertainty in Measurement, 4.3.7). The fit takes less, so that few
        lie beyond.
        """
        precision = self.prior.precision * np.where(
            np.diag(self.prior.limited), 3 / DEVIATIONS ** 2, 1.0)
        H = self.weighted(1 / spectra)[0] + precision
        scale = 1 / np.sqrt(np.diag(H))
        covariance: Array = np.linalg.inv(H * np.outer(scale, scale)) * np.outer(scale, scale)
        return covariance

    def solve(self, spectra: Array, counts: Array) -> Solution:
        """Return the solution under noise spectra (D, B)."""
        weights = 1 / spectra
        found = self.prior.posterior(*self.weighted(weights), self._beyond)
        self._beyond = found.beyond
        squares = np.stack([drive.left(found.coefficients[index])
                            for drive, index in zip(self.drives, self.indices, strict=True)])
        deviance = float(np.sum(counts * np.log(spectra) + squares * weights)
                         + found.penalty + found.log_det)
        return Solution(found.coefficients, found.covariance, deviance, squares)

    def leverage(self, covariance: Array, spectra: Array) -> Array:
        """Return the degrees of freedom spent in the bands of all drives, (D, B)."""
        return np.stack([
            drive.leverage(covariance.reshape(-1)[pairs], weights) for drive, pairs, weights
            in zip(self.drives, self._pairs, 1 / spectra, strict=True)])
