# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Base of all effects: a share of the drive forces, with parameters declared once."""

from __future__ import annotations

import copyreg
import inspect
import math
import re
from abc import ABC, ABCMeta, abstractmethod
from collections.abc import Collection, Hashable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Self

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.mechanism.state import MECHANISM, PLATFORM, MechanismState


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect; files, ROS descriptors, tables and labels all read this.

    Parameters
    ----------
    name, symbol, unit, description : str
    lower, upper : float
        Bounds, both allowed; in a drive that pushes, where one that turns has others.
    default : float, optional
        Value where a model file is silent; required in the file without one.
    scale : float
        A size at which it matters, for numerical derivatives.
    turning : (float, float), optional
        Bounds in a drive that turns: radians for metres.
    expected : (float, float), optional
        How large it usually is, as a standard deviation, in a drive that pushes and in one that
        turns, the same in the structure; without it any size is as likely as another.
    product : Product, optional
        What is fitted in its place where efforts are not linear in it.
    """

    name: str
    symbol: str
    unit: str
    description: str
    lower: float
    upper: float
    default: float | None = None
    scale: float = 1.0
    expected: tuple[float, float] | None = None
    turning: tuple[float, float] | None = None
    product: Product | None = None

    def of(self, turns: bool) -> Parameter:
        """Return the parameter with the bounds that it has in a drive that turns, or pushes."""
        if not turns or self.turning is None:
            return self
        return replace(self, lower=self.turning[0], upper=self.turning[1])

    @property
    def widest(self) -> Parameter:
        """The parameter with bounds that hold for drives of either kind."""
        lower, upper = self.turning or (self.lower, self.upper)
        return replace(self, lower=min(lower, self.lower), upper=max(upper, self.upper))

    @property
    def is_relative(self) -> bool:
        """True where it is positive by nature, so that it is moved by factors."""
        return self.lower > 0

    def moved(self, value: float, amount: float) -> float:
        """Return the value after an amount of movement: a logarithm, or a multiple of `scale`."""
        return value * math.exp(amount) if self.is_relative else value + self.scale * amount

    def amount(self, spread: float, value: float) -> float:
        """Return a small difference from a value [unit] as an amount of movement."""
        return spread / (abs(value) if self.is_relative else self.scale)

    def spread(self, amount: float, value: float) -> float:
        """Return an amount of movement as a difference from a value [unit]."""
        return amount * (abs(value) if self.is_relative else self.scale)

    def check(self, key: str, value: Any) -> float:
        """Return `value` as a float within the bounds, or raise ModelError naming `key`."""
        # Bounds are finite, so that what lies within is, too.
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not (
                self.lower <= value <= self.upper):
            raise ModelError(key, value, f'be a number between {self.lower:g} and {self.upper:g} '
                             f'({self.description} [{self.unit}])')
        return float(value)


class Product(NamedTuple):
    """A coefficient that is sign * factor * (parameter - origin), in which efforts are linear.

    Parameters
    ----------
    coefficient : Parameter
    factor : str
        Name of a parameter that is its own coefficient, e.g. a mass.
    origin, sign : float
    farthest : float
        Largest parameter. A factor that is too small for it becomes the smallest that is not.
    """

    coefficient: Parameter
    factor: str
    origin: float = 0.0
    sign: float = 1.0
    farthest: float = math.inf

    def value(self, factor: float, parameter: float) -> float:
        """Return the coefficient."""
        return 0.0 + self.sign * factor * (parameter - self.origin)

    def solved(self, factor: float, value: float) -> tuple[float, float]:
        """Return the factor and the parameter that make a coefficient of this value."""
        factor = math.copysign(max(abs(factor), abs(value) / self.farthest), factor)
        away = 0.0 + self.sign * value / factor if factor else 0.0
        return factor, self.origin + max(-self.farthest, min(self.farthest, away))


class Effect(ABC):
    """A share of the drive forces. Positive is what the drive must apply more.

    Class attributes
    ----------------
    name : str
        Name in files, topics and reports.
    assumed_at_start : str
        What a fresh memory assumes, for an effect with memory; nodes publish it.

    Attributes
    ----------
    is_measurement : bool
        True where it describes what the sensor says, not what the drive must do: it enters
        comparisons and the monitor, never a command.
    """

    name: ClassVar[str]
    assumed_at_start: ClassVar[str] = ''
    is_measurement: bool = False

    @abstractmethod
    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the effect's drive forces [N, N m], (N, D).

        Parameters
        ----------
        state : MechanismState
        memory : object, optional
            What `initial_memory` returned, advanced in place to the last sample.
        """

    def measured(self, effort: Array, state: MechanismState, memory: Any = None) -> Array:
        """Return the efforts that sensors measure where the drives apply `effort`, (N, D)."""
        return effort + self.force(state, memory)

    def initial_memory(self, start: float | None = None) -> Any:
        """Return a fresh memory, or None for an effect without one.

        Parameters
        ----------
        start : float, optional
            When the recording began [s]; else the first sample counts as the start.
        """
        return None

    def continued_memory(self, fresh: Any, before: Any) -> Any:
        """Return the memory with which this effect goes on from the one with other parameters.

        Parameters
        ----------
        fresh, before : object
            What `initial_memory` returns, and what the other one remembered.
        """
        return before

    def check_memory(self, memories: Mapping[str, Any]) -> None:
        """Raise ModelError where memories, by effect, were not made for this one."""
        if self.name not in memories:
            raise ModelError('state', sorted(memories),
                             f'come from a model with this very {self.name}')


