# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Base of hidden effects: physics in the simulated robot that the model lacks.

Each is known by its name in the interface where the catalogue has one, but has a form of its
own, so that a diagnosis is not tested against itself. Signs are the interface's: positive is
what the drives must apply more.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import PprsError

if TYPE_CHECKING:
    from pprs_dynamics.simulation.closed_chains import ClosedChains


PASSIVE_JOINTS = ('revolute', 'spherical')  # of a 3-PPRS: C_i and A_i


def algebraic_sign(velocity: Array, width: Array | float) -> Array:
    """Return v / sqrt(v^2 + w^2): another switch of direction than the tanh of the model."""
    sign: Array = velocity / np.sqrt(velocity * velocity + width * width)
    return sign


def eyring(velocity: Array, thinning_velocity: Array | float) -> Array:
    """Return v_1 asinh(v / v_1): speed as felt in grease that thins with the shear rate."""
    felt: Array = thinning_velocity * np.arcsinh(velocity / thinning_velocity)
    return felt


class InjectedEffectError(PprsError, ValueError):
    """A hidden effect that does not exist, or parameters that it has not got."""


@dataclass(frozen=True)
class Range:
    """Where a parameter is drawn from.

    Parameters
    ----------
    unit : str
    low, high : float
    law : {'uniform', 'log', 'signed', 'sign', 'whole'}
        'signed' draws the size logarithmically and the sign at random; 'sign' is 1 or -1;
        'whole' draws whole numbers, both ends included.
    lifts : (low, high), optional
        Other limits on lifts, for what goes by positions.
    scales : bool
        True where a wanted strength multiplies it.
    neutral : float
        Value on drives that do not have the effect.
    """

    unit: str
    low: float
    high: float
    law: str = 'uniform'
    lifts: tuple[float, float] | None = None
    scales: bool = False
    neutral: float = 0.0

    def draw(self, rng: np.random.Generator, scale: float, drive: str = '') -> float:
        """Return a random value, by drive where the effect acts in drives."""
        low, high = self.low, self.high
        if self.lifts is not None and drive.startswith('lift'):
            low, high = self.lifts
        if self.law == 'sign':
            value = float(rng.choice((-1.0, 1.0)))
        elif self.law == 'whole':
            value = float(rng.integers(int(low), int(high) + 1))
        elif self.law == 'uniform':
            value = rng.uniform(low, high)
        else:
            value = float(np.exp(rng.uniform(np.log(low), np.log(high))))
            if self.law == 'signed' and rng.random() < 0.5:
                value = -value
        return float(value * scale if self.scales else value)


@dataclass(slots=True)
class DriveMoment:
    """State of the drives at one moment, in SI units; arrays (6,), or at many moments (N, 6).

    `transmitted` is what their screws pass on, without friction.
    """

    time: float | Array
    position: Array
    velocity: Array
    guide_load: Array
    transmitted: Array

    def at(self, velocity: Array) -> DriveMoment:
        """Return the state with other velocities."""
        return DriveMoment(self.time, self.position, velocity, self.guide_load,
                           self.transmitted)


@dataclass(frozen=True)
class PlatformMoment:
    """State of platform and rods at one moment, in `base`.

    Parameters
    ----------
    time : float
    position, velocity, angular_velocity : (3,) arrays
        Of the platform.
    rotation : (3, 3) array
    rod_angle : (3,) array
        u_i [rad].
    """

    time: float
    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array
    rod_angle: Array


class InjectedEffect(ABC):
    """Physics that is in the robot and not in its model.

    Class attributes
    ----------------
    name : str
    form : str
        Its equation, for reports.
    ranges : dict of Range
        Its parameters.
    method : str
        Name of what it does, see `by_law`.

    Parameters
    ----------
    **parameters : float
        All of `ranges`.
    """

    name: ClassVar[str]
    form: ClassVar[str]
    ranges: ClassVar[Mapping[str, Range]]
    method: ClassVar[str]

    @classmethod
    def by_law(cls, form: str, **ranges: Range) -> Callable[[Callable[..., Any]], type[Self]]:
        """Return what makes a law an effect of the law's name, without memory.

        The law takes what the `method` of this class takes, and then the parameters by name.
        """
        def made(law: Callable[..., Any]) -> type[Self]:
            return type(law.__name__, (cls,), {
                '__doc__': law.__doc__, '__module__': law.__module__, 'name': law.__name__,
                'form': form, 'ranges': ranges,
                cls.method: lambda self, *state: law(*state, **self.arguments)})
        return made

    def __init__(self, **parameters: float) -> None:
        require_parameters(type(self), parameters)
        self.parameters: dict[str, Any] = dict(parameters)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: float = 1.0) -> Self:
        """Return the effect with random parameters; `scale` multiplies its strength."""
        return cls(**{name: r.draw(rng, scale) for name, r in cls.ranges.items()})

    @property
    def arguments(self) -> Mapping[str, Any]:
        """Parameters as a law takes them."""
        return self.parameters

    @property
    def drives(self) -> tuple[str, ...] | None:
        """Drives on which it acts; None for passive joints, platform and structure."""
        return None

    def truth(self) -> dict[str, Any]:
        """Return name, drives, parameters and form, as data for JSON."""
        return {'name': self.name, 'drives': None if self.drives is None else list(self.drives),
                'parameters': self.parameters, 'form': self.form}


