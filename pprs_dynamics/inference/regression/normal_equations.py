# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Normal equations of a joint fit, from sums of products over bands of frequency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import BaseColumn, KnownNumber
from pprs_dynamics.inference.regression.sensitivities import DEVIATIONS

# A tolerance is a limit: beyond it a number's prior is this many times as steep.
BEYOND_TOLERANCE = 25.0
MOST_LIMITED = 12  # rounds until the numbers at their limits are known


@dataclass(frozen=True, eq=False)
class Block:
    """Columns of one term, transformed, with the prior of their coefficients.

    Parameters
    ----------
    rows : mapping of drive to (k, n) array
        DCT coefficients [N]; drives that are not in it feel nothing.
    precision : (k, k) array
        Of the Gaussian prior about 0.
    is_fixed : bool
        True where the only row has the coefficient 1.
    """

    rows: Mapping[int, Array]
    precision: Array
    is_fixed: bool = False

    @property
    def size(self) -> int:
        """Number of coefficients that are fitted."""
        return 0 if self.is_fixed else len(self.precision)


def term_gains(S: Array, b: Array, precision: Array, is_fixed: bool) -> Array:
    """Return by how much the deviance falls with each of n terms, (n,).

    Parameters
    ----------
    S : (n, k, k) array
        Whitened sums of products of the rows, less what is fitted already.
    b : (n, k) array
        Whitened sums of products with what is left.
    precision : (n, k, k) array
        Of the prior.
    is_fixed : bool
        True where the coefficient is 1.
    """
    if is_fixed:
        fixed: Array = 2 * b[:, 0] - S[:, 0, 0]
        return fixed
    posterior = (S + S.transpose(0, 2, 1)) / 2 + precision
    # What is fitted already can take all of a row, to rounding; then only the prior is left.
    floor = 1e-6 * np.einsum('nkk->nk', precision)
    diagonal = np.einsum('nkk->nk', posterior)
    np.einsum('nkk->nk', posterior)[:] = np.maximum(diagonal, floor)
    scale = 1 / np.sqrt(np.einsum('nkk->nk', posterior))
    scaled = posterior * scale[:, :, None] * scale[:, None, :]
    values, axes = np.linalg.eigh(scaled)
    kept = values > 1e-7
    along = np.einsum('nkj,nk->nj', axes, b * scale)
    quadratic = np.sum(np.where(kept, along ** 2 / np.where(kept, values, 1.0), 0.0), axis=1)
    log_det = (np.sum(np.log(np.maximum(values, 1e-7)), axis=1) - 2 * np.sum(np.log(scale), axis=1)
               - np.linalg.slogdet(precision)[1])
    gains: Array = quadratic - log_det
    return gains


class Fitted(Protocol):
    """What the equations need of a regression."""

    columns: tuple[BaseColumn, ...]
    drives: tuple[int, ...]
    precision: Array
    base_index: dict[int, np.typing.NDArray[np.int_]]
    base_products: dict[int, Array]

    def products(self, a: Block, b: Block | None, d: int) -> Array:
        """Return band sums of products of two blocks' rows on a drive."""

    def equations(self, d: int, felt: tuple[Block, ...]) -> DriveEquations:
        """Return those of a drive and the blocks that it feels."""


class DriveEquations:
    """Band sums of one drive's columns with each other and with the error.

    Columns are those of the base, then of the free blocks in order.

    Parameters
    ----------
    regression : Fitted
    d : int
    felt : sequence of Block
        With rows on the drive.
    """

    def __init__(self, regression: Fitted, d: int, felt: Sequence[Block]) -> None:
        fixed = [block for block in felt if block.is_fixed]
        free = [block for block in felt if not block.is_fixed]
        base = regression.base_products[d]
        count, first = base.shape[0], base.shape[1] - 1
        size = first + sum(block.size for block in free)
        gram = np.empty((count, size, size))
        side = np.empty((count, size))
        gram[:, :first, :first] = base[:, :-1, :-1]
        side[:, :first] = base[:, :-1, -1]
        squares = base[:, -1, -1].copy()
        at = first
        spots: list[tuple[Block, slice]] = []
        for block in free:
            spot = slice(at, at + block.size)
            with_base = regression.products(block, None, d)
            gram[:, spot, :first] = with_base[:, :, :-1]
            gram[:, :first, spot] = with_base[:, :, :-1].transpose(0, 2, 1)
            side[:, spot] = with_base[:, :, -1]
            for other, place in [*spots, (block, spot)]:
                pair = regression.products(block, other, d)
                gram[:, spot, place] = pair
                gram[:, place, spot] = pair.transpose(0, 2, 1)
            spots.append((block, spot))
            at += block.size
        for number, block in enumerate(fixed):
            with_base = regression.products(block, None, d)[:, 0]
            side[:, :first] -= with_base[:, :-1]
            squares += regression.products(block, block, d)[:, 0, 0] - 2 * with_base[:, -1]
            for other in fixed[:number]:
                squares += 2 * regression.products(block, other, d)[:, 0, 0]
            for other, place in spots:
                side[:, place] -= regression.products(other, block, d)[:, :, 0]
        self.gram, self.side, self.squares = gram, side, squares
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
        """Return the degrees of freedom spent in the bands, (B,)."""
        spent: Array = weights * (self._flat @ covariance.ravel())
        return spent


