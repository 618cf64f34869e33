# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Blocks of the recordings, each predicted from a fit to the others.

The noise and the priors are those of the whole fit. Rows are whitened and brought back into time,
so that a block's share in the normal equations can be taken out.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.joint_fit import Integers
from pprs_dynamics.inference.regression.normal_equations import Prior
from pprs_dynamics.inference.residuals.paired_errors import BLOCKS, PairedGain
from pprs_dynamics.inference.search.candidates import CandidateSet
from pprs_dynamics.inference.search.fitted_sets import FittedSets


@dataclass(frozen=True)
class HeldOut:
    """Block cross-validation of a set.

    Parameters
    ----------
    error : float
        Root of the mean square over samples and drives, reversals as the model has them [N].
    penalties : (BLOCKS,) array
        Of numbers that the fits to the other blocks stretch beyond what is known of them.
    white : tuple of (n,) arrays
        Whitened error of each block, of all drives.
    """

    error: float
    penalties: Array
    white: tuple[Array, ...]

    def gain(self, other: HeldOut) -> PairedGain:
        """Return what another set, under the same noise, takes off the error of this one."""
        pairs = list(zip(self.white, other.white, strict=True))
        return PairedGain(
            # Numbers that are stretched beyond what is known of them cost their share everywhere.
            np.array([a @ a - b @ b for a, b in pairs])
            + (self.penalties - other.penalties) / BLOCKS,
            np.array([(a - b) @ (a - b) for a, b in pairs]))


def hold_out(fits: FittedSets, fitted: CandidateSet) -> HeldOut:
    """Return how well blocks of the recordings are predicted from the others."""
    regression, fit = fits.regression, fitted.fit
    size = len(fit.coefficients)
    total = len(regression.residuals)
    edges = np.linspace(0, total, BLOCKS + 1)
    H, b = np.zeros((BLOCKS, size, size)), np.zeros((BLOCKS, size))
    white: dict[int, tuple[Integers, Array, Array]] = {}
    for d in regression.drives:
        series = regression.series[d]
        index, acting = regression.local(fit, d)
        rows = np.concatenate([regression.base[d][:-1], *(block.rows[d] for block in acting)])
        y = regression.base[d][-1]
        root = np.sqrt(series.spread(regression.weights(fit, d)))
        stacked = series.inverse(np.concatenate((rows, y[None])) * root)
        white[d] = index, stacked, series.inverse(np.concatenate((rows, y[None])))
        at = np.searchsorted(series.index, edges)
        for k in range(BLOCKS):
            part = stacked[:, at[k]:at[k + 1]]
            H[k][np.ix_(index, index)] += part[:-1] @ part[:-1].T
            b[k, index] += part[:-1] @ part[-1]
    prior = Prior.of(regression.columns, fit.blocks)
    others = [prior.posterior(H.sum(axis=0) - H[k], b.sum(axis=0) - b[k]) for k in range(BLOCKS)]
    coefficients = np.stack([fit.coefficients for fit in others])
    plain = coefficients.copy()
    plain[:, [k for k, column in enumerate(fits.design.base) if not column.in_model]] = 0.0
    plain[:, fit.index_of(chain(*fitted.nuisance.values()))] = 0.0
    left: list[list[Array]] = [[] for _ in range(BLOCKS)]
    squares, count = 0.0, 0
    for d, (index, stacked, rows) in white.items():
        series = regression.series[d]
        at = np.searchsorted(series.index, edges)
        for k in range(BLOCKS):
            block = slice(at[k], at[k + 1])
            left[k].append(stacked[-1, block] - coefficients[k, index] @ stacked[:-1, block])
            rest = rows[-1, block] - plain[k, index] @ rows[:-1, block]
            squares, count = squares + float(rest @ rest), count + len(rest)
    return HeldOut(float(np.sqrt(squares / max(count, 1))),
                   np.array([fit.penalty for fit in others]), tuple(map(np.concatenate, left)))
