# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects that act in single drives, each with its own parameters."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.effects.effect import CatalogueEffect, names
from pprs_dynamics.physics.mechanism.state import MECHANISM, PLATFORM, SLIDE, MechanismState

# Standard deviation of real exponents from 1: friction of a Hertzian contact grows with the power
# 2/3 of the load (Johnson, Contact Mechanics, 1985), that of rolling with up to 4/3.
EXPONENTS = 1 / 3
LEAST_SHARE = 1e-3  # of the usual size, below which the logarithm goes no further
ALONE = 'drive'  # name of one whose name does not matter


def other_exponent(quantity: Array, column: Array) -> Array:
    """Return the change of a column by an exponent above 1, to first order.

    Parameters
    ----------
    quantity : (N,) array
        Load or speed, of any sign, to which the column is in proportion.
    column : (N,) array
    """
    size = np.abs(quantity)
    usual = np.sqrt(np.mean(size ** 2)) or 1.0
    return EXPONENTS * np.log(np.maximum(size / usual, LEAST_SHARE)) * column


@dataclass(frozen=True)
class DriveSamples:
    """Samples of one drive, (N,) each.

    Parameters
    ----------
    time : (N,) array or None
        None where unknown [s].
    position, velocity, acceleration : (N,) arrays
    direction : (N,) array
        sgn of the velocity.
    friction_load : (N,) array
        Load of its guide or gear, without a sign [N, N m].
    transmitted : (N,) array
        Load on the mechanism through gear or screw, without friction [N, N m].
    memory : object, optional
    channels : mapping of str to (N,) array
        Further measurements, such as `temperature` [degC].
    """

    time: Array | None
    position: Array
    velocity: Array
    acceleration: Array
    direction: Array
    friction_load: Array
    transmitted: Array
    memory: Any = None
    channels: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, state: MechanismState, drive: int, memory: Any = None) -> DriveSamples:
        """Return the samples of one drive of a state."""
        return cls(state.time, state.position[:, drive], state.velocity[:, drive],
                   state.acceleration[:, drive], state.direction[:, drive],
                   state.friction_load[:, drive], state.transmitted[:, drive], memory,
                   {name: values[:, drive] for name, values in state.channels.items()})


@dataclass(frozen=True)
class DriveRange:
    """Range that a recording covers, from which grids of shape parameters are made.

    Parameters
    ----------
    duration, step : float
        Of the recording, and between samples [s].
    stroke : float
        Between the lowest and the highest position [m, rad].
    top_speed : float
        [m/s, rad/s]
    gear_ratio : float
        Turns of the motor per turn of the drive; 1 where no gear is known.
    delay : float
        By which the measured effort is most like the model's [s].
    turns : bool
        Whether the drive is revolute.
    is_loaded : bool
        Whether its guide or gear carries anything that is known.
    channels : mapping of str to (lowest, highest)
        Further measurements, such as `temperature` [degC].
    middle : float
        Of the stroke [m, rad].
    """

    duration: float
    step: float
    stroke: float
    top_speed: float
    gear_ratio: float = 1.0
    delay: float = 0.0
    turns: bool = False
    is_loaded: bool = True
    channels: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    middle: float = 0.0


@dataclass(frozen=True)
class Windup:
    """Measurement of a drive by a second encoder on the link.

    Parameters
    ----------
    compliance, loss : float
        Wind-up per load [m/N, rad/(N m)], and by how much it is behind it [s].
    explained : float
        Share of the load's variance that the wind-up explains.
    """

    compliance: float
    loss: float
    explained: float


