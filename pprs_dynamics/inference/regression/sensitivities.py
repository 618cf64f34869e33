# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Derivatives of a model's forces by its own numbers and by effects that it may lack.

Everything is linear here: a column is the change of all drives' measured efforts per unit of one
coefficient, at one chunk of a recording, at full rate.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.terms import FullRate
from pprs_dynamics.inference.residuals.reconstruction import Reconstruction
from pprs_dynamics.physics.effects.added_body import AddedBody
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Effect, Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect, StructureEffect
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.mechanism.reversal import smooth_sign
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import PASSIVE_FRICTION, Forces
from pprs_dynamics.physics.model.keys import GAIN
from pprs_dynamics.system.parallel import each

# A number is moved by this share of itself: rounding and curvature are both below 1e-6 then.
RELATIVE_STEP = 1e-3
DEVIATIONS = 2.5
BLOCK = 200  # samples whose motion fits into a processor's cache, 10 kB each
HOMING_TIME = 0.01  # [s]; columns of wrong zeros change slowly between reversals
SLOWER = 4  # times as slowly do inertias
# Numbers by drive that act on it alone, and those of a 3-PPRS that act on a chain's slide and lift.
PER_DRIVE = ('friction.viscous', 'friction.coulomb', 'friction.offset', 'friction.drives.viscous',
             'friction.drives.coulomb')
PER_CHAIN = ('masses.slides', 'masses.lifts')
# Friction that turns over in another width than the model's is no effect: multiples of the
# width whose differences span what is between 0.2 and 5 times the model's.
DRIVE_WIDTHS = (0.2, 0.5, 2.0, 5.0)
PASSIVE_WIDTHS = (0.05, 0.25, 4.0)
# Names of columns; those of effects outside the drives have the effects' names.
NUMBERS, HOMING, PRESENT, BARE = 'numbers', 'homing', 'present ', 'bare '
INERTIA = 'inertia'
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


def model_numbers(model: DriveModel) -> tuple[Number, ...]:
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


def _unit(model: DriveModel, key: str, element: int | None) -> str:
    """Return the unit of a number; of a joint's, that of its kind."""
    turning, *pushing = model.keys[key].unit.split(', ')
    turns = element is None or element >= len(model.drives) or model.units[element].turns
    return turning if turns or not pushing else pushing[0]


