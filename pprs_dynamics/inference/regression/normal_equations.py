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
from pprs_dynamics.inference.regression.base_columns import BaseColumn

# Rounds until the coefficients at their limits are known, and those in which all change at once.
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
    """The Gaussian prior of all coefficients of a fit, steeper beyond limits.

    Parameters
    ----------
    precision : (P, P) array
    mean : (P,) array
    log_det : float
        Of the precision.
    limits : (2, P) array
        From the mean, below 0 and above.
    beyond : (P,) array
        What the precision has more beyond them, about the limit.
    """

    precision: Array
    mean: Array
    log_det: float
    limits: Array
    beyond: Array

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
        limits, beyond = np.repeat([[-np.inf], [np.inf]], count, axis=1), np.zeros(count)
        for k, column in enumerate(columns):
            limits[:, k], beyond[k] = column.limits, column.beyond
        return cls(precision, mean, log_det, limits, beyond)

    def posterior(self, gram: Array, side: Array) -> Posterior:
        """Return the posterior of coefficients, given X^T S^-1 X and X^T S^-1 y.

        A coefficient beyond a limit is held back by a prior that is much steeper there.

        Parameters
        ----------
        gram : (P, P) array
        side : (P,) array
        """
        if not len(side):
            return Posterior(self.mean, gram, 0.0, 0.0)
        b = side - gram @ self.mean
        lower, upper = self.limits
        steeper, about = np.zeros(len(b)), np.zeros(len(b))  # than the prior; about which limit
        open_prior = gram + self.precision
        diagonal = np.diag(open_prior) * (1 + 1e-12)  # of Cholesky's factor rounding is as small
        for number in range(MOST_LIMITED):
            np.einsum('ii->i', open_prior)[:] = diagonal + steeper
            factor, minor = dpotrf(open_prior)
            if minor:
                raise np.linalg.LinAlgError(f'minor {minor} of the normal equations is negative')
            away = dpotrs(factor, b + steeper * about)[0]
            within = np.clip(away, lower, upper)
            now = np.where(away == within, 0.0, self.beyond)
            changed = np.flatnonzero((now != steeper) | ((now > 0) & (within != about)))
            if not len(changed):
                break
            # All at once may come back to where they were; one at a time ends (Murty).
            changed = changed if number < ALL_AT_ONCE else changed[:1]
            steeper[changed], about[changed] = now[changed], within[changed]
        else:
            raise np.linalg.LinAlgError('coefficients with limits did not settle')
        upper_factor = dpotri(factor)[0]  # 0 below the diagonal, as the factor is
        covariance = upper_factor + upper_factor.T
        np.einsum('ii->i', covariance)[:] = np.einsum('ii->i', upper_factor)
        penalty = float(away @ self.precision @ away + steeper @ (away - about) ** 2)
        log_det = 2 * float(np.log(np.einsum('ii->i', factor)).sum())
        log_det += self._both_sides(away, np.einsum('ii->i', covariance), steeper > 0)
        return Posterior(self.mean + away, covariance, penalty, log_det - self.log_det)

    def _both_sides(self, away: Array, variance: Array, is_beyond: np.typing.NDArray[np.bool_],
                    ) -> float:
        """Return the correction of -2 ln of the integral for coefficients with limits.

        The prior of such a coefficient is one Gaussian within its limits and a narrower one beyond,
        so that its posterior is, too. The determinant is that of the side on which its mode lies,
        as if it went on there; integrated is over both sides of the nearer limit, each with the
        probability that its own Gaussian has there. Else the cost would have a step where a mode
        passes a limit.
        """
        k = np.flatnonzero(np.isfinite(self.limits).any(axis=0))
        (lower, upper), more = self.limits[:, k], self.beyond[k]
        is_above = upper - away[k] < away[k] - lower
        limit = np.where(is_above, upper, -lower)
        mode, variance, is_beyond = np.where(is_above, 1, -1) * away[k], variance[k], is_beyond[k]
        # Of the coefficient alone, the others as they are: its Gaussian within, and beyond.
        precise = 1 / variance - more * is_beyond
        steep = precise + more
        pulled = mode / variance - more * limit * is_beyond
        within, outside = pulled / precise, (pulled + more * limit) / steep
        # By how much the least of the steep parabola lies above that of the other one.
        above = more * precise / steep * (within - limit) ** 2
        inner = log_ndtr((limit - within) * np.sqrt(precise))
        outer = log_ndtr((outside - limit) * np.sqrt(steep)) - (
            above + np.log(steep / precise)) / 2
        total = -2 * np.logaddexp(inner, outer) - is_beyond * (above + np.log(steep / precise))
        return float(total.sum())


