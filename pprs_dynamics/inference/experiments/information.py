# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Fisher information of a planned motion, and criteria of experiment design.

Columns are those of `regression.design`, so that the information of a motion and that of the
recordings add up. As in a fit they are transformed by the orthonormal DCT and divided by the root
of the noise's power spectrum. Criteria are the expected evidence between rival models, and
D-optimality of numbers.

References
----------
A. C. Atkinson, V. V. Fedorov, The design of experiments for discriminating between two rival
models, Biometrika 62 (1975) 57-70 (T-optimality).
K. Chaloner, I. Verdinelli, Bayesian experimental design: a review, Statistical Science 10 (1995)
273-304 (D-optimality with what is known beforehand).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import fft
from scipy.linalg import cho_factor, cho_solve

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import (
    BaseColumn,
    ModelNumber,
    PresentParameter,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.sensitivities import Sensitivities
from pprs_dynamics.inference.regression.terms import Rows
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.search.body_centres import about_centre
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces

WEAK = 1e-9  # prior precision of what is free, relative to what is known of it
# A direction of less information, per scale, is unknown, and so is what has a share in it.
UNSEEN, WEIGHT = 1e-8, 1e-4
EVIDENCE_FLOOR = 1.0  # misfits below it count as none


@dataclass(frozen=True, eq=False)
class FittedTerm:
    """An effect on a drive or in the structure, with values.

    Its columns are those of its coefficients (one of coefficient 1 where the shape is all), then
    the derivatives by its shape parameters.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drive : int or None
    shape : mapping of str to float
    names : tuple of str
        Coefficients that are fitted.
    values : (k,) array
        Of the coefficients; 1 where the shape is all.
    centre : tuple of float
        Of an added body, about which its columns are; see `Component`.
    """

    effect: type[CatalogueEffect]
    drive: int | None
    shape: Mapping[str, float]
    names: tuple[str, ...]
    values: Array
    centre: tuple[float, ...] = ()

    @property
    def size(self) -> int:
        """Number of columns."""
        return len(self.values) + len(self.shape)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Of the fitted columns: coefficients, then shape parameters."""
        known = {c.name: c for c in self.effect.coefficients}
        return (*(known[name] for name in self.names), *self.effect.shape)

    @property
    def scales(self) -> Array:
        """Sizes at which the fitted coefficients matter; shapes by a factor of e."""
        return np.array([p.scale for p in self.parameters[:len(self.names)]]
                        + [1.0] * len(self.shape))

    def rows(self, design: Design) -> Rows:
        """Return its columns on recordings or on a motion."""
        term = design.find_term(self.effect, self.drive, self.shape)
        if self.centre:
            term = about_centre(term, self.names[0], self.centre)
        chosen = [term.names.index(name) for name in self.names] or [0]
        rows = {d: values[chosen] for d, values in term.rows.items()}
        if self.shape:
            every = np.zeros(len(term.names) or 1)
            every[chosen] = self.values
            slopes = design.slope_rows(term, every)
            rows = {d: np.concatenate((values, slopes[d])) for d, values in rows.items()}
        return rows


@dataclass(frozen=True)
class Information:
    """Gram matrices (P, P) of columns: base columns, then those of terms.

    Parameters
    ----------
    given, model : DriveModel
        As the user has it; and around which forces are linear.
    base : tuple of BaseColumn
        Every base column that a motion may excite.
    terms : tuple of FittedTerm
    noise : mapping of drive to NoiseSpectrum
        Other drives give no information.
    """

    given: DriveModel
    model: DriveModel
    base: tuple[BaseColumn, ...]
    terms: tuple[FittedTerm, ...]
    noise: Mapping[int, NoiseSpectrum]

    @classmethod
    def of(cls, given: DriveModel, model: DriveModel, forces: Forces, time: Array,
           terms: Sequence[FittedTerm], noise: Mapping[int, NoiseSpectrum]) -> Information:
        """Return the information of terms and of the base columns of any motion."""
        found = cls(given, model, (), tuple(terms), noise)
        return replace(found, base=found.on_motion(forces, time).base)

    @property
    def size(self) -> int:
        """Number of all columns."""
        return len(self.base) + sum(term.size for term in self.terms)

    @property
    def numbers(self) -> tuple[int, ...]:
        """Places of the model's own numbers."""
        return tuple(k for k, column in enumerate(self.base) if isinstance(column, ModelNumber))

    def places(self, terms: Sequence[FittedTerm], only_fitted: bool = True) -> tuple[int, ...]:
        """Return the places of the columns of terms that are fitted, or of their coefficients."""
        ends = dict(zip(self.terms, len(self.base) + np.cumsum(
            [term.size for term in self.terms]), strict=True))
        return tuple(int(ends[term]) - term.size + k for term in terms for k in (
            range(len(term.values) - len(term.names), term.size) if only_fitted
            else range(len(term.values))))

    def force(self, terms: Sequence[FittedTerm]) -> Array:
        """Return the coefficients of the force of terms, (P,)."""
        found = np.zeros(self.size)
        found[list(self.places(terms, False))] = np.concatenate([term.values for term in terms])
        return found

    def columns(self, design: Design) -> Iterator[tuple[int, Array]]:
        """Yield all columns of each drive on recordings or on a motion, (P, M) [N]."""
        known = {_key(column): column.rows for column in design.base}
        base = [known.get(_key(column), {}) for column in self.base]
        terms = [(term.size, term.rows(design)) for term in self.terms]
        none = np.zeros((1, len(design.residuals)))
        for d in range(len(design.drives)):
            yield d, np.concatenate([none[:0], *(rows.get(d, none[0])[None] for rows in base), *(
                rows.get(d, np.repeat(none, size, axis=0)) for size, rows in terms)])

    def on_motion(self, forces: Forces, time: Array, block: int = 1) -> Design:
        """Return the design of a motion.

        Parameters
        ----------
        forces : Forces
            Of the model, before its sensors.
        time : (N,) array
        block : int
            Samples that are averaged.
        """
        return Design.planned(self._sensitivities, forces, time, block)

    def prior(self) -> Array:
        """Return the prior precision of the base columns."""
        known = np.zeros(self.size)
        known[:len(self.base)] = [column.precision for column in self.base]
        return np.diag(known)

    def of_recordings(self, design: Design, regression: Regression, fit: JointFit) -> Array:
        """Return the information of recordings and the prior of the base columns."""
        gram = self.prior()
        for d, rows in self.columns(design):
            if d in self.noise:
                series = regression.series[d]
                white = series.transform(rows) * series.spread(
                    np.sqrt(regression.weights(fit, d)))
                gram += white @ white.T
        return gram

    def of_motion(self, design: Design, duration: float) -> Array:
        """Return the information of a motion of some duration [s], at any sampling rate."""
        white = [whitened(rows, self.noise[d], duration)
                 for d, rows in self.columns(design) if d in self.noise]
        return sum((rows @ rows.T for rows in white), np.zeros((self.size,) * 2))

    @cached_property
    def _sensitivities(self) -> Sensitivities:
        found = Sensitivities(self.model, self.given)
        found.is_planned = True
        found.restrict({column.effect for column in (*self.terms, *self.base) if isinstance(
            column, (FittedTerm, PresentParameter))}
            | {type(effect) for effect in self.given.effects
               if isinstance(effect, CatalogueEffect)})
        return found


def _key(column: BaseColumn) -> str:
    """Return what identifies a base column in any design."""
    return repr(replace(column, rows={}))


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


def separation(contests: Sequence[Contest], gram: Array) -> float:
    """Return minus ln of the mean of 1/misfit of contests: nearly ln of the smallest misfit."""
    misfits = np.array([contest.misfit(gram) for contest in contests])
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
        """Return the information that the others do not explain, per scale, (k, k)."""
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
