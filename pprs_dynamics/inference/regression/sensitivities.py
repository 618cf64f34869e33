# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Derivatives of a model's forces by its own numbers and by effects that it may lack.

Everything is linear here: a column is the change of all drives' measured efforts per unit of one
coefficient, at one chunk of a recording, at full rate.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, islice
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.inference.regression.terms import FullRate
from pprs_dynamics.inference.residuals.reconstruction import Reconstruction
from pprs_dynamics.measurement.motion.treatment import Treatment, bandwidth
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Effect
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.effects.structure_effect import AddedBody, BodyEffect, StructureEffect
from pprs_dynamics.physics.mechanism.state import smooth_sign
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces
from pprs_dynamics.physics.model.keys import GAIN

# A number is moved by this share of itself, a coefficient by this share of its scale: rounding
# and curvature are both below 1e-6 then.
RELATIVE_STEP = 1e-3
POSITION_STEP = 1e-5  # [m, rad] of a drive
DEVIATIONS = 2.5
# Of slow columns, see `Samples`; friction of a closed form turns where loads change sign.
NODES_PER_PERIOD, GUIDE_NODES = 40, 120
# Numbers by drive that act on it alone, and those of a 3-PPRS that act on a chain's slide and lift.
PER_DRIVE = ('friction.viscous', 'friction.coulomb', 'friction.offset', 'friction.drives.viscous',
             'friction.drives.coulomb')
