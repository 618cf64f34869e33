# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Columns of the regression on a motion that nobody has made yet.

They are those of `regression.design`, in the same order and scale, so that what a new motion
adds is added to the information of the recordings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import (
    BaseColumn,
    ModelNumber,
    PresentCoefficient,
    PresentShape,
    ReversalShape,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.sensitivities import (
    DRIVE_WIDTHS,
    HOMING,
    INERTIA,
    NUMBERS,
    OF_DRIVES,
    OF_JOINTS,
    PRESENT,
    Sensitivities,
)
from pprs_dynamics.inference.regression.terms import FullRate, Rows, Term
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.body_centres import about_centre
from pprs_dynamics.measurement.motion.treatment import Treatment
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces

HOMING_SAMPLES = 100  # of a motion, at which columns of wrong zeros are computed; they are slow
Columns = Mapping[int, tuple[np.typing.NDArray[np.int_], Array]]
"""By drive: places of the columns that it feels, (p,), and these in time, (p, M) [N]."""


@dataclass(frozen=True, eq=False)
class FittedTerm:
    """An effect on a drive or in the structure, with values.

    Its columns are those of its coefficients (of one that is 1 where the shape says it all), then
    the derivatives by its shape parameters, per amount of movement.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drive : int or None
    shape : mapping of str to float
    names : tuple of str
        Coefficients that are fitted.
    values : (k,) array
        Theirs; 1 where the shape says it all.
    centre : tuple of float
        Of an added body, about which its columns are; see `Component`.
    """

    effect: type[CatalogueEffect]
    drive: int | None
    shape: Mapping[str, float]
    names: tuple[str, ...]
    values: Array
    centre: tuple[float, ...] = ()

    @classmethod
    def at_scale(cls, effect: type[CatalogueEffect], drive: int | None,
                 shape: Mapping[str, float]) -> FittedTerm:
        """Return an effect with its coefficients at the sizes at which they matter."""
        return cls(effect, drive, shape, tuple(c.name for c in effect.coefficients),
                   np.array([c.scale for c in effect.coefficients] or [1.0]))

    @classmethod
    def at_places(cls, effect: type[CatalogueEffect]) -> list[FittedTerm]:
        """Return an effect in the structure, once for each of its places, with all that it has."""
        scale = {c.name: c.scale for c in effect.coefficients}
        most: dict[tuple[tuple[str, ...], ...], tuple[str, ...]] = {}
        for names in effect.variants:
            place = effect.places_of(names)
            most[place] = max(most.get(place, ()), names, key=len)
        return [cls(effect, None, {}, names, np.array([scale[name] for name in names]))
                for names in most.values()]

    @property
    def size(self) -> int:
        """Number of columns."""
        return len(self.values) + len(self.shape)

    @property
    def free(self) -> slice:
        """Columns whose coefficients are fitted."""
        return slice(len(self.values) - len(self.names), None)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Of the free columns: coefficients, then shape parameters."""
        known = {c.name: c for c in self.effect.coefficients}
        return (*(known[name] for name in self.names), *self.effect.shape)

    @property
    def scales(self) -> Array:
        """Sizes at which the coefficients of the free columns matter; shapes by a factor of e."""
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
    """Which columns are wanted, and how they are computed.

    Parameters
    ----------
    given, model : DriveModel
        As the user has it; and around which forces are linear.
    base : tuple of BaseColumn
        As the design has them; their rows are those of the recordings, if any.
    terms : tuple of FittedTerm
    """

    given: DriveModel
    model: DriveModel
    base: tuple[BaseColumn, ...]
    terms: tuple[FittedTerm, ...]

    @classmethod
    def of_design(cls, design: Design, terms: Sequence[FittedTerm]) -> ColumnPlan:
        """Return the plan of a design's base columns and more.

        A drive that stood has no columns of its reversals in the design, but may turn over in a
        motion.
        """
        moved = {one.drive for one in design.base if isinstance(one, ReversalShape)}
        stood = [drive for drive in range(len(design.drives)) if drive not in moved]
        return cls(design.given, design.model, (*design.base, *reversal_shapes(stood)),
                   tuple(terms))

    @property
    def size(self) -> int:
        """Number of all columns, base columns first."""
        return len(self.base) + sum(term.size for term in self.terms)

    @property
    def numbers(self) -> tuple[int, ...]:
        """Places of the model's own numbers."""
        return tuple(k for k, one in enumerate(self.base) if isinstance(one, ModelNumber))

    @property
    def others(self) -> tuple[int, ...]:
        """Places of the other base columns."""
        return tuple(k for k in range(len(self.base)) if k not in self.numbers)

    def places(self) -> dict[FittedTerm, slice]:
        """Return where each term's columns stand."""
        ends = len(self.base) + np.cumsum([term.size for term in self.terms])
        return {term: slice(int(end) - term.size, int(end))
                for end, term in zip(ends, self.terms, strict=True)}

    def on_recordings(self, design: Design) -> Columns:
        """Return all columns on the recordings of the design that the plan is of."""
        return self._by_drive([one.rows for one in self.base], design)

    def on_motion(self, forces: Forces, time: Array, block: int = 1) -> Columns:
        """Return the columns of a motion.

        Parameters
        ----------
        forces : Forces
            Of the model, before its sensors.
        time : (N,) array
        block : int
            Samples that are averaged.
        """
        samples = len(time)
        found = self._whole_columns(forces, samples)
        shared = dict(zip(self.numbers, found[NUMBERS], strict=True))
        for k, column in enumerate(self.base):
            if isinstance(column, ReversalShape):
                shared[k] = found[OF_JOINTS if column.drive is None else OF_DRIVES][column.number]
        treat = Treatment(np.arange(0, samples - samples % block or samples, block), samples)

        def by_drive(column: Array) -> dict[int, Array]:
            return dict(enumerate(treat(column).T))

        design = replace(
            self._motion_design(forces, time, treat, block), structure=tuple(
                Term(effect, None, {}, {d: treat(found[effect.name][:, :, d].T).T
                                        for d in range(len(self.model.drives))})
                for effect in self._wanted if issubclass(effect, StructureEffect)),
            homing=tuple(map(by_drive, found.get(HOMING, ()))),
            inertia=tuple(map(by_drive, found.get(INERTIA, ()))))
        base = [design.present_rows(column) if isinstance(
                    column, (PresentCoefficient, PresentShape))
                else _felt(column, by_drive(shared[k])) for k, column in enumerate(self.base)]
        return self._by_drive(base, design)

    @property
    def _wanted(self) -> set[type[CatalogueEffect]]:
        """Effects that columns are of."""
        return {one.effect for one in (*self.terms, *self.base) if isinstance(
            one, (FittedTerm, PresentCoefficient, PresentShape))}

    def _whole_columns(self, forces: Any, samples: int) -> dict[str, Array]:
        """Return the columns of a motion at full rate that do not need its design.

        By name as `Sensitivities.columns`, those of an effect by its own, whether it is in the
        model or not.
        """
        sensitivities = Sensitivities(self.model, self.given)
        known = {effect.name for effect in self.given.effects}
        sensitivities.searched = tuple(effect for effect in self._wanted if issubclass(
            effect, StructureEffect) and effect.name not in known)
        sensitivities.of_zeros = any(effect.shifts_positions() for effect in self._wanted)
        sensitivities.homing_stride = max(1, samples // HOMING_SAMPLES)
        return {name.removeprefix(PRESENT): column
                for name, column in sensitivities.columns(forces).items()}

    def _motion_design(self, forces: Forces, time: Array, treat: Treatment, block: int) -> Design:
        s, total = forces.mechanism, forces.total
        full = FullRate(time, s.position, s.velocity, s.acceleration, s.direction,
                        s.friction_load, s.transmitted, total, total, (slice(0, len(time)),),
                        treat, float(time[0]), {})
        means = treat(total)
        residuals = Residuals(self.model.drives, treat(time), np.zeros(len(means), dtype=int),
                              means, means, period=float(time[1] - time[0]) * block)
        return Design(self.given, self.model, residuals, (full,), (), (), (), (), (), (),
                      means)

    def _by_drive(self, base: Sequence[Rows], design: Design) -> Columns:
        """Return base columns and those of the terms, drive by drive."""
        terms = [(place, term.rows(design)) for term, place in self.places().items()]
        found = {}
        for d in range(len(self.model.drives)):
            index = [k for k, rows in enumerate(base) if d in rows]
            parts = [base[k][d][None] for k in index]
            for place, rows in terms:
                if d in rows:
                    index += range(place.start, place.stop)
                    parts.append(rows[d])
            found[d] = (np.array(index, dtype=int), np.concatenate(parts))
        return found


def _felt(column: BaseColumn, rows: Rows) -> Rows:
    """Return the rows of a column on the drives that may feel it."""
    if isinstance(column, ReversalShape) and column.drive is not None:
        return {column.drive: rows[column.drive]}
    return rows


def reversal_shapes(drives: Sequence[int]) -> list[ReversalShape]:
    """Return the columns of reversals of drives, without rows."""
    # One for every width, and one for friction that differs by direction while it turns over.
    return [ReversalShape({}, 1.0, drive, number)
            for number, _ in enumerate((*DRIVE_WIDTHS, None)) for drive in drives]