class DriveBound(InjectedEffect):
    """An effect that acts in one drive, some or all.

    Parameters
    ----------
    drives : mapping
        Parameters of every drive that has it, e.g. {'lift_1': {'force': 1.0}}.
    """

    def __init__(self, drives: Mapping[str, Mapping[str, float]]) -> None:
        for drive, parameters in drives.items():
            if drive not in DRIVES:
                raise InjectedEffectError(f'{self.name} acts in a drive, not in {drive!r}')
            require_parameters(type(self), parameters)
        self.parameters = {drive: dict(parameters) for drive, parameters in drives.items()}
        # One array per parameter, neutral where a drive has not got the effect.
        self.values = {
            name: np.array([self.parameters[drive][name] if drive in drives else r.neutral
                            for drive in DRIVES])
            for name, r in self.ranges.items()}

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: float = 1.0) -> Self:
        """Return the effect on one drive (half of the time), on two or three, or on all."""
        count = int(rng.choice([1, 2, 3, 6], p=[0.5, 0.125, 0.125, 0.25]))
        chosen = sorted(rng.choice(6, count, replace=False))
        return cls.draw_on([DRIVES[i] for i in chosen], rng, scale)

    @classmethod
    def draw_on(cls, drives: Sequence[str], rng: np.random.Generator, scale: float = 1.0) -> Self:
        """Return the effect on given drives."""
        return cls({drive: {name: r.draw(rng, scale, drive) for name, r in cls.ranges.items()}
                    for drive in drives})

    @property
    def arguments(self) -> Mapping[str, Array]:
        """Parameters as a law takes them, (6,) each."""
        return self.values

    @property
    def drives(self) -> tuple[str, ...]:
        """Drives on which it acts."""
        return tuple(drive for drive in DRIVES if drive in self.parameters)


class DriveForce(DriveBound):
    """A force in the drives.

    Class attributes
    ----------------
    steep : bool
        True where it changes fast with the drive's own velocity: then the time step treats it
        implicitly.
    """

    method: ClassVar[str] = 'force'
    steep: ClassVar[bool] = False

    def prepare(self, coulomb: Array, width: Array) -> None:
        """Take note of the drives' own friction before it starts; by default not.

        Parameters
        ----------
        coulomb : (6,) array
            Coefficients of dry friction.
        width : (6,) array
            In which it turns over [m/s].
        """
        return

    @abstractmethod
    def force(self, moment: DriveMoment) -> Array:
        """Return the additional drive forces [N], (6,)."""

    def advance(self, moment: DriveMoment, duration: float) -> None:
        """Advance memory by a time step; nothing to do without one."""
        return


class SteepDriveForce(DriveForce):
    """One that changes fast with the drive's own velocity."""

    steep: ClassVar[bool] = True


class InjectedJointFriction(InjectedEffect):
    """Friction in the passive joints.

    Parameters
    ----------
    joint : {'revolute', 'spherical'}
    **parameters : float
        All of `ranges`.
    """

    def __init__(self, joint: str, **parameters: float) -> None:
        if joint not in PASSIVE_JOINTS:
            raise InjectedEffectError(f'{self.name} acts in one of {", ".join(PASSIVE_JOINTS)}, '
                                      f'not in {joint!r}')
        super().__init__(**parameters)
        self.joint = joint

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: float = 1.0) -> Self:
        """Return it in the joints C_i or A_i."""
        return cls.draw_on([str(rng.choice(PASSIVE_JOINTS))], rng, scale)

    @classmethod
    def draw_on(cls, places: Sequence[str], rng: np.random.Generator, scale: float = 1.0) -> Self:
        """Return it in joints of one kind."""
        return cls(','.join(places), **{
            name: r.draw(rng, scale) for name, r in cls.ranges.items()})

    def truth(self) -> dict[str, Any]:
        """Return name, parameters by joint, and form, as data for JSON."""
        return {**super().truth(), 'parameters': {
            f'{self.joint}.{name}': value for name, value in self.parameters.items()}}

    @abstractmethod
    def resistance(self, speed: Array, load: Array) -> Array:
        """Return moment per speed [N m s/rad], (3,), at speeds and loads (3,)."""


class StructureForce(InjectedEffect):
    """Forces on rods and platform."""

    method: ClassVar[str] = 'apply'

    @abstractmethod
    def apply(self, moment: PlatformMoment) -> tuple[Array, Array, Array]:
        """Return torques on the hinges of C_i, force at o and torque on the platform, in `base`.

        These act on the mechanism: the drives must overcome them.
        """


class BodyChange(InjectedEffect):
    """A difference of bodies or gravity from the model."""

    method: ClassVar[str] = 'apply'

    @abstractmethod
    def apply(self, chains: ClosedChains, values: Mapping[str, Any]) -> None:
        """Change the mechanism before it starts."""

    def advance(self, chains: ClosedChains, time: float) -> None:
        """Change it while it runs; by default not."""
        return


class SensorEffect(DriveBound):
    """A systematic error of a sensor; see `sensors.Sensors`."""


def require_parameters(effect: type[InjectedEffect], given: Mapping[str, float]) -> None:
    """Raise InjectedEffectError unless the effect's parameters are given, all finite."""
    if set(given) != set(effect.ranges):
        raise InjectedEffectError(f'{effect.name} has the parameters {", ".join(effect.ranges)}, '
                                f'not {", ".join(given) or "none"}')
    for name, value in given.items():
        if not np.isfinite(value):
            raise InjectedEffectError(f'{effect.name}: {name} is {value}, must be finite')