PER_CHAIN = ('masses.slides', 'masses.lifts')
# Friction that turns over in another width than the model's is no effect: multiples of the
# width whose differences span what is between 0.2 and 5 times the model's.
DRIVE_WIDTHS = (0.2, 0.5, 2.0, 5.0)
PASSIVE_WIDTHS = (0.05, 0.25, 4.0)
# Names of columns; those of effects outside the drives have the effects' names.
NUMBERS, HOMING, PRESENT, INERTIA = 'numbers', 'homing', 'present ', 'inertia'
OF_DRIVES, OF_JOINTS, BY_FRICTION = 'drive widths', 'passive widths', 'loads by friction'


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
        found += [Number(key, element, value, abs(value) * tolerance / DEVIATIONS,
                         _unit(model, key, element)) for element, value in elements if value]
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
    effects : container of type of CatalogueEffect, optional
        The only ones whose columns are computed; by default all that the model may have.
    known : collection of str, optional
        Names of columns that are not computed.

    Attributes
    ----------
    numbers : tuple of Number
    searched : tuple of type of StructureEffect
        Effects outside the drives that the given model could have and has not.
    of_zeros : bool
        Whether `HOMING` is needed.
    """

    def __init__(self, model: DriveModel, given: DriveModel,
                 effects: Container[type[CatalogueEffect]] | None = None,
                 known: Collection[str] = ()) -> None:
        self.model, self.given, self.known = model, given, known
        self.numbers = model_numbers(given)
        present = {effect.name for effect in given.effects}
        offered = [given.bound(effect) for effect in catalogue().values() if given.offers(effect)]
        if effects is not None:
            offered = [effect for effect in offered if effect in effects]
        self.searched = tuple(
            effect for effect in offered if issubclass(effect, StructureEffect)
            and effect.name not in present and effect.coefficients)
        self.of_zeros = any(effect.shifts_positions() for effect in offered)
        self._steps: dict[type[BodyEffect], list[BodyEffect]] = {}  # by coefficient
        self._own: tuple[Any, Array] = None, np.empty(0)  # state, and efforts of the model there

    def columns(self, forces: Any, treat: Treatment) -> dict[str, Array]:
        """Return treated columns by name, (M, K, D) each.

        What a kind of model does not have is missing.

        - `NUMBERS`: per standard deviation by which each number grows away from 0.
        - `OF_DRIVES`: other widths of reversal in every drive, and a part that is the same in
          both directions.
        - `OF_JOINTS`: other widths of reversal in all passive joints.
        - `BY_FRICTION`: friction that follows the loads by friction of passive joints, too.
        - `HOMING`: per metre that each drive is measured too far.
        - `INERTIA`: per acceleration that each drive is measured too much.
        - Names of `searched`: the coefficients of each effect.
        - `PRESENT` + name: the coefficients of effects that the given model has.

        Parameters
        ----------
        forces : Forces
            Of the model at one chunk, before its sensors.
        treat : Treatment
            For its samples.
        """
        state: Any = forces.mechanism
        slow = samples = Samples.of(
            state, treat, [effect for effect in self.model.effects
                           if isinstance(effect, MeasurementEffect)],
            GUIDE_NODES if state.robot.has_guides else NODES_PER_PERIOD)
        if state.robot.has_guides:
            # Friction follows the loads of the guides: splines would be 1 % off.
            samples = replace(slow, at=np.arange(len(state.velocity)), nodes=state)
        there = {effect.name for effect in self.given.effects}
        effects = {name: effect for name, effect in {
            **{effect.name: effect for effect in self.searched},
            **{PRESENT + effect.name: type(effect) for effect in self.model.effects
               if isinstance(effect, StructureEffect) and effect.name in there}}.items()
            if name not in self.known}
        bodies = {name: effect for name, effect in effects.items()
                  if issubclass(effect, BodyEffect)}
        nodes, columns = samples.nodes, {}
        states = {name: self._with_bodies(body, nodes) for name, body in bodies.items()}
        if NUMBERS not in self.known:
            states[NUMBERS] = [self._at(moved, nodes) for moved in self._heavier]
        if OF_DRIVES not in self.known:
            columns[OF_DRIVES] = samples.treated(reversal_columns(
                self.dry(state), state.velocity, state.direction,
                np.multiply.outer(DRIVE_WIDTHS, self.model.reversal.velocity)))
            for friction in self.model.effects:
                if isinstance(friction, ModelJointFriction):
                    columns[OF_JOINTS] = samples.treated(
                        [*passive_reversal_columns(friction, state)])
                    columns[BY_FRICTION] = samples.treated(self._under_friction(friction, state))
        together = nodes.robot.under_loads(nodes, [*chain.from_iterable(states.values())])
        changes = {name: [self._efforts(self.model, loaded) - self._own_efforts(nodes)
                          for loaded in islice(together, len(group))]
                   for name, group in states.items()}
        if NUMBERS in changes:
            columns[NUMBERS] = self._of_numbers(forces, samples, changes[NUMBERS])
        for name, body in bodies.items():
            columns[name] = samples.interpolated(changes[name]) / np.array(
                [[RELATIVE_STEP * c.scale] for c in body.coefficients])
        if self.of_zeros and HOMING not in self.known:
            columns[HOMING], columns[INERTIA] = map(
                replace(slow, sensors=[]).interpolated, self._of_shifted_positions(slow.nodes))
        for name, effect in effects.items():
            if name not in bodies:
                columns[name] = samples.treated(self._of_forces(effect, state))
        return columns

    def _under_friction(self, friction: ModelJointFriction, state: Any) -> list[Array]:
        """Return the friction by loads that friction itself adds, (N, D) [N]."""
        load = state.robot.load_of_friction(state, friction.table(state.robot, state.reversal))
        if load is None:
            return []
        loaded = state.with_load(state.robot, load)
        return [self._efforts(self.model, loaded) - loaded.rigid_force
                - self._own_efforts(state) + state.rigid_force]

    def dry(self, state: Any) -> Array:
        """Return the size of the drives' dry friction in full motion, (N, D) [N, N m]."""
        return self.model.friction.dry(state.friction_load)

    def _of_shifted_positions(self, state: Any) -> tuple[list[Array], list[Array]]:
        """Return the changes per position, and per acceleration, that are measured too much.

        Of each drive, (N, D) each.
        """
        before = self._own_efforts(state)
        return ([(self._efforts(
            self.model, self._at(self.model, state.perturbed(drive, -POSITION_STEP)))
                  - before) / POSITION_STEP for drive in range(len(self.model.drives))],
                [*-state.robot.inertia(state)])

    def _efforts(self, model: DriveModel, state: Any) -> Array:
        """Return efforts at a state, without effects that know their past."""
        total: Array = state.rigid_force + sum(
            effect.force(state) for effect in following(model))
        return total

    def _own_efforts(self, state: Any) -> Array:
        if self._own[0] is not state:
            self._own = state, self._efforts(self.model, state)
        return self._own[1]

    def _at(self, model: Any, state: Any) -> Any:
        """Return a motion with the bodies and the reversals of another model."""
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
                        now + RELATIVE_STEP * given * (alone in (None, k)) for k, (now, given)
                        in enumerate(zip(value, self.given.values[number.key], strict=True)))
                else:
                    value += RELATIVE_STEP * number.value
                models[place] = DriveModel.from_parameters({**self.model.values, number.key: value})
            found[number] = models[place]
        return found

    @cached_property
    def _heavier(self) -> list[DriveModel]:
        """The models with moved numbers of bodies."""
        return [*{id(moved): moved for number, moved in self._moved.items() if number.key != GAIN
                  and not number.key.startswith(('friction.', 'geometry.'))}.values()]

    def _of_numbers(self, forces: Any, samples: Samples, heavier: Sequence[Array]) -> Array:
        """Return the columns of all numbers, (M, K, D), with the changes by `_heavier`."""
        columns = np.zeros((len(samples.treat), len(self.numbers), len(self.model.drives)))
        changes = {id(moved): samples.interpolated([change])[:, 0]
                   for moved, change in zip(self._heavier, heavier, strict=True)}
        for row, number in enumerate(self.numbers):
            moved = self._moved[number]
            if id(moved) not in changes:
                changes[id(moved)] = self._change(number, moved, forces, samples)[:, 0]
            drives = self.drives_of(number) or slice(None)
            columns[:, row, drives] = (changes[id(moved)][:, drives] * number.deviation
                                       / (RELATIVE_STEP * abs(number.value)))
        return columns

    def _change(self, number: Number, moved: DriveModel, forces: Any, samples: Samples) -> Array:
        """Return the change of the forces by `RELATIVE_STEP` of a number, (M, 1, D)."""
        state = forces.mechanism
        if number.key == GAIN:
            # The more torque an ampere gives, the fewer amperes the model's torque takes.
            given = np.asarray(self.given.values[number.key])
            return samples.treated([-forces.total * RELATIVE_STEP * given / self.model.gain])
        if number.key.startswith('friction.'):
            found = state.with_smoothing(moved.reversal)
        else:  # of the geometry: with it friction turns over at other times
            found = self._at(moved, moved.mechanism(state))
        return samples.treated([self._efforts(moved, found) - self._own_efforts(state)])

    def _present(self, effect: type[StructureEffect]) -> StructureEffect | None:
        """Return an effect as the model has it."""
        return next((present for present in self.model.effects if present.name == effect.name
                     and isinstance(present, StructureEffect)), None)

    def _of_forces(self, effect: type[StructureEffect], state: Any) -> list[Array]:
        """Return columns of an effect that adds forces, per unit of each coefficient.

        Around the values that the model has.
        """
        present = self._present(effect)
        values = {} if present is None else effect.to_coefficients(present.values)
        before = (effect.at(values) if present is None else present).force(state)
        return [(effect.at({**values, c.name: values.get(c.name, 0.0) + c.scale}).force(state)
                 - before) / c.scale for c in effect.coefficients]

    def _with_bodies(self, effect: type[BodyEffect], state: Any) -> list[Any]:
        """Return the state with an effect on bodies, one for a step of each coefficient.

        Around the values that the model has, but those of added bodies are around none:
        `AddedBody.around` makes them exact for where one is.
        """
        present = self._present(effect)
        if issubclass(effect, AddedBody) and effect in self.searched:
            present = None
        if effect not in self._steps:
            values = {} if present is None else effect.to_coefficients(present.values)
            self._steps[effect] = [effect.at({
                **values, c.name: values.get(c.name, 0.0) + RELATIVE_STEP * c.scale})
                for c in effect.coefficients]
        return [moved.apply(state) if present is None else self._at(replace(
            self.model, effects=tuple(moved if other is present else other
                                      for other in self.model.effects)), state)
                for moved in self._steps[effect]]


