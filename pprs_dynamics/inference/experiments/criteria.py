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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft
from scipy.linalg import cho_factor, cho_solve

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.experiments.columns import ColumnPlan, Columns, FittedTerm
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

    def of_recordings(self, design: Design, regression: Regression, fit: JointFit) -> Array:
        """Return the information of recordings and the prior of the base columns."""
        white = {}
        for d, (index, rows) in self.plan.on_recordings(design).items():
            if d in self.noise:
                series = regression.series[d]
                factor = series.spread(np.sqrt(regression.weights(fit, d)))
                white[d] = index, series.transform(rows) * factor
        return self._gram(white) + self.prior()

    def prior(self) -> Array:
        """Return what is known of the base columns beforehand."""
        known = np.zeros(self.plan.size)
        known[:len(self.plan.base)] = [column.precision for column in self.plan.base]
        return np.diag(known)

    def of_motion(self, columns: Columns, duration: float) -> Array:
        """Return the information of a motion of some duration [s], at any sampling rate."""
        return self._gram({d: (index, whitened(rows, self.noise[d], duration))
                           for d, (index, rows) in columns.items() if d in self.noise})

    def _gram(self, white: Columns) -> Array:
        gram = np.zeros((self.plan.size, self.plan.size))
        for index, rows in white.values():
            gram[np.ix_(index, index)] += rows @ rows.T
        return gram


def whitened(rows: Array, noise: NoiseSpectrum, duration: float) -> Array:
    """Return the DCT of rows of a motion, (p, n), per standard deviation of the noise.

    Fewer samples than the noise has count for as many, as long as they follow the motion.
    """
    count = rows.shape[-1]
    density = noise.power(np.arange(count) / (2 * duration)) * count * noise.period / duration
    white: Array = fft.dct(rows, norm='ortho', axis=-1) / np.sqrt(density)
    return white


@dataclass(frozen=True)
class Explanation:
    """Effects that may be there.

    Parameters
    ----------
    names : tuple of str
    terms : tuple of FittedTerm
    free : tuple of int
        Places of the columns that are fitted.
    index : tuple of int
        Places of the columns that make up its force.
    truth : (k,) array
        Their coefficients where it is there as the recordings say.
    prior_cost : float
        Against nothing: of its choice and of its coefficients.
    """

    names: tuple[str, ...]
    terms: tuple[FittedTerm, ...]
    free: tuple[int, ...]
    index: tuple[int, ...]
    truth: Array
    prior_cost: float = 0.0

    @property
    def name(self) -> str:
        """Of all its effects."""
        return ' and '.join(self.names)


@dataclass(frozen=True)
class Contest:
    """Expected discrimination of a rival from the true model.

    Parameters
    ----------
    truth, rival : Explanation
    refitted : tuple of int
        Places of all columns that are fitted with the rival.
    now : float
        By how much the rival costs more on the recordings that there are.
    """

    truth: Explanation
    rival: Explanation
    refitted: tuple[int, ...]
    now: float = 0.0

    @property
    def sides(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Effects that only the truth has, and those that only the rival has."""
        truth, rival = self.truth.names, self.rival.names
        return (tuple(one for one in truth if one not in rival),
                tuple(one for one in rival if one not in truth))

    def unexplained(self, size: int) -> Array:
        """Return coefficients of the true force less what the rival has for certain, (size,)."""
        force = np.zeros(size)
        force[list(self.truth.index)] += self.truth.truth
        for k, value in zip(self.rival.index, self.rival.truth, strict=True):
            if k not in self.rival.free:
                force[k] -= value
        return force

    def misfit(self, gram: Array) -> float:
        """Return the whitened squared residual of the refitted rival."""
        return misfits_of((self,), gram)[0]

    def evidence(self, known: Array, after: Array) -> float:
        """Return the evidence against the rival that recordings and motion together promise."""
        return self.now + self.gained(known, after)

    def gained(self, known: Array, after: Array) -> float:
        """Return the share of it that the motion adds."""
        return max(self.misfit(after) - self.misfit(known), 0.0)


def misfits_of(contests: Sequence[Contest], gram: Array) -> list[float]:
    """Return the misfit of every contest; those of one rival share a factorisation."""
    by_rival: dict[tuple[int, ...], list[int]] = {}
    for k, contest in enumerate(contests):
        by_rival.setdefault(contest.refitted, []).append(k)
    misfits = [0.0] * len(contests)
    for refitted, members in by_rival.items():
        R = list(refitted)
        forces = np.stack([contests[k].unexplained(len(gram)) for k in members], axis=1)
        whole = gram @ forces
        explained = np.sum(whole[R] * solve(gram[np.ix_(R, R)], whole[R]), axis=0)
        left = np.sum(forces * whole, axis=0) - explained
        for k, misfit in zip(members, left, strict=True):
            misfits[k] = max(float(misfit), 0.0)
    return misfits


@dataclass(frozen=True)
class Separation:
    """T-optimality for several contests: all misfits, the smallest above all."""

    contests: tuple[Contest, ...]

    def value(self, gram: Array) -> float:
        """Return minus ln of the mean of 1/misfit: nearly ln of the smallest."""
        misfits = np.array(misfits_of(self.contests, gram))
        return -float(np.log(np.mean(1 / (misfits + EVIDENCE_FLOOR))))


@dataclass(frozen=True)
class Precision:
    """D-optimality: ln of the determinant of the information on some coefficients.

    Parameters
    ----------
    index : tuple of int
        Theirs.
    others : tuple of int
        What is estimated with them.
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
    diagonal = np.diag(matrix) * (1 + WEAK) + 1e-12
    scale = 1 / np.sqrt(diagonal)
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices(len(scaled))] = 1 + WEAK
    factor = cho_factor(scaled)
    if side.ndim == 1:
        result: Array = scale * cho_solve(factor, scale * side)
    else:
        result = scale[:, None] * cho_solve(factor, scale[:, None] * side)
    return result


def free_of(explanations: Sequence[Explanation]) -> tuple[int, ...]:
    """Return the places of all columns that are fitted in explanations."""
    return tuple(k for one in explanations for k in one.free)
