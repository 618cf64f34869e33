# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Derivatives of a model's forces by its own numbers and by effects that it may lack.

Everything is linear here: a column is the change of all drives' measured efforts per unit of one
coefficient, at one chunk of a recording, at full rate. What a kind of model has for columns beside
those of effects in its drives is behind `Sensitivities`; the rest of the diagnosis is the same.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.structure_effect import BodyEffect, StructureEffect
from pprs_dynamics.physics.mechanism.reversal import smooth_sign
from pprs_dynamics.physics.model.force_model import ForceModel

# A number is moved by this share of itself: rounding and curvature are both below 1e-6 then.
RELATIVE_STEP = 1e-3
DEVIATIONS = 2.5
# Friction that turns over in another width than the model's is no effect: multiples of the
# width whose differences span what is between 0.2 and 5 times the model's.
DRIVE_WIDTHS = (0.2, 0.5, 2.0, 5.0)
PASSIVE_WIDTHS = (0.05, 0.25, 4.0)
# Names of columns; those of effects outside the drives have the effects' names.
NUMBERS, HOMING, PRESENT, BARE = 'numbers', 'homing', 'present ', 'bare '
OF_DRIVES, OF_JOINTS = 'drive widths', 'passive widths'


@dataclass(frozen=True)
class Number:
    """A number of the model that is known within a tolerance.

    Parameters
    ----------
    key : str
    element : int or None
        Of a list.
    value, deviation : float
        What the file says, and one standard deviation.
    unit : str
    """

    key: str
    element: int | None
    value: float
    deviation: float
    unit: str

    @property
    def label(self) -> str:
        """Name for people, e.g. masses.slides[2]."""
        return self.key if self.element is None else f'{self.key}[{self.element + 1}]'


def model_numbers(model: ForceModel) -> tuple[Number, ...]:
    """Return the model's numbers that its `tolerances` leave open.

    A tolerance is a limit: 2.5 standard deviations.
    """
    found = []
    for name, tolerance in model.values.items():
        key = name.removeprefix('tolerances.')
        if key not in model.keys or key == name or not tolerance:
            continue
        value = model.values[key]
        elements = enumerate(value) if isinstance(value, tuple) else [(None, value)]
        found += [Number(key, element, one, abs(one) * tolerance / DEVIATIONS,
                         _unit(model, key, element)) for element, one in elements if one]
    return tuple(found)


def _unit(model: ForceModel, key: str, element: int | None) -> str:
    """Return the unit of a number; of a joint's, that of its kind."""
    turning, *pushing = model.keys[key].unit.split(', ')
    turns = element is None or element >= len(model.drives) or model.units[element].turns
    return turning if turns or not pushing else pushing[0]


class Sensitivities(ABC):
    """Columns that a model has, chunk by chunk.

    Parameters
    ----------
    model : ForceModel
        Around which forces are linear.
    given : ForceModel
        As the user gave it: what it has already is no candidate, and its numbers are those that
        tolerances are about.

    Attributes
    ----------
    numbers : tuple of Number
    searched : tuple of type of StructureEffect
        Effects outside the drives that the given model could have and has not.
    """

    def __init__(self, model: ForceModel, given: ForceModel) -> None:
        self.model, self.given = model, given
        self.numbers = model_numbers(given)
        present = {effect.name for effect in given.effects}
        self.searched: tuple[type[StructureEffect], ...] = tuple(
            bound for effect in catalogue().values() if issubclass(effect, StructureEffect)
            and given.offers(effect) and effect.name not in present
            if issubclass(bound := given.bound(effect), StructureEffect) and bound.coefficients)

    @abstractmethod
    def columns(self, forces: Any) -> dict[str, Array]:
        """Return columns by name, (K, N, D) each.

        `NUMBERS` per standard deviation by which each number grows away from 0; `OF_DRIVES` what
        other widths of turning over would change in every drive, and last a part that is alike
        in both directions; `OF_JOINTS` the former in all passive joints; `HOMING` per metre that
        each drive is measured too far; the coefficients of each effect of `searched` by its name,
        and after `BARE` as they were if friction did not follow the loads; those of effects
        that the given model has after `PRESENT`. What a kind of model does not have is left out.

        Parameters
        ----------
        forces : Forces
            Of the model at one chunk, before its sensors.
        """

    def sensed(self, column: Array, state: Any) -> Array:
        """Return what the model's sensors make of a change of the drives' forces, (N, D)."""
        for effect in self.model.effects:
            if isinstance(effect, MeasurementEffect):
                column = effect.sensed(column, state.time, self.model.drives)
        return column


def following(model: ForceModel) -> list[Effect]:
    """Return the effects whose forces follow from a state: no bodies, sensors or memories."""
    return [effect for effect in model.effects
            if not effect.is_measurement and not isinstance(effect, BodyEffect)
            and effect.initial_memory() is None]


def reversal_columns(dry: Array, velocity: Array, direction: Array, width: Array) -> list[Array]:
    """Return what dry friction that turns over otherwise changes, (N, D) each.

    Parameters
    ----------
    dry : (N, D) array
        Its size in full motion [N].
    velocity, direction : (N, D) array
        [m/s], and its sgn as the model has it.
    width : float or (D,) array
        Of the model's sgn [m/s].

    Returns
    -------
    list
        A column for each of `DRIVE_WIDTHS`, odd in the direction; and an even one, for friction
        that differs by direction while it turns over.
    """
    odd = [dry * (smooth_sign(velocity, factor * width) - direction) for factor in DRIVE_WIDTHS]
    return [*odd, dry * (1 - np.abs(direction))]


def passive_reversal_columns(friction: Effect, state: Any) -> Array:
    """Return what friction in passive joints that turns over otherwise changes, (W, N, D) [N].

    A row for each of `PASSIVE_WIDTHS`, times the width of the state.
    """
    before = friction.force(state)
    return np.stack([friction.force(state.turning_over(replace(
        state.reversal, rate=factor * state.reversal.rate))) - before
        for factor in PASSIVE_WIDTHS])