class DriveEffect(CatalogueEffect):
    """An effect that acts in drives, each with its own parameters.

    Its force is linear in the coefficients: the sum of coefficient times column. What is not
    linear (`shape`) enters the columns.

    Class attributes
    ----------------
    is_smooth : bool
        True where columns at mean positions are nearly the means of columns.
    """

    acts_in = frozenset({PLATFORM, SLIDE, MECHANISM})
    is_smooth: ClassVar[bool] = False

    def __init__(self, drives: Mapping[str, Mapping[str, float]]) -> None:
        self.drives = {drive: dict(values) for drive, values in drives.items()}

    @classmethod
    @abstractmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return one (N,) column per coefficient, for one drive.

        An effect with memory finds it in `drive.memory` and advances it to the last sample.
        """

    @classmethod
    def deviations(cls, drive: DriveSamples, **shape: float) -> tuple[tuple[Array, ...], ...]:
        """Return how real forms depart from this one: per deviation, a change of each column.

        They take part in every fit of the effect, in proportion to its force, with coefficients
        of unit prior, so that they can neither make an effect nor hide another.
        """
        return ()

    @classmethod
    def may_show(cls, covered: DriveRange) -> bool:
        """Return whether a recording has what the effect follows; it costs no time where not."""
        return True

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return the shape parameters to try first; they are refined from the best of them on."""
        return ({},)

    @classmethod
    def averaged(cls, drive: DriveSamples, period: float,
                 shapes: Sequence[Mapping[str, float]]) -> Array | None:
        """Return columns of `scanned` for many shapes from means over `period`, (S, k, N).

        Those of the means where the effect `is_smooth`, else None: then every sample is used.
        """
        if not cls.is_smooth:
            return None
        scanned = [coefficient.name in cls.scanned for coefficient in cls.coefficients]
        return np.stack([np.stack(cls.columns(drive, **shape))[scanned] for shape in shapes])

    @classmethod
    def drive_memory(cls, start: float | None = None) -> Any:
        """Return a fresh memory of one drive, or None for an effect without one.

        Parameters
        ----------
        start : float, optional
            When the recording began [s]; the first samples that are evaluated may be later, since
            derivatives need a window.
        """
        return None

    def initial_memory(self, start: float | None = None) -> Any:
        """Return a fresh memory per drive, or None for an effect without one."""
        if self.drive_memory() is None:
            return None
        return {drive: self.drive_memory(start) for drive in self.drives}

    def continued_memory(self, fresh: Any, before: Any) -> Any:
        """Return the memories of drives that were there before, and fresh ones of others."""
        return None if fresh is None else {
            drive: before.get(drive, memory) for drive, memory in fresh.items()}

    def check_memory(self, memories: Mapping[str, Any]) -> None:
        """Raise ModelError if memories, by effect, do not fit these drives."""
        super().check_memory(memories)
        memory = memories[self.name]
        if memory is not None and set(memory) != set(self.drives):
            raise ModelError('state', sorted(memory), f'come from a model with this very '
                             f'{self.name}')

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the effect's drive forces [N], (N, D)."""
        force = np.zeros_like(state.velocity)
        for name, values in self.drives.items():
            index = state.drives.index(name)
            samples = DriveSamples.of(state, index, None if memory is None else memory[name])
            columns = self.columns(samples, **{p.name: values[p.name] for p in self.shape})
            coefficients = self.to_coefficients(values)
            for coefficient, column in zip(self.coefficients, columns, strict=True):
                force[:, index] += coefficients[coefficient.name] * column
        return force

    @classmethod
    def checked(cls, values: Mapping[str, Any], is_complete: bool = True,
                turning: Collection[str] = ()) -> Mapping[str, Any]:
        """Return the checked parameters of each drive from `{'drive.parameter': value}`."""
        prefix = f'effects.{cls.name}'
        blocks: dict[str, dict[str, Any]] = {}
        for key, value in values.items():
            drive, _, name = key.rpartition('.')
            blocks.setdefault(drive, {})[name] = value
        if not blocks or '' in blocks:
            raise ModelError(prefix, dict(values), 'map drives to parameters, e.g. lift_1: '
                             f'{{{names(cls.parameters)}}}')
        return {drive: cls._checked(f'{prefix}.{drive}', block, is_complete, drive in turning)
                for drive, block in blocks.items()}


