# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Columns of every fit: the model's uncertain numbers, and the width in which friction reverses.

A coefficient of 0 is the model as it was given. Each type knows its prior and what its
coefficient means for the model's values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.inference.regression.sensitivities import DEVIATIONS, DRIVE_WIDTHS, Number
from pprs_dynamics.inference.regression.terms import FullRate
from pprs_dynamics.inference.residuals.bands import OpenForces
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import set_number

DIGITS = 6  # significant, of fitted values
LARGEST_SHAPE_MOVE = 0.5  # of a shape parameter in one fit, as an amount of movement
SMALL_STEP = 1e-3  # standard deviations, for derivatives by parameters of effects
# A tolerance is a limit: beyond it a number's prior is this much steeper.
BEYOND_TOLERANCE = 25.0
OWN_FORM = 0.015  # form error of the model's friction over its force, see `decisions`
MOVED = 1e-4  # [m, rad], for derivatives of what is carried over by positions


@dataclass(frozen=True)
class BaseColumn:
    """A column of every fit.

    Parameters
    ----------
    rows : mapping of drive to (M,) array
        Change of the drive's force per unit of the coefficient [N].
    precision : float
        Of the Gaussian prior about 0, in which the coefficient is what the model file says.

    Attributes
    ----------
    in_model : bool
        Whether a coefficient moves a number of the fitted model; else it is a nuisance.
    beyond : float
        What the precision has more beyond a limit, about it.
    """

    in_model: ClassVar[bool] = True
    beyond: ClassVar[float] = 0.0

    rows: Mapping[int, Array]
    precision: float

    @property
    def limits(self) -> tuple[float, float]:
        """Coefficients between which that prior holds."""
        return -np.inf, np.inf


@dataclass(frozen=True)
class ModelNumber(BaseColumn):
    """A number within its tolerance; the coefficient counts standard deviations away from 0."""

    limits = -DEVIATIONS, DEVIATIONS
    beyond = BEYOND_TOLERANCE

    number: Number

    def value(self, coefficient: float) -> float:
        """Return the number [its unit]."""
        moved = self.number.value + np.sign(self.number.value) * coefficient * self.number.deviation
        return rounded(moved)


@dataclass(frozen=True)
class FrictionForm(BaseColumn):
    """Other form of the model's friction, with the same numbers."""

    in_model = False


@dataclass(frozen=True)
class LoadOfFriction(FrictionForm):
    """Friction that follows the loads by friction of passive joints, too: a coefficient of 1."""


@dataclass(frozen=True)
class ReversalShape(FrictionForm):
    """Friction that turns over otherwise than the model's; `drive` None: in passive joints.

    `number` counts the ways in which it may, in the order of `sensitivities.reversal_columns`. The
    coefficient of another width is its share: less than none would be more friction than Coulomb's,
    which is there within the form error.
    """

    beyond = OWN_FORM ** -2.0

    drive: int | None
    number: int

    @property
    def limits(self) -> tuple[float, float]:
        """From no share of a width on; the even part may have either sign."""
        return 0.0 if self.number < len(DRIVE_WIDTHS) else -np.inf, np.inf


@dataclass(frozen=True)
class ReferenceDirection(BaseColumn):
    """A principal direction of the uncertainty of a reference run, of unit prior."""

    in_model = False