@dataclass(frozen=True)
class Card:
    """Description of an effect for users, from the sections of its docstring.

    Parameters
    ----------
    equation : str
    looks_like : str
        How it shows in the residual.
    causes : str
        What usually causes it.
    confirm : str
        How to confirm it on the machine.
    reference : str
    """

    equation: str
    looks_like: str
    causes: str
    confirm: str
    reference: str

    SECTIONS: ClassVar = ('Equation', 'Symptom', 'Causes', 'Confirmation', 'References')

    @classmethod
    def of(cls, docstring: str) -> Card:
        """Return the texts of the sections of an effect's docstring, '' for missing ones."""
        _, *parts = re.split(r'^(\w+)\n-+\n', inspect.cleandoc(docstring), flags=re.M)
        texts = {heading: ' '.join(text.split()).removesuffix('.')
                 for heading, text in zip(parts[::2], parts[1::2], strict=True)}
        return cls(*(texts.get(section, '') for section in cls.SECTIONS))


class Wave(NamedTuple):
    """Names of the amplitude and phase of a wave, and of its coefficients A cos phi, A sin phi."""

    amplitude: str
    phase: str
    sine: str = 'sine'
    cosine: str = 'cosine'

    def coefficients(self, linear: Mapping[str, Parameter]) -> tuple[Parameter, Parameter]:
        """Return the coefficients, in the unit and with the size of the amplitude."""
        amplitude, phase = linear[self.amplitude], linear[self.phase]
        turning = amplitude.turning and (-amplitude.turning[1], amplitude.turning[1])
        sine, cosine = (replace(
            amplitude, name=name, symbol=f'{amplitude.symbol} {function} {phase.symbol}',
            description=f'amplitude of the {name.replace("_", " ")}', lower=-amplitude.upper,
            default=None, turning=turning)
            for name, function in ((self.sine, 'cos'), (self.cosine, 'sin')))
        return sine, cosine


class EffectType(ABCMeta):
    """Type of the effects of the catalogue.

    An effect with the parameters that it has on one robot is a class that no module contains. It
    is pickled as the function that makes it and that function's arguments, in `made_by`.
    """


def _reduced(effect: EffectType) -> Any:
    return vars(effect).get('made_by', effect.__qualname__)


copyreg.pickle(EffectType, _reduced)


