# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Columns of the regression on a motion that nobody has made yet.

They are those of `regression.design`, so that the information of a motion and that of the
recordings add up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import (
    BaseColumn,
    ModelNumber,
    PresentCoefficient,
    PresentShape,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.sensitivities import Sensitivities
from pprs_dynamics.inference.regression.terms import Rows
from pprs_dynamics.inference.search.body_centres import about_centre
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces


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
class ColumnPlan:
    """Columns of which information is computed: base columns, then those of terms.

    Parameters
    ----------
    given, model : DriveModel
        As the user has it; and around which forces are linear.
    base : tuple of BaseColumn
        Every base column that a motion may excite.
    terms : tuple of FittedTerm
    """

    given: DriveModel
    model: DriveModel
    base: tuple[BaseColumn, ...]
    terms: tuple[FittedTerm, ...]

    @classmethod
    def of(cls, given: DriveModel, model: DriveModel, forces: Forces, time: Array,
           terms: Sequence[FittedTerm]) -> ColumnPlan:
        """Return the plan of the base columns of any motion, with terms."""
        return cls(given, model, cls(given, model, (), tuple(terms)).on_motion(forces, time).base,
                   tuple(terms))

    @property
    def size(self) -> int:
        """Number of all columns."""
        return len(self.base) + sum(term.size for term in self.terms)

    @property
    def numbers(self) -> tuple[int, ...]:
        """Places of the model's own numbers."""
        return tuple(k for k, one in enumerate(self.base) if isinstance(one, ModelNumber))

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

    @cached_property
    def _sensitivities(self) -> Sensitivities:
        found = Sensitivities(self.model, self.given)
        found.restrict({column.effect for column in (*self.terms, *self.base) if isinstance(
            column, (FittedTerm, PresentCoefficient, PresentShape))}
            | {type(effect) for effect in self.given.effects
               if isinstance(effect, CatalogueEffect)})
        return found


def _key(column: BaseColumn) -> str:
    """Return what identifies a base column in any design."""
    return repr(replace(column, rows={}))
