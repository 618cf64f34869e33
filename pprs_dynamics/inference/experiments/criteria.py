# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Information of a motion, and criteria of experiment design.

Information (Gram) matrices are those of columns under the noise of the drives: as in a fit, columns
are transformed by the orthonormal DCT and divided by the root of the noise's power spectrum.
Criteria are the expected evidence between rival models, and D-optimality of numbers.

References
----------
A. C. Atkinson, V. V. Fedorov, The design of experiments for discriminating between two rival
models, Biometrika 62 (1975) 57-70 (T-optimality).
K. Chaloner, I. Verdinelli, Bayesian experimental design: a review, Statistical Science 10 (1995)
273-304 (D-optimality with what is known beforehand).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import fft
from scipy.linalg import cho_factor, cho_solve

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.experiments.columns import ColumnPlan
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum

WEAK = 1e-9  # prior precision of what is free, relative to what is known of it
# A direction of less information, per scale, is unknown, and so is what has a share in it.
UNSEEN, WEIGHT = 1e-8, 1e-4
EVIDENCE_FLOOR = 1.0  # misfits below it count as none


@dataclass(frozen=True)
class Information:
    """Gram matrices of a plan's columns, (P, P).

    Parameters
    ----------
    plan : ColumnPlan
    noise : mapping of drive to NoiseSpectrum
        Other drives give no information.
    """

    plan: ColumnPlan
    noise: Mapping[int, NoiseSpectrum]

    def prior(self) -> Array:
        """Return what is known of the base columns beforehand."""
        known = np.zeros(self.plan.size)
        known[:len(self.plan.base)] = [column.precision for column in self.plan.base]
        return np.diag(known)

    def of_recordings(self, design: Design, regression: Regression, fit: JointFit) -> Array:
        """Return the information of recordings and the prior of the base columns."""
        gram = self.prior()
        for d, rows in self.plan.columns(design):
            if d in self.noise:
                series = regression.series[d]
                white = series.transform(rows) * series.spread(
                    np.sqrt(regression.weights(fit, d)))
                gram += white @ white.T
        return gram

    def of_motion(self, design: Design, duration: float) -> Array:
        """Return the information of a motion of some duration [s], at any sampling rate."""
        white = [whitened(rows, self.noise[d], duration)
                 for d, rows in self.plan.columns(design) if d in self.noise]
        return sum((rows @ rows.T for rows in white), np.zeros((self.plan.size,) * 2))


def whitened(rows: Array, noise: NoiseSpectrum, duration: float) -> Array:
    """Return the DCT of rows of a motion, (p, n), per standard deviation of the noise.

    Fewer samples than the noise has count for as many, as long as they follow the motion.
    """
    count = rows.shape[-1]
    density = noise.power(np.arange(count) / (2 * duration)) * count * noise.period / duration
    white: Array = fft.dct(rows, norm='ortho', axis=-1) / np.sqrt(density)
    return white


@dataclass(frozen=True)
class Contest:
    """Expected discrimination of a rival from the true model.

    Parameters
    ----------
    truth, rival : tuple of str
        Effects that only the truth has, and those that only the rival has.
    missing : (P,) array
        Coefficients of the true force, less what the rival has for certain.
    refitted : tuple of int
        Places of all columns that are fitted with the rival.
    now : float
        By how much the rival costs more on the recordings that there are.
    """

    truth: tuple[str, ...]
    rival: tuple[str, ...]
    missing: Array
    refitted: tuple[int, ...]
    now: float = 0.0

    def misfit(self, gram: Array) -> float:
        """Return the whitened squared residual of the refitted rival."""
        R, whole = list(self.refitted), gram @ self.missing
        return max(float(self.missing @ whole - whole[R] @ solve(gram[np.ix_(R, R)], whole[R])),
                   0.0)


@dataclass(frozen=True)
class Separation:
    """T-optimality for several contests: all misfits, the smallest above all."""

    contests: tuple[Contest, ...]

    def value(self, gram: Array) -> float:
        """Return minus ln of the mean of 1/misfit: nearly ln of the smallest."""
        misfits = np.array([contest.misfit(gram) for contest in self.contests])
        return -float(np.log(np.mean(1 / (misfits + EVIDENCE_FLOOR))))


@dataclass(frozen=True)
class Precision:
    """D-optimality: ln of the determinant of the information on some coefficients.

    Parameters
    ----------
    index, others : tuple of int
        Places of the coefficients, and of what is estimated with them.
    scales : (k,) array
        Sizes at which the coefficients matter: known to that beforehand.
    """

    index: tuple[int, ...]
    others: tuple[int, ...]
    scales: Array

    def own(self, gram: Array) -> Array:
        """Return the information that others leave, per scale, (k, k)."""
        I, R = list(self.index), list(self.others)  # noqa: E741
        S = gram[np.ix_(I, I)]
        if R:
            cross = gram[np.ix_(R, I)]
            S = S - cross.T @ solve(gram[np.ix_(R, R)], cross)
        return (S + S.T) / 2 * np.outer(self.scales, self.scales)

    def value(self, gram: Array) -> float:
        """Return ln det(1 + information)."""
        found = np.linalg.eigvalsh(self.own(gram))
        return float(np.sum(np.log1p(np.maximum(found, 0.0))))

    def deviations(self, gram: Array) -> Array:
        """Return standard deviations of the coefficients, (k,); infinite without information."""
        values, axes = np.linalg.eigh(self.own(gram))
        unseen = values <= UNSEEN
        variances = axes[:, ~unseen] ** 2 @ (1 / values[~unseen])
        variances[np.any(np.abs(axes[:, unseen]) > WEIGHT, axis=1)] = np.inf
        return np.sqrt(variances) * self.scales


def solve(matrix: Array, side: Array) -> Array:
    """Return the solution of a symmetric system whose rows may be nearly dependent."""
    scale = 1 / np.sqrt(np.diag(matrix) * (1 + WEAK) + 1e-12)
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices(len(scaled))] = 1 + WEAK
    found: Array = (scale * cho_solve(cho_factor(scaled), (scale * side.T).T).T).T
    return found