@dataclass(frozen=True)
class Samples:
    """A chunk of a motion, and the samples of it at which slow columns are evaluated.

    Columns of bodies follow the motion: cubic splines through nodes represent them.
    Friction turns over within a few samples.

    Parameters
    ----------
    state : MechanismState
        Of all N samples.
    treat : Treatment
        For these.
    sensors : list of MeasurementEffect
        Through which columns are seen.
    at : (S,) int array
        The nodes.
    nodes : MechanismState
        There.
    """

    state: Any
    treat: Treatment
    sensors: Sequence[MeasurementEffect]
    at: Integers
    nodes: Any

    @classmethod
    def of(cls, state: Any, treat: Treatment, sensors: Sequence[MeasurementEffect],
           per_period: int) -> Samples:
        """Return the samples of a motion, with so many nodes per period of its fastest part."""
        count = len(state.velocity)
        period = min(1 / max(bandwidth(state.acceleration), 1e-300), count)
        stride = int(period / per_period)
        if stride < 2:
            return cls(state, treat, sensors, np.arange(count), state)
        at = np.round(np.linspace(0, count - 1, -(-(count - 1) // stride) + 1)).astype(int)
        links = state.links
        return cls(state, treat, sensors, at, replace(
            state[at], known=replace(links, rows=links.rows[at])))

    def treated(self, columns: Sequence[Array]) -> Array:
        """Return columns (N, D) as sensors show them, treated, (M, K, D)."""
        if not len(columns):
            return np.zeros((len(self.treat), 0, self.state.velocity.shape[1]))
        for sensor in self.sensors:
            columns = [sensor.measured(column, self.state) for column in columns]
        return self.treat(np.stack(columns, axis=1))

    def interpolated(self, columns: Sequence[Array]) -> Array:
        """Return columns (S, D) at the nodes likewise."""
        if self.nodes is self.state:
            return self.treated(columns)
        spline = make_interp_spline(self.at, np.stack(columns, axis=1))
        weights = BSpline.design_matrix(np.arange(len(self.state.velocity)), spline.t, spline.k)
        if not self.sensors:
            weights = self.treat.matrix @ weights
        found: Array = np.asarray(weights @ spline.c.reshape(len(self.at), -1))
        found = found.reshape(-1, *spline.c.shape[1:])
        return self.treated([*found.swapaxes(0, 1)]) if self.sensors else found


def following(model: DriveModel) -> list[Effect]:
    """Return the effects whose forces follow from a state: no bodies, sensors or memories."""
    return [effect for effect in model.effects
            if not effect.is_measurement and not isinstance(effect, BodyEffect)
            and effect.initial_memory() is None]


def reversal_columns(dry: Array, velocity: Array, direction: Array, widths: Array,
                     even: Array | float = 0.0) -> list[Array]:
    """Return changes of dry friction by another width of reversal, (N, D) each.

    Parameters
    ----------
    dry : (N, D) array
        Its size in full motion [N].
    velocity, direction : (N, D) array
        [m/s], and its sgn as the model has it.
    widths : (W,) or (W, D) array
        Other widths of the sgn [m/s].
    even : (N, D) array, optional
        What is in proportion to the square of the sgn [N].

    Returns
    -------
    list
        A column for each width; and an even one, for friction that differs by direction while
        it turns over.
    """
    signs = [smooth_sign(velocity, width) for width in widths]
    return [*(dry * (sign - direction) + even * (sign ** 2 - direction ** 2) for sign in signs),
            dry * (1 - np.abs(direction))]


def passive_reversal_columns(friction: Effect, state: Any) -> Array:
    """Return changes of passive friction by another width of reversal, (W, N, D) [N].

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
    """Called chunk by chunk: returns treated columns, and stores what drives did."""

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

    def __call__(self, forces: Forces, treat: Treatment) -> dict[Column, Array]:
        s: Any = forces.mechanism
        effort = forces.total - sum((forces.parts[name] for name in self.sensors),
                                    np.zeros_like(forces.total))
        self.kept.append((s.velocity, s.acceleration, s.direction, s.friction_load,
                          s.transmitted, effort))
        columns = self.sensitivities.columns(forces, treat)
        if NUMBERS in columns:
            columns[NUMBERS][:, self.without_gain] = 0.0
        return {Column(name): self.share * column for name, column in columns.items()}

    def full_rate(self, reconstruction: Reconstruction) -> FullRate:
        """Return the motion of the drives, with the positions of the mechanism."""
        velocity, acceleration, direction, load, transmitted, effort = (
            np.concatenate(arrays) for arrays in zip(*self.kept, strict=True))
        return FullRate(
            reconstruction.time, reconstruction.position, velocity, acceleration, direction, load,
            transmitted, effort, reconstruction.effort, reconstruction.segments,
            reconstruction.treat, reconstruction.start, reconstruction.channels)