@dataclass(frozen=True)
class Solution:
    coefficients: Array
    covariance: Array
    deviance: float
    squares: Array
    leverage: Array


class NormalEquations:
    """The normal equations of all drives."""

    def __init__(self, regression: Fitted, blocks: Sequence[Block]) -> None:
        place = len(regression.precision)
        self.places: dict[Block, slice] = {}
        precision = [np.diag(regression.precision)]
        for block in blocks:
            self.places[block] = slice(place, place + block.size)
            place += block.size
            if not block.is_fixed:
                precision.append(block.precision)
        self.precision = np.zeros((place, place))
        self.log_precision, at = 0.0, 0
        for part in precision:
            self.precision[at:at + len(part), at:at + len(part)] = part
            at += len(part)
            if len(part):
                self.log_precision += float(np.linalg.slogdet(part)[1])
        self.limited = np.zeros(place, dtype=bool)
        self.limited[:len(regression.columns)] = [
            isinstance(column, KnownNumber) for column in regression.columns]
        self.drives: list[DriveEquations] = []
        self.indices: list[np.typing.NDArray[np.int_]] = []
        for d in regression.drives:
            felt = tuple(block for block in blocks if d in block.rows)
            self.drives.append(regression.equations(d, felt))
            self.indices.append(np.concatenate([regression.base_index[d], *(
                np.arange(self.places[one].start, self.places[one].stop) for one in felt)]))

    def solve(self, spectra: Array, counts: Array) -> Solution:
        """Return the solution under noise spectra (D, B).

        A number beyond its tolerance is held back by a prior that is much steeper there.
        """
        data, b = np.zeros_like(self.precision), np.zeros(len(self.precision))
        weights = 1 / spectra
        for k, (drive, index) in enumerate(zip(self.drives, self.indices, strict=True)):
            gram, side = drive.weighted(weights[k])
            data[np.ix_(index, index)] += gram
            b[index] += side
        beyond = np.zeros(len(b))
        for _ in range(MOST_LIMITED):
            H = data + self.precision + np.diag(BEYOND_TOLERANCE * np.abs(beyond))
            scale = 1 / np.sqrt(np.einsum('ii->i', H))
            factor = cho_factor(H * np.outer(scale, scale) + 1e-12 * np.eye(len(H)),
                                check_finite=False)
            side = b + BEYOND_TOLERANCE * DEVIATIONS * beyond
            coefficients = scale * cho_solve(factor, scale * side, check_finite=False)
            now = np.sign(coefficients) * (self.limited & (np.abs(coefficients) > DEVIATIONS))
            if np.array_equal(now, beyond):
                break
            beyond = now
        covariance = cho_solve(factor, np.eye(len(H)), check_finite=False) * np.outer(scale, scale)
        squares = np.stack([drive.left(coefficients[index])
                            for drive, index in zip(self.drives, self.indices, strict=True)])
        leverage = np.stack([
            drive.leverage(covariance[np.ix_(index, index)], weights[k])
            for k, (drive, index) in enumerate(zip(self.drives, self.indices, strict=True))])
        log_det = 2 * float(np.log(np.diag(factor[0])).sum() - np.log(scale).sum())
        deviance = float(np.sum(counts * np.log(spectra) + squares * weights)
                         + coefficients @ self.precision @ coefficients
                         + BEYOND_TOLERANCE * np.sum(
                             np.abs(beyond) * (np.abs(coefficients) - DEVIATIONS) ** 2)
                         + log_det - self.log_precision)
        return Solution(coefficients, covariance, deviance, squares, leverage)
