"""What an effect is: a share of the drive forces, with parameters that it declares once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.errors import MISSING, ModelError
from pprs_dynamics.mechanism.robot import DRIVES, Array
from pprs_dynamics.mechanism.state import MechanismState


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect; files, ROS descriptors, tables and labels all read this.

    Parameters
    ----------
    name, symbol, unit, description : str
    lower, upper : float
        Bounds, both allowed.
    default : float, optional
        Value where a model file is silent; required in the file without one.
    """

    name: str
    symbol: str
    unit: str
    description: str
    lower: float
    upper: float
    default: float | None = None

    def check(self, key: str, value: Any) -> float:
        """Return `value` as a float within the bounds, or raise ModelError naming `key`."""
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ModelError(key, value, 'be a number')
        # Bounds are finite, so that what lies within is, too.
        if not self.lower <= value <= self.upper:
            raise ModelError(key, value, f'lie in [{self.lower:g}, {self.upper:g}] '
                             f'{self.unit} ({self.description})')
        return float(value)


class Effect(ABC):
    """A share of the drive forces. Positive is what the drive must apply more.

    Class attributes
    ----------------
    name : str
        Name in files, topics and reports.
    is_measurement : bool
        True where it describes what the sensor says, not what the drive must do: it enters
        comparisons and the monitor, never a command.
    """

    name: ClassVar[str]
    is_measurement: ClassVar[bool] = False

    @abstractmethod
    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the effect's drive forces [N], (N, 6).

        Parameters
        ----------
        state : MechanismState
        memory : object, optional
            What `initial_memory` returned, advanced in place to the last sample.
        """

    def initial_memory(self) -> Any:
        """Return a fresh memory, or None for an effect without one."""
        return None

    def check_memory(self, memories: Mapping[str, Any]) -> None:
        """Raise ModelError where memories, by effect, were not made for this one."""
        fresh = self.initial_memory()
        memory = memories.get(self.name, MISSING)
        if memory is MISSING or (isinstance(fresh, dict) and set(fresh) != set(memory or ())):
            raise ModelError('state', sorted(memories),
                             f'come from a model with this very {self.name}')


class CatalogueEffect(Effect):
    """An effect that a model file may add under `effects`, with values for its parameters.

    Class attributes
    ----------------
    parameters : tuple of Parameter
    """

    parameters: ClassVar[tuple[Parameter, ...]]

    @classmethod
    @abstractmethod
    def from_file(cls, values: Mapping[str, Any], complete: bool = True) -> CatalogueEffect:
        """Build the effect from its block in a model file, or raise ModelError.

        With `complete` false, values may be missing and the result only says that those given
        are right: a node gets an effect's parameters one by one before it becomes active.
        """

    @classmethod
    def _checked(cls, prefix: str, values: Any, complete: bool) -> dict[str, float]:
        if not isinstance(values, Mapping):
            raise ModelError(prefix, values, f'map {_names(cls.parameters)} to numbers')
        known = {parameter.name: parameter for parameter in cls.parameters}
        for name in values:
            if name not in known:
                raise ModelError(f'{prefix}.{name}', values[name],
                                 f'not be there: {cls.name} has {_names(cls.parameters)}')
        checked = {}
        for name, parameter in known.items():
            if name not in values and parameter.default is None:
                if not complete:
                    continue
                raise ModelError(f'{prefix}.{name}', MISSING,
                                 f'be given ({parameter.description} [{parameter.unit}])')
            checked[name] = parameter.check(f'{prefix}.{name}', values.get(name, parameter.default))
        return checked


class DriveEffect(CatalogueEffect):
    """An effect that acts in drives, each with its own parameters.

    Its force is linear in the parameters called `linear`: the sum of coefficient times column.
    What is not linear (`shape`) enters the columns.
    """

    linear: ClassVar[tuple[Parameter, ...]]
    shape: ClassVar[tuple[Parameter, ...]] = ()

    def __init_subclass__(cls) -> None:
        if hasattr(cls, 'linear'):
            cls.parameters = cls.linear + cls.shape

    def __init__(self, drives: Mapping[str, Mapping[str, float]]) -> None:
        self.drives = {drive: dict(values) for drive, values in drives.items()}

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash((self.name, tuple(self.drives)))

    @abstractmethod
    def columns(self, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return one (N,) column per linear parameter, for one drive."""

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the effect's drive forces [N], (N, 6)."""
        force = np.zeros_like(state.velocity)
        for name, values in self.drives.items():
            index = DRIVES.index(name)
            samples = DriveSamples(
                state.time, state.position[:, index], state.velocity[:, index],
                state.acceleration[:, index], state.direction[:, index],
                state.guide_load[:, index], None if memory is None else memory[name])
            columns = self.columns(samples, **{p.name: values[p.name] for p in self.shape})
            for parameter, column in zip(self.linear, columns, strict=True):
                force[:, index] += values[parameter.name] * column
        return force

    @classmethod
    def from_file(cls, values: Mapping[str, Any], complete: bool = True) -> DriveEffect:
        """Build the effect from `{drive: {parameter: value}}`."""
        prefix = f'effects.{cls.name}'
        if not isinstance(values, Mapping) or not values:
            raise ModelError(prefix, values, 'map drives to parameters, e.g. lift_1: '
                             f'{{{_names(cls.parameters)}}}')
        for drive in values:
            if drive not in DRIVES:
                raise ModelError(f'{prefix}.{drive}', values[drive],
                                 f'sit on one of the drives {", ".join(DRIVES)}')
        return cls({drive: cls._checked(f'{prefix}.{drive}', block, complete)
                    for drive, block in values.items()})


@dataclass(frozen=True)
class DriveSamples:
    """What one drive did: all (N,); `time` is None where unknown, `direction` is sgn."""

    time: Array | None
    position: Array
    velocity: Array
    acceleration: Array
    direction: Array
    guide_load: Array
    memory: Any = None


def _names(parameters: tuple[Parameter, ...]) -> str:
    return ', '.join(parameter.name for parameter in parameters)