class Sensitivities:
    """Columns that a model has, chunk by chunk.

    Bodies change the loads, and loads change friction: most columns are differences of the whole
    model at the same motion.

    Parameters
    ----------
    model : DriveModel
        Around which forces are linear.
    given : DriveModel
        As the user gave it: what it has already is no candidate, and its numbers are those that
        tolerances are about.

    Attributes
    ----------
    numbers : tuple of Number
    searched : tuple of type of StructureEffect
        Effects outside the drives that the given model could have and has not.
    each : callable
        Evaluates columns, in threads where they take long.
    of_zeros : bool
        Whether `HOMING` is computed.
    homing_stride : int
        Samples between those at which it is; 0: those within `HOMING_TIME`.
    """

    def __init__(self, model: DriveModel, given: DriveModel) -> None:
        self.model, self.given = model, given
        self.each: Callable[..., Iterable[Any]] = each if model.robot.structure is not None else map
        self.numbers = model_numbers(given)
        present = {effect.name for effect in given.effects}
        self.searched: tuple[type[StructureEffect], ...] = tuple(
            bound for effect in catalogue().values() if issubclass(effect, StructureEffect)
            and given.offers(effect) and effect.name not in present
            if issubclass(bound := given.bound(effect), StructureEffect) and bound.coefficients)
        self.of_zeros, self.homing_stride = any(
            effect.shifts_positions() and given.offers(effect)
            for effect in catalogue().values()), 0

    def restrict(self, effects: Container[type[CatalogueEffect]]) -> None:
        """Leave out columns that effects other than these would need."""
        self.searched = tuple(one for one in self.searched if one in effects)
        if not any(effect.shifts_positions() and effect in effects
                   for effect in catalogue().values()):
            self.of_zeros = False

    def columns(self, forces: Any) -> dict[str, Array]:
        """Return columns by name, (K, N, D) each.

        What a kind of model does not have is missing.

        - `NUMBERS`: per standard deviation by which each number grows away from 0.
        - `OF_DRIVES`: other widths of reversal in every drive, and a part that is the same in
          both directions.
        - `OF_JOINTS`: other widths of reversal in all passive joints.
        - `HOMING`: per metre that each drive is measured too far.
        - `INERTIA`: per acceleration that each drive is measured too much.
        - Names of `searched`: the coefficients of each effect.
        - `BARE` + name: the same with friction that does not follow the loads.
        - `PRESENT` + name: the coefficients of effects that the given model has.

        Parameters
        ----------
        forces : Forces
            Of the model at one chunk, before its sensors.
        """
        state: Any = forces.mechanism
        reference = self._efforts(self.model, state)
        columns = {NUMBERS: self._of_numbers(forces, reference), OF_DRIVES: self._sensed_each(
            reversal_columns(self.dry(state), state.velocity, state.direction,
                             np.asarray(self.model.reversal.velocity)), state)}
        for friction in (one for one in following(self.model) if one.name == PASSIVE_FRICTION):
            columns[OF_JOINTS] = self._sensed_each(
                passive_reversal_columns(friction, state), state)
        if self.of_zeros:
            columns[HOMING], columns[INERTIA] = self._of_misreadings(state)
        for effect in self.searched:
            columns[effect.name], bare = self._of_structure(effect, state, reference)
            if issubclass(effect, BodyEffect):
                columns[BARE + effect.name] = bare
        known = {effect.name for effect in self.given.effects}
        for present in self.model.effects:
            if isinstance(present, StructureEffect) and present.name in known:
                columns[PRESENT + present.name], bare = self._of_structure(
                    type(present), state, reference)
                if isinstance(present, BodyEffect):
                    columns[BARE + PRESENT + present.name] = bare
        return columns

    def dry(self, state: Any) -> Array:
        """Return the size of the drives' dry friction in full motion, (N, D) [N, N m]."""
        return self.model.friction.dry(state.friction_load)

    def _of_misreadings(self, state: Any) -> tuple[Array, Array]:
        """Return the changes per position, and per acceleration, that are measured too much.

        Of each drive, (D, N, D) each, evaluated at some samples, straight lines between.
        """
        every, stride = np.arange(len(state.velocity)), self.homing_stride
        if not stride:
            step = (HOMING_TIME if state.time is None or len(every) < 2
                    else float(np.median(np.diff(state.time))))
            stride = max(1, round(HOMING_TIME / step))
        samples = every[min(stride // 2, len(every) - 1)::stride]
        there, seldom = state[samples], state[samples[::SLOWER]]
        step = there.robot.position_step

        def efforts(drive: int, move: float) -> Array:
            return self._efforts(self.model, self._at(self.model, there.perturbed(drive, move)))

        def column(drive: int) -> Array:
            change = (efforts(drive, -step) - before) / step
            return np.stack([np.interp(every, samples, column) for column in change.T], axis=1)

        def inertia(drive: int) -> Array:
            change = still - self._at(self.model, seldom.accelerated(drive, 1.0)).rigid_force
            return np.stack([np.interp(every, samples[::SLOWER], column)
                             for column in change.T], axis=1)

        before, still = efforts(0, 0.0), self._at(self.model, seldom).rigid_force
        drives = range(len(self.model.drives))
        return np.stack(list(self.each(column, drives))), np.stack(list(self.each(inertia, drives)))

    def sensed(self, column: Array, state: Any) -> Array:
        """Return what the model's sensors make of a change of the drives' forces, (N, D)."""
        for effect in self.model.effects:
            if isinstance(effect, MeasurementEffect):
                column = effect.measured(column, state)
        return column

    def _sensed_each(self, columns: Iterable[Array], state: Any) -> Array:
        return np.stack([self.sensed(column, state) for column in columns])

    def _efforts(self, model: DriveModel, state: Any) -> Array:
        """Return efforts at a state, without effects that know their past."""
        total: Array = state.rigid_force + sum(
            effect.force(state) for effect in following(model))
        return total

    def _at(self, model: Any, state: Any) -> Any:
        """Return the same motion with the bodies and the reversals of another model."""
        found = replace(state.with_load(model.robot), load=None, reversal=model.reversal)
        for effect in model.effects:
            if isinstance(effect, BodyEffect):
                found = effect.apply(found)
        return found

    def drives_of(self, number: Number) -> list[int] | None:
        """Return the drives that a number of a list acts on, and no other of that list does.

        None where it may act on all. The others are moved at once.
        """
        if number.element is None:
            return None
        if number.key in PER_CHAIN:
            return [number.element, number.element + len(self.model.drives) // 2]
        return [number.element] if number.key in PER_DRIVE or number.key == GAIN else None

    @cached_property
    def _moved(self) -> dict[Number, DriveModel]:
        """The model with numbers away from 0 by `RELATIVE_STEP` of the given ones.

        Made once, not chunk by chunk; numbers of a list that act on drives of their own share one.
        """
        models: dict[tuple[str, int | None], DriveModel] = {}
        found = {}
        for number in self.numbers:
            alone = None if self.drives_of(number) else number.element
            place = (number.key, alone)
            if place not in models:
                value: Any = self.model.values[number.key]
                if isinstance(value, tuple):
                    value = tuple(
                        one + RELATIVE_STEP * given * (alone in (None, k)) for k, (one, given)
                        in enumerate(zip(value, self.given.values[number.key], strict=True)))
                else:
                    value += RELATIVE_STEP * number.value
                models[place] = DriveModel.from_parameters({**self.model.values, number.key: value})
            found[number] = models[place]
        return found

    def _of_numbers(self, forces: Any, reference: Array) -> Array:
        columns = np.zeros((len(self.numbers), *reference.shape))
        changes: dict[int, Array] = {}
        for row, number in enumerate(self.numbers):
            moved = id(self._moved[number])
            if moved not in changes:
                changes[moved] = self._change(number, forces, reference)
            drives = self.drives_of(number) or slice(None)
            columns[row][:, drives] = (changes[moved][:, drives] * number.deviation
                                       / (RELATIVE_STEP * abs(number.value)))
            columns[row] = self.sensed(columns[row], forces.mechanism)
        return columns

    def _change(self, number: Number, forces: Any, reference: Array) -> Array:
        """Return what a number moved by `RELATIVE_STEP` of itself changes, (N, D)."""
        moved, state = self._moved[number], forces.mechanism
        if number.key == GAIN:
            # The more torque an ampere gives, the fewer amperes the model's torque takes.
            given = np.asarray(self.given.values[number.key])
            return np.asarray(-forces.total * RELATIVE_STEP * given / self.model.gain)
        if number.key.startswith('friction.'):
            return self._efforts(moved, state.with_smoothing(moved.reversal)) - reference
        if number.key.startswith('geometry.'):
            state = moved.at_drives(state)
        return self._efforts(moved, self._at(moved, state)) - reference

    def _of_structure(self, effect: type[StructureEffect], state: Any, reference: Array,
                      ) -> tuple[Array, Array]:
        """Return columns per unit of each coefficient, around values that the model has.

        Block by block: all coefficients read the same motion, which the cache then holds.

        As the model says, and as they would be if friction did not follow the loads that the
        effect adds (a preloaded guide). Those of bodies are around none: `AddedBody.around` makes
        them exact for where one is.
        """
        present = next((one for one in self.model.effects if one.name == effect.name
                        and isinstance(one, StructureEffect)), None)
        if issubclass(effect, AddedBody) and effect in self.searched:
            present = None
        values = effect.to_coefficients(present.values) if present is not None else {}

        def of_block(rows: slice) -> tuple[list[Array], list[Array]]:
            part = self._part(state, rows)
            before = (None if issubclass(effect, BodyEffect)
                      else (effect.at(values) if present is None else present).force(part))

            def change(coefficient: Parameter) -> tuple[Array, Array]:
                step = coefficient.scale
                moved: Any = effect.at({**values, coefficient.name:
                                        values.get(coefficient.name, 0.0) + step})
                if before is not None:
                    more = (moved.force(part) - before) / step
                    return more, more
                found = moved.apply(part) if present is None else self._at(replace(
                    self.model, effects=tuple(moved if effect is present else effect
                                              for effect in self.model.effects)), part)
                return ((self._efforts(self.model, found) - reference[rows]) / step,
                        (found.rigid_force - part.rigid_force) / step)

            full, bare = zip(*map(change, effect.coefficients), strict=True)
            return list(full), list(bare)

        size = BLOCK if self.model.robot.structure is not None else len(reference)
        full, bare = (np.concatenate(blocks, axis=1) for blocks in zip(*self.each(
            of_block, (slice(first, first + size) for first in range(0, len(reference), size))),
            strict=True))
        return self._sensed_each(full, state), self._sensed_each(bare, state)

    @staticmethod
    def _part(state: Any, rows: slice) -> Any:
        """Return some samples of a motion, with their kinematics as they are known."""
        return replace(state[rows], known=state.links.part(rows)) if isinstance(
            state.links, LinkMotion) else state


def following(model: DriveModel) -> list[Effect]:
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
    return np.stack([friction.force(state.with_smoothing(replace(
        state.reversal, rate=factor * state.reversal.rate,
        slide=factor * state.reversal.slide))) - before
        for factor in PASSIVE_WIDTHS])


class Column(NamedTuple):
    """Key of columns in a table, next to parts and variables."""

    name: str


def stacked_columns(tables: list[dict[Any, Array]]) -> dict[str, Array]:
    """Take the columns out of tables, (k, D, M) each by name."""
    stacked: dict[str, Array] = {}
    for key in [key for key in tables[0] if isinstance(key, Column)]:
        stacked[key.name] = np.concatenate([table.pop(key) for table in tables]).transpose(1, 2, 0)
    return stacked


class ColumnCollector:
    """Called chunk by chunk: gives columns to be treated, and keeps what drives did."""

    def __init__(self, sensitivities: Sensitivities, reconstruction: Reconstruction) -> None:
        self.sensitivities = sensitivities
        # A gain changes nothing of efforts that were not recorded as currents.
        self.without_gain = [k for k, number in enumerate(sensitivities.numbers)
                             if number.key == GAIN
                             and np.isnan(reconstruction.gain[number.element])]
        self.share = reconstruction.recorded_share(sensitivities.model)
        self.sensors = [effect.name for effect in sensitivities.model.effects
                        if isinstance(effect, MeasurementEffect)]
        self.kept: list[tuple[Array, ...]] = []

    def __call__(self, forces: Forces) -> dict[Column, Array]:
        s: Any = forces.mechanism
        effort = forces.total - sum((forces.parts[name] for name in self.sensors),
                                    np.zeros_like(forces.total))
        self.kept.append((s.velocity, s.acceleration, s.direction, s.friction_load,
                          s.transmitted, effort))
        columns = self.sensitivities.columns(forces)
        columns[NUMBERS][self.without_gain] = 0.0
        # Views: copies of all columns at full rate would take longer than their means.
        return {Column(name): (column if np.all(self.share == 1) else self.share * column)
                .transpose(1, 0, 2) for name, column in columns.items()}

    def full_rate(self, reconstruction: Reconstruction) -> FullRate:
        """Return what the drives did, with positions as the mechanism has them."""
        velocity, acceleration, direction, load, transmitted, effort = (
            np.concatenate(arrays) for arrays in zip(*self.kept, strict=True))
        return FullRate(
            reconstruction.time, reconstruction.position, velocity, acceleration, direction, load,
            transmitted, effort, reconstruction.effort, reconstruction.segments,
            reconstruction.treat, reconstruction.start, reconstruction.channels)
