# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Columns of every fit: the model's uncertain numbers, and the width in which friction reverses.

A coefficient of 0 is the model as it was given. Each type knows its prior and what its
coefficient means for the model's values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.inference.regression.sensitivities import Number
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
    """

    in_model: ClassVar[bool] = True

    rows: Mapping[int, Array]
    precision: float


@dataclass(frozen=True)
class ModelNumber(BaseColumn):
    """A number within its tolerance; the coefficient counts standard deviations away from 0."""

    number: Number

    def value(self, coefficient: float) -> float:
        """Return the number [its unit]."""
        moved = self.number.value + np.sign(self.number.value) * coefficient * self.number.deviation
        return rounded(moved)


@dataclass(frozen=True)
class ReversalShape(BaseColumn):
    """Friction that turns over otherwise than the model's; `drive` None: in passive joints.

    `number` counts the ways in which it may, in the order of `sensitivities.reversal_columns`.
    """

    in_model = False

    drive: int | None
    number: int


@dataclass(frozen=True)
class ReferenceDirection(BaseColumn):
    """A principal direction of the uncertainty of a reference run, of unit prior."""

    in_model = False


@dataclass(frozen=True)
class PresentCoefficient(BaseColumn):
    """A coefficient of an effect that the given model has, per unit of its `scale`.

    Within what the model file says of how well it is known; more of a change is a hypothesis.
    """

    effect: type[CatalogueEffect]
    drive: str | None
    coefficient: Parameter


@dataclass(frozen=True)
class PresentShape(BaseColumn):
    """A shape parameter of an effect that the given model has, by its amount of movement.

    Within its uncertainty, as a `PresentCoefficient`.
    """

    effect: type[CatalogueEffect]
    drive: str | None
    parameter: Parameter


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


def move_numbers(values: dict[str, Any], base: Sequence[BaseColumn], coefficients: Array) -> None:
    """Put known numbers as coefficients have them into a model's values."""
    for column, c in zip(base, coefficients, strict=True):
        if isinstance(column, ModelNumber):
            set_number(values, column.number.key, column.number.element, column.value(float(c)))


def move_present(values: dict[str, Any], given: DriveModel, base: Sequence[BaseColumn],
                 coefficients: Array) -> None:
    """Put the given model's effects as coefficients have them into a model's values."""
    moves: dict[tuple[type[CatalogueEffect], str | None],
                list[tuple[PresentCoefficient | PresentShape, float]]] = {}
    for column, c in zip(base, coefficients, strict=True):
        if isinstance(column, (PresentCoefficient, PresentShape)):
            moves.setdefault((column.effect, column.drive), []).append((column, float(c)))
    for effect in given.effects:
        for (kind, drive), found in moves.items():
            if kind is not type(effect):
                continue
            block = present_values(effect, drive)
            linear = kind.to_coefficients(block)
            shape = {p.name: block[p.name] for p in kind.shape}
            for column, c in found:
                if isinstance(column, PresentCoefficient):
                    linear[column.coefficient.name] += c * column.coefficient.scale
                else:
                    p = column.parameter
                    shape[p.name] = p.moved(shape[p.name], float(np.clip(
                        c, -LARGEST_SHAPE_MOVE, LARGEST_SHAPE_MOVE)))
            every = {**kind.from_coefficients(linear), **shape}
            prefix = f'effects.{kind.name}.' + (f'{drive}.' if drive else '')
            for parameter in kind.parameters:
                values[prefix + parameter.name] = within(parameter, every[parameter.name],
                                                         units_of(given, drive))


def present_values(effect: CatalogueEffect, drive: str | None) -> Mapping[str, float]:
    """Return the parameters that an effect of a model has, on a drive or in the structure."""
    if isinstance(effect, DriveEffect):
        assert drive is not None
        return effect.drives[drive]
    assert isinstance(effect, StructureEffect)
    return effect.values


def _coefficient_deviations(effect: CatalogueEffect, drive: str | None,
                            known: Mapping[str, float]) -> dict[str, float]:
    """Return the standard deviations of an effect's coefficients by those of its parameters.

    Parameters
    ----------
    effect : CatalogueEffect
    drive : str or None
    known : mapping of str to float
        Standard deviations by drive.parameter, or parameter; what is not there is exact.
    """
    kind, values = type(effect), present_values(effect, drive)
    prefix = f'{drive}.' if drive else ''
    here = kind.to_coefficients(values)
    variances = dict.fromkeys(here, 0.0)
    for parameter in kind.linear:
        if std := known.get(prefix + parameter.name, 0.0):
            moved = kind.to_coefficients({**values, parameter.name: values.get(
                parameter.name, parameter.default or 0.0) + std})
            for name, value in moved.items():
                variances[name] += (value - here[name]) ** 2
    return {name: variance ** 0.5 for name, variance in variances.items()}


def present_columns(effect: CatalogueEffect, known: Mapping[str, float],
                    ) -> list[PresentCoefficient | PresentShape]:
    """Return what of an effect is uncertain, as columns without rows.

    Parameters
    ----------
    effect : CatalogueEffect
        Of the given model.
    known : mapping of str to float
        Standard deviations by drive.parameter, or parameter; what is not there is exact.
    """
    kind, found = type(effect), list[PresentCoefficient | PresentShape]()
    for drive in effect.drives if isinstance(effect, DriveEffect) else (None,):
        deviations = _coefficient_deviations(effect, drive, known)
        found += [PresentCoefficient({}, (c.scale / deviations[c.name]) ** 2, kind, drive, c)
                  for c in kind.coefficients if deviations[c.name] > 0]
        for p in kind.shape:
            if std := known.get(f'{drive}.{p.name}', 0.0):
                amount = p.amount(std, present_values(effect, drive)[p.name])
                found.append(PresentShape({}, amount ** -2, kind, drive, p))
    return found


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