@dataclass(frozen=True)
class PresentParameter(BaseColumn):
    """A parameter of an effect that the given model has; the coefficient counts deviations from it.

    Within what the model file says of how well it is known; more of a change is a hypothesis.

    Parameters
    ----------
    deviation : float
        Its standard deviation; of a shape parameter as an amount of movement.
    """

    effect: type[CatalogueEffect]
    drive: str | None
    parameter: Parameter
    deviation: float

    @property
    def is_shape(self) -> bool:
        """Whether forces are not linear in it."""
        return self.parameter in self.effect.shape

    def moved(self, values: Mapping[str, float], coefficient: float) -> dict[str, float]:
        """Return parameters of the effect with this one moved by a coefficient."""
        p, step = self.parameter, coefficient * self.deviation
        value = values.get(p.name, p.default or 0.0)
        return {**values, p.name: p.moved(value, float(np.clip(
            step, -LARGEST_SHAPE_MOVE, LARGEST_SHAPE_MOVE))) if self.is_shape else value + step}

    def slopes(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the derivatives of the effect's coefficients by the coefficient of the column."""
        after, before = (self.effect.to_coefficients(at) for at in (
            self.moved(values, SMALL_STEP), values))
        return {name: (after[name] - before[name]) / SMALL_STEP for name in before}


def force_of(base: Sequence[BaseColumn], coefficients: Array, shape: tuple[int, ...],
             of: Callable[[BaseColumn], bool]) -> Array:
    """Return the force of base columns with coefficients, (M, D) [N].

    Parameters
    ----------
    base : sequence of BaseColumn
    coefficients : (P,) array
        Of the base columns first.
    shape : tuple of int
    of : callable
        Whether a column counts.
    """
    force = np.zeros(shape)
    for column, c in zip(base, coefficients, strict=False):
        if of(column):
            for d, row in column.rows.items():
                force[:, d] += c * row
    return force


def rounded(value: float) -> float:
    """Return a fitted value with the digits that a model file gets."""
    return float(f'{value:.{DIGITS}g}')


def within(parameter: Parameter, value: float, units: DriveUnits) -> float:
    """Return a fitted value, rounded, within the bounds of its parameter in a drive."""
    bounded = parameter.of(units.turns)
    return float(min(max(rounded(value), bounded.lower), bounded.upper))


def units_of(model: DriveModel, drive: str | int | None) -> DriveUnits:
    """Return the units of a drive by name or number; those that push for the structure."""
    if drive is None:
        return DriveUnits()
    return model.units[model.drives.index(drive) if isinstance(drive, str) else drive]


def move_numbers(values: dict[str, Any], given: DriveModel, base: Sequence[BaseColumn],
                 coefficients: Array) -> None:
    """Put numbers and effects of the given model as coefficients have them into its values."""
    moves: dict[tuple[type[CatalogueEffect], str | None],
                list[tuple[PresentParameter, float]]] = {}
    for column, c in zip(base, coefficients.tolist(), strict=True):
        if isinstance(column, ModelNumber):
            set_number(values, column.number.key, column.number.element, column.value(c))
        elif isinstance(column, PresentParameter):
            moves.setdefault((column.effect, column.drive), []).append((column, c))
    for (kind, drive), found in moves.items():
        there = present_values(next(e for e in given.effects if type(e) is kind), drive)
        linear, shape = kind.to_coefficients(there), {}
        for column, c in found:
            if column.is_shape:
                shape[column.parameter.name] = column.moved(there, c)[column.parameter.name]
            for name, slope in column.slopes(there).items():
                linear[name] += c * slope
        every = {**there, **kind.from_coefficients(linear), **shape}
        prefix = f'effects.{kind.name}.' + (f'{drive}.' if drive else '')
        values.update({prefix + p.name: within(p, every[p.name], units_of(given, drive))
                       for p in kind.parameters if p.name in there})


def present_values(effect: CatalogueEffect, drive: str | None) -> Mapping[str, float]:
    """Return the parameters that an effect of a model has, on a drive or in the structure."""
    if isinstance(effect, DriveEffect):
        assert drive is not None
        return effect.drives[drive]
    assert isinstance(effect, StructureEffect)
    return effect.values


def present_columns(effect: CatalogueEffect, known: Mapping[str, float],
                    ) -> Iterator[PresentParameter]:
    """Yield the uncertain parameters of an effect of the input model, as columns without rows.

    Parameters
    ----------
    effect : CatalogueEffect
    known : mapping of str to float
        Standard deviations by drive.parameter, or parameter; what is not there is exact.
    """
    kind = type(effect)
    for drive in effect.drives if isinstance(effect, DriveEffect) else (None,):
        for p in kind.parameters:
            if std := known.get(f'{drive}.{p.name}' if drive else p.name, 0.0):
                yield PresentParameter({}, 1.0, kind, drive, p, p.amount(
                    std, present_values(effect, drive)[p.name]) if p in kind.shape else std)


@dataclass(frozen=True)
class CarriedOver:
    """Predicted forces of a reference run; see `pprs_dynamics.inference.fit.reference`.

    Parameters
    ----------
    of_base : (M, D) array
        Forces that the model lacks there as well by the numbers of its base [N].
    repeating : callable
        Gives those that no number explains, (N, D), of positions and velocities (N, D) and the
        time over which they are means [s].
    directions : tuple of ReferenceDirection
        In which they are uncertain most.
    open_forces : mapping of drive to OpenForces
        In which they are uncertain beyond.
    covered : float
        Share of the samples whose states the reference knows.
    """

    of_base: Array
    repeating: Callable[[Array, Array, float], Array]
    directions: tuple[ReferenceDirection, ...]
    open_forces: Mapping[int, OpenForces]
    covered: float

    def shown(self, residuals: Residuals) -> Array:
        """Return the forces that the model lacks there as well, (M, D) [N].

        Of residuals of the same samples, whose positions may be read otherwise.
        """
        q, v = (residuals.variables[name] for name in ('position', 'velocity'))
        return self.of_base + self.repeating(q, v, residuals.period)

    def per_position(self, residuals: Residuals) -> Array:
        """Return how the forces change with the position of each drive, (D, M, D) [N/m]."""
        q, v = (residuals.variables[name] for name in ('position', 'velocity'))
        return np.stack([
            (self.repeating(q + step, v, residuals.period)
             - self.repeating(q - step, v, residuals.period)) / (2 * MOVED)
            for step in MOVED * np.eye(q.shape[1])])

    def at_full_rate(self, recordings: Sequence[FullRate], time: Array) -> list[Array]:
        """Return the forces at every sample of recordings, (N, D) [N]; `time` (M,) of means."""
        found, end = [], 0
        for recording in recordings:
            part = slice(end, end := end + len(recording.treat))
            of_base = [np.interp(recording.time, time[part], row) for row in self.of_base[part].T]
            found.append(self.repeating(recording.position, recording.velocity, 0.0)
                         + np.stack(of_base, axis=1))
        return found