@dataclass(frozen=True)
class Posterior:
    """Coefficients given a noise: mean, covariance, c'Lc of the prior, and ln det (H + L) / L."""

    coefficients: Array
    covariance: Array
    penalty: float
    log_det: float


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
    """The normal equations of all drives: band sums of columns with each other and the error.

    Those of a drive are its base columns, then its blocks in order; drives with fewer columns have
    empty ones as well, whose coefficient is one after the last.

    Parameters
    ----------
    columns : sequence of BaseColumn
    base_index : mapping of drive to int array
        Places of those that a drive feels.
    base_products : mapping of drive to (B, K + 1, K + 1) array
        Of these and the error with each other.
    blocks : sequence of Block
    products : callable
        Returns products of pairs of blocks, and of each with the base and the error (None), from
        the blocks that a drive feels and the drive.
    """

    def __init__(self, columns: Sequence[BaseColumn], base_index: Mapping[int, Integers],
                 base_products: Mapping[int, Array], blocks: Sequence[Block],
                 products: Callable[[Sequence[Block], int],
                                    Mapping[tuple[Block, Block | None], Array]]) -> None:
        self.prior = Prior.of(columns, blocks)
        ends = accumulate((block.size for block in blocks), initial=len(columns))
        self.places = {block: slice(end, end + block.size)
                       for block, end in zip(blocks, ends, strict=False)}
        acting = {d: [block for block in blocks if d in block.rows] for d in base_index}
        most = max(len(index) + sum(block.size for block in acting[d])
                   for d, index in base_index.items())
        bands, self._count = len(next(iter(base_products.values()))), len(self.prior.mean)
        self.index = np.full((len(base_index), most), self._count)
        self.squares = np.stack([base[:, -1, -1] for base in base_products.values()])
        gram = np.zeros((len(base_index), bands, most, most))
        self.side = np.zeros((len(base_index), bands, most))
        for k, (d, index) in enumerate(base_index.items()):
            first, base = len(index), base_products[d]
            self.index[k, :first] = index
            gram[k, :, :first, :first] = base[:, :-1, :-1]
            self.side[k, :, :first] = base[:, :-1, -1]
            rows = dict[Block | None, slice]({None: slice(0, first)})
            for block in acting[d]:
                rows[block] = slice(first, first := first + block.size)
                self.index[k, rows[block]] = np.arange(
                    self.places[block].start, self.places[block].stop)
            for (one, other), product in products(acting[d], d).items():
                if other is None:
                    self.side[k, :, rows[one]] = product[:, :, -1]
                    product = product[:, :, :-1]
                gram[k, :, rows[one], rows[other]] = product
                gram[k, :, rows[other], rows[one]] = product.transpose(0, 2, 1)
        self._flat = gram.reshape(len(gram), bands, -1)
        self._pairs = ((self._count + 1) * self.index[:, :, None] + self.index[:, None, :]).reshape(
            len(gram), -1)

    def weighted(self, weights: Array) -> tuple[Array, Array]:
        """Return X^T S^-1 X and X^T S^-1 y of all drives, for weights (D, B)."""
        weights, size = weights[:, None, :], self._count + 1
        gram, side = (np.bincount(
            index.ravel(), (weights @ of_bands).ravel(), length).astype(float, copy=False)
            for index, of_bands, length in ((self._pairs, self._flat, size ** 2),
                                            (self.index, self.side, size)))
        return gram.reshape(size, size)[:-1, :-1], side[:-1]

    def uncertainty(self, spectra: Array) -> Array:
        """Return the reported covariance (P, P) of coefficients, under noise spectra (D, B).

        A tolerance +-a says nothing of where within it a number lies: a variance of a^2 / 3 (Guide
        to the Expression of Uncertainty in Measurement, 4.3.7). The fit takes less, so that few
        lie beyond.
        """
        limits, precision = self.prior.limits, self.prior.precision.copy()
        k = np.flatnonzero(np.isfinite(limits).all(axis=0))
        precision[k, k] *= 3 / limits[1, k] ** 2
        H = self.weighted(1 / spectra)[0] + precision
        scale = 1 / np.sqrt(np.diag(H))
        covariance: Array = np.linalg.inv(H * np.outer(scale, scale)) * np.outer(scale, scale)
        return covariance

    def solve(self, spectra: Array, counts: Array) -> Solution:
        """Return the solution under noise spectra (D, B)."""
        weights = 1 / spectra
        found = self.prior.posterior(*self.weighted(weights))
        squares = self.left(found.coefficients)
        deviance = float(np.sum(counts * np.log(spectra) + squares * weights)
                         + found.penalty + found.log_det)
        return Solution(found.coefficients, found.covariance, deviance, squares)

    def left(self, coefficients: Array) -> Array:
        """Return the sums of squares that coefficients leave in the bands of drives, (D, B)."""
        c = np.append(coefficients, 0.0)[self.index]
        gram = self._flat.reshape(*self.side.shape, c.shape[1])
        explained = (gram @ c[:, None, :, None])[..., 0]
        left: Array = self.squares + ((explained - 2 * self.side) @ c[:, :, None])[..., 0]
        return np.maximum(left, 1e-12 * self.squares)

    def leverage(self, covariance: Array, spectra: Array) -> Array:
        """Return the degrees of freedom spent in the bands of all drives, (D, B)."""
        spent: Array = (self._flat @ np.pad(covariance, (0, 1)).reshape(-1)[
            self._pairs][:, :, None])[..., 0] / spectra
        return spent