class MeasurementEffect(DriveEffect):
    """Systematic error of a drive's sensors. It never enters a command.

    Class attributes
    ----------------
    not_linear_in : tuple of str
        Coefficients to which errors of positions are not in proportion.
    late_by : str
        Parameter by which efforts are measured late [s]; empty: at once.
    """

    is_measurement = True
    late_by: ClassVar[str] = ''
    not_linear_in: ClassVar[tuple[str, ...]] = ()
    # Whether its errors of positions are smooth functions of the position alone.
    is_of_position: ClassVar[bool] = False

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return no force: the drive does not feel its sensors."""
        return tuple(np.zeros_like(drive.velocity) for _ in cls.coefficients)

    @classmethod
    def sense(cls, effort: Array, drive: DriveSamples, **parameters: float) -> Array:
        """Return the measured effort of one drive that applies `effort`, (N,) [N].

        An effect with memory finds it in `drive.memory` and advances it to the last sample.
        """
        return effort

    @classmethod
    def sensor_columns(cls, effort: Array, drive: DriveSamples, **shape: float,
                       ) -> tuple[Array, ...]:
        """Return the sensor's change of an effort per coefficient, (N,) each.

        An effect without coefficients gives one column: what its shape says.

        Parameters
        ----------
        effort : (N,) array
            Of the drive, as the sensor would show it without the effect [N].
        drive : DriveSamples
        """
        units = [{c.name: float(c is unit) for c in cls.coefficients}
                 for unit in cls.coefficients or (None,)]
        return tuple(cls.sense(effort, drive, **cls.from_coefficients(unit), **shape) - effort
                     for unit in units)

    @classmethod
    def sensor_deviations(cls, effort: Array, drive: DriveSamples, **shape: float,
                          ) -> tuple[Array, ...]:
        """Return departures of real sensors from the law, (N,) each; see `deviations`."""
        return ()

    @classmethod
    def sizes_seen(cls, windup: Windup) -> Mapping[str, float]:
        """Return how large coefficients are by a second encoder on the link, none by default."""
        return {}

    @classmethod
    @cache
    def shifts_positions(cls) -> bool:
        """Return whether measured positions are not the true ones: all drives feel that."""
        unit = cls({ALONE: {p.name: p.scale for p in cls.parameters}})
        return bool(np.any(unit.position_error((ALONE,), np.zeros((1, 1))))
                    or np.any(unit.loaded_position_error((ALONE,), np.ones((1, 1)))))

    def by_drive(self, drives: Sequence[str], values: Array,
                 change: Callable[[Array, dict[str, float]], Array]) -> Array:
        """Return changes of the values of the drives that have the effect, (N, D), else 0.

        Parameters
        ----------
        drives : sequence of str
        values : (N, D) array
        change : callable
            From values (N,) and parameters of a drive to its changes (N,).
        """
        found = np.zeros_like(values)
        for name, parameters in self.drives.items():
            if name in drives:
                k = drives.index(name)
                found[:, k] = change(values[:, k], parameters)
        return found

    def position_error(self, drives: Sequence[str], position: Array) -> Array:
        """Return the errors of measured positions, to be subtracted, (N, D) [m, rad].

        Parameters
        ----------
        drives : sequence of str
        position : (N, D) array
            Consecutive samples as measured: velocities and accelerations have the error's.
        """
        return np.zeros_like(position)

    def loaded_position_error(self, drives: Sequence[str], transmitted: Array) -> Array:
        """Return the errors of measured positions that loads make, (N, D) [m, rad].

        They are not those of a motion: velocities and accelerations are as measured.

        Parameters
        ----------
        drives : sequence of str
        transmitted : (N, D) array
            What gears or screws pass on to the mechanism [N, N m].
        """
        return np.zeros_like(transmitted)

    def windup_error(self, drives: Sequence[str], transmitted: Array, windup: Array) -> Array:
        """Return the errors of second encoders apart from `loaded_position_error`, (3, N, D).

        Errors of position, velocity and acceleration; by default none.

        Parameters
        ----------
        drives : sequence of str
        transmitted : (N, D) array
            What gears or screws pass on to the mechanism [N, N m].
        windup : (3, N, D) array
            Position less that of the link, and its rates; 0 in drives without a second encoder.
        """
        return np.zeros_like(windup)

    def measured(self, effort: Array, state: MechanismState, memory: Any = None) -> Array:
        """Return the measured effort where the drives apply `effort`, (N, D) [N]."""
        measured = effort.copy()
        for name, parameters in self.drives.items():
            k = state.drives.index(name)
            samples = DriveSamples.of(state, k, None if memory is None else memory[name])
            measured[:, k] = self.sense(effort[:, k], samples, **parameters)
        return measured