class CatalogueEffect(Effect, metaclass=EffectType):
    """An effect that a model file may add under `effects`, with values for its parameters.

    What is fitted is linear in `coefficients`, which are the linear parameters unless a subclass
    says how the one follows from the other, and not linear in `shape`.

    Class attributes
    ----------------
    card : Card
        From the docstring.
    needs_several_drives : bool
        Whether a single drive feels it as it feels another effect, always.
    acts_in : set of {'platform', 'slide', 'mechanism'}
        The kinds of robots on which it can act: a 3-PPRS, one slide alone, every other one.
    is_in_payload : bool
        Whether a payload with a centre and an inertia of its own has its parameters.
    linear, shape : tuple of Parameter
    parameters : tuple of Parameter
        Both.
    coefficients : tuple of Parameter
        By default the linear parameters, or what is fitted in place of them: products, and of
        waves sine and cosine.
    variants : tuple of tuple of str
        Sets of coefficients that are tried, the others being zero; by default all at once.
    scanned : tuple of str
        Coefficients with which shapes are searched; by default all.
    is_positive : bool
        True where linear parameters below 0 are unphysical; of friction they always are.
    unphysical_below : mapping of str to float
        Lowest values of parameters that make a physical force; by default as `is_positive` says.
    at_least : mapping of str to str
        Parameters that are at least as large as another one in any machine.
    may_be_measurement : bool
        True where a model file may declare it a sensor's, in `effects.measured`.
    is_friction : bool
        True for friction: a drive at rest shows nothing of it, any constant force looks like
        it, and it may not give power back.
    nonlinear : bool
        True where the effect changes how others show, or holds in its linear form nearby only: a
        delay, a shifted zero, gravity that turns. Sets of effects with and without it are then
        compared around models of their own.
    idealised : bool
        False where the form is exact: inertia, gravity, geometry, a factor, a constant. Real
        friction, springs and cords are only nearly of the form that they have here.
    shows_at_reversals : bool
        True where the effect shows most where friction turns over, so that friction which does so
        otherwise than modelled looks like it.
    is_wave : bool
        True where coefficients are amplitudes of waves over whole periods: each is as large as a
        force, also where less than a period is seen and large ones would cancel there.
    is_of_one_place : bool
        True where each variant is at a place of its own, a link or a joint: that a motion does
        not show every one of them is not worth telling.
    at_one_load : str
        Name of the effect that does the same where the load of a drive does not vary.
    symmetric : mapping of str to str
        Of coefficients of one direction, the effect that is the same in both directions.
    alike : tuple of tuple of str
        Groups of places at which the effect does the same in every motion.
    waves : tuple of Wave
        Parameters that are fitted as sine and cosine.
    """

    card: ClassVar[Card]
    needs_several_drives: ClassVar[bool] = False
    acts_in: ClassVar[frozenset[str]] = frozenset({PLATFORM, MECHANISM})
    is_in_payload: ClassVar[bool] = False
    linear: ClassVar[tuple[Parameter, ...]]
    shape: ClassVar[tuple[Parameter, ...]] = ()
    parameters: ClassVar[tuple[Parameter, ...]]
    coefficients: ClassVar[tuple[Parameter, ...]]
    variants: ClassVar[tuple[tuple[str, ...], ...]]
    scanned: ClassVar[tuple[str, ...]]
    is_positive: ClassVar[bool] = False
    unphysical_below: ClassVar[Mapping[str, float]] = {}
    at_least: ClassVar[Mapping[str, str]] = {}
    may_be_measurement: ClassVar[bool] = False
    is_friction: ClassVar[bool] = False
    nonlinear: ClassVar[bool] = False
    idealised: ClassVar[bool] = True
    shows_at_reversals: ClassVar[bool] = False
    is_wave: ClassVar[bool] = False
    is_of_one_place: ClassVar[bool] = False
    at_one_load: ClassVar[str] = ''
    symmetric: ClassVar[Mapping[str, str]] = {}
    alike: ClassVar[tuple[tuple[str, ...], ...]] = ()
    waves: ClassVar[tuple[Wave, ...]] = ()

    def __init_subclass__(cls) -> None:
        if cls.__doc__ and 'name' in vars(cls):
            cls.card = Card.of(cls.__doc__)
        if hasattr(cls, 'linear'):
            cls.parameters = cls.linear + cls.shape
            if 'coefficients' not in vars(cls):
                linear = {parameter.name: parameter for parameter in cls.linear}
                in_waves = {name for wave in cls.waves for name in wave[:2]}
                cls.coefficients = (
                    *(p.product.coefficient if p.product else p
                      for name, p in linear.items() if name not in in_waves),
                    *(c for wave in cls.waves for c in wave.coefficients(linear)))
            if 'variants' not in vars(cls):
                cls.variants = (tuple(c.name for c in cls.coefficients),)
            if 'scanned' not in vars(cls):
                cls.scanned = tuple(c.name for c in cls.coefficients)
            if 'unphysical_below' not in vars(cls) and (cls.is_friction or cls.is_positive):
                cls.unphysical_below = {p.name: 0.0 for p in cls.linear}

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash(self.name)

    @classmethod
    def place_and_parameter(cls, key: str) -> tuple[str, str]:
        """Return the drive of a key `drive.parameter`, '' for none, and the parameter.

        Parameters of bodies and joints have dots of their own.
        """
        if any(key == parameter.name for parameter in cls.parameters):
            return '', key
        drive, _, name = key.rpartition('.')
        return drive, name

    @classmethod
    def places_of(cls, names: Iterable[str]) -> tuple[tuple[str, ...], ...]:
        """Return the links or joints that parameters belong to, each with those it is alike to.

        Parameters
        ----------
        names : iterable of str
            Of parameters or coefficients.
        """
        if not cls.is_of_one_place:
            return ()
        places = dict.fromkeys(name.rpartition('.')[0] for name in names)
        return tuple(next((tuple(sorted(group)) for group in cls.alike if place in group), (place,))
                     for place in places)

    @classmethod
    def bound(cls, robot: Any) -> type[Self]:
        """Return the effect with the parameters that it has on a robot; by default its own.

        Parameters
        ----------
        robot : Mechanism
        """
        return cls

    @classmethod
    def shifts_positions(cls) -> bool:
        """Return whether measured positions are not the true ones: all drives feel that."""
        return False

    @classmethod
    @abstractmethod
    def checked(cls, values: Mapping[str, Any], is_complete: bool = True,
                turning: Collection[str] = ()) -> Mapping[str, Any]:
        """Return the argument of the class from keys of a model file, or raise ModelError.

        Parameters
        ----------
        values : mapping
            By key below `effects.NAME.`, such as `lift_1.force`.
        is_complete : bool
            False where values may be missing: a node gets them one by one before the effect is
            active.
        turning : collection of str
            Drives that turn.
        """

    @classmethod
    def from_file(cls, values: Mapping[str, Any], turning: Collection[str] = ()) -> Self:
        """Return the effect with values of a model file; see `checked`."""
        build: Any = cls
        effect: Self = build(cls.checked(values, turning=turning))
        return effect

    @classmethod
    def to_coefficients(cls, values: Mapping[str, float]) -> dict[str, float]:
        """Return the coefficients that belong to parameters."""
        given = dict(values)
        for amplitude, phase, sine, cosine in cls.waves:
            given[sine] = values[amplitude] * math.cos(values[phase])
            given[cosine] = values[amplitude] * math.sin(values[phase])
        for p in cls.linear:
            if p.product is not None:
                given[p.product.coefficient.name] = p.product.value(
                    values.get(p.product.factor, 0.0), values.get(p.name, p.product.origin))
        return {c.name: given[c.name] if c.default is None else given.get(c.name, c.default)
                for c in cls.coefficients}

    @classmethod
    def from_coefficients(cls, coefficients: Mapping[str, float]) -> dict[str, float]:
        """Return the linear parameters that belong to coefficients."""
        found = dict(coefficients)
        for amplitude, phase, sine, cosine in cls.waves:
            a, b = found.pop(sine), found.pop(cosine)
            found[amplitude], found[phase] = math.hypot(a, b), math.atan2(b, a)
        for p in cls.linear:
            if p.product is not None:
                found[p.product.factor], found[p.name] = p.product.solved(
                    found[p.product.factor], found.pop(p.product.coefficient.name))
        return found

    @classmethod
    def hypotheses(cls, names: tuple[str, ...]) -> frozenset[Hashable]:
        """Return the hypotheses of these coefficients; each costs the prior odds of a name."""
        return frozenset({names})

    @classmethod
    def _checked(cls, prefix: str, values: Mapping[str, Any], complete: bool,
                 turns: bool = False) -> dict[str, Any]:
        known = {parameter.name: parameter for parameter in cls.parameters}
        for name in values:
            if name not in known:
                raise UnknownNameError('key', f'{prefix}.{name}',
                                       [f'{prefix}.{parameter}' for parameter in known])
        checked = {}
        for name, parameter in known.items():
            if name not in values and parameter.default is None:
                if not complete:
                    continue
                raise ModelError(f'{prefix}.{name}', MISSING,
                                 f'be given ({parameter.description} [{parameter.unit}])')
            value = values.get(name, parameter.default)
            checked[name] = parameter.of(turns).check(f'{prefix}.{name}', value)
        return checked


def names(parameters: tuple[Parameter, ...]) -> str:
    """Return the names of parameters, for a sentence."""
    return ', '.join(parameter.name for parameter in parameters)
