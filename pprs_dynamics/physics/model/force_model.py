# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The base of all models: forces that drives must apply for a motion, as a sum over a list.

The diagnosis works on any of them: it asks a model for its drives, its numbers, its forces and
what its sensors say, never for what it moves.
"""

from __future__ import annotations

import copy
import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import Any, ClassVar, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits, RecordedDrives
from pprs_dynamics.errors import EffectError, MotionError
from pprs_dynamics.physics.effects.catalogue import find_effect
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Effect
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.model.keys import EFFORT_UNITS, FILES, Key, title_of
from pprs_dynamics.physics.model.parameter_file import find_file, read_parameters
from pprs_dynamics.physics.model.recorded_names import effort_kind, joint_names, recorded_columns

RIGID_BODY = 'rigid_body'
# The model's own friction, in its drives and in its passive joints.
ACTIVE_FRICTION, PASSIVE_FRICTION = 'active_friction', 'passive_friction'


def total_force(parts: tuple[Any, ...]) -> Any:
    """Return the drive force Q^m, the sum of its parts, of numbers as of arrays."""
    total = parts[0]
    for part in parts[1:]:
        total = total + part                                                   # Eq. (14)
    return total


class Forces:
    """Forces of N samples of D drives.

    Parameters
    ----------
    total : (N, D) array
        What the drives must apply [N, N m], in drive order.
    parts : dict of (N, D) arrays, or function that returns it
        `rigid_body`, the model's own friction, and one per added effect; they sum to `total`.
    mechanism : state, or function that returns it
        What the forces were computed from.
    """

    __slots__ = ('_mechanism', '_parts', 'total')

    # Functions, because of most samples only the total is read: building the rest takes longer
    # than the equations.
    def __init__(self, total: Array, parts: dict[str, Array] | Callable[[], dict[str, Array]],
                 mechanism: Any) -> None:
        self.total, self._parts, self._mechanism = total, parts, mechanism

    def __reduce__(self) -> tuple[Any, ...]:
        return Forces, (self.total, self.parts, self.mechanism)

    @property
    def parts(self) -> dict[str, Array]:
        """Parts of the total, by name."""
        if callable(self._parts):
            self._parts = self._parts()
        return self._parts

    @property
    def mechanism(self) -> Any:
        """The state of the mechanism."""
        if callable(self._mechanism):
            self._mechanism = self._mechanism()
        return self._mechanism

    @property
    def drive_motion(self) -> tuple[Array, ...]:
        """Position, velocity and acceleration of the drives, (N, D) each."""
        state = self.mechanism
        return state.position, state.velocity, state.acceleration


class ModelState:
    """Memory of effects between calls; made by `initial_state` of a model.

    Parameters
    ----------
    memories : dict of str to object
        By effect.
    start : float, optional
        When the motion began [s]; None before its first sample.

    Attributes
    ----------
    end : float, optional
        Time of the last sample [s].
    closed : dict of Structure to (C,) array
        Coordinates of a mechanism at the last sample, from which its loops close in fewer steps
        where the next one is near. No result depends on them.
    """

    def __init__(self, memories: dict[str, Any], start: float | None = None) -> None:
        self.memories, self.start = memories, start
        self.end: float | None = None
        self.closed: dict[Any, Array] = {}

    def advance(self, time: Array | None, fresh: Callable[[], ModelState]) -> None:
        """Take note of the times (N,) of the next samples, the first of which is the start.

        Times that go back are of another stream: everything begins anew, from a fresh state.
        """
        if time is None or not len(time):
            return
        if self.end is not None and time[0] < self.end:
            self.memories, self.start = fresh().memories, None
        if self.start is None:
            self.start = float(time[0])
        self.end = float(time[-1])

    @property
    def has_memory(self) -> bool:
        """Whether any effect keeps anything."""
        return any(memory is not None for memory in self.memories.values())

    def copy(self) -> ModelState:
        """Return an independent copy, to look ahead without advancing this one.

        Raises
        ------
        EffectError
            Where an effect keeps what cannot be copied.
        """
        copied = {}
        for name, memory in self.memories.items():
            try:
                copied[name] = copy.deepcopy(memory)
            except Exception as error:  # another package's effect may keep anything
                raise EffectError(name, 'its memory cannot be copied '
                                  f'({type(error).__name__}: {error})') from error
        state = ModelState(copied, self.start)
        state.end = self.end
        state.closed = dict(self.closed)
        return state


@dataclass(frozen=True, kw_only=True)
class ForceModel(ABC):
    """An inverse dynamic model: motion in, drive forces out.

    Parameters
    ----------
    robot : Robot or Mechanism
        Bodies and joints; effects take their parameters from it.
    effects : tuple of Effect
        What acts beside the rigid body; the model's own friction comes first.
    reversal : Reversal
    values : mapping
        The flat keys and values that the model was built from, complete with defaults.
    source : str
        The file that it came from, if any.

    Class attributes
    ----------------
    takes_long : bool
        Whether forces take so long that several are evaluated in threads.
    default_file : str
        Model file that is read without another one; empty where there is none.

    Attributes
    ----------
    kind : {'platform', 'axis', 'arm'}
        Effects say in which kinds they act.
    motions : tuple of type
        Kinds of motion that it has forces for.
    drives : tuple of D str
    keys : dict of str to Key
        Of its files.
    """

    default_file: ClassVar[str] = ''
    takes_long: ClassVar[bool] = False

    robot: Any
    effects: tuple[Effect, ...]
    reversal: Reversal
    values: Mapping[str, Any] = field(default_factory=dict)
    source: str = ''

    @classmethod
    def load(cls, path: str | PathLike[str] | None = None) -> Self:
        """Read a model file of this kind; `load_model` reads all.

        Parameters
        ----------
        path : path, optional
            A file; or, where there is none of that name, one of the package's own, as in
            'config/paper.yaml'. By default `default_file`.

        Raises
        ------
        UnreadableFileError
            Where the file, or a description that it names, does not exist or cannot be read.
        ModelError
            See `from_parameters`.
        """
        file = find_file(cls.default_file if path is None else path)
        return cls.from_parameters(read_parameters(file), source=str(file))

    @classmethod
    @abstractmethod
    def from_parameters(cls, parameters: Mapping[str, Any], source: str = '') -> Self:
        """Build the model from flat keys and values, each checked; see `build_model`.

        Raises
        ------
        ModelError
            For a key that is unknown, missing, of the wrong type or impossible, and for those of
            another kind of model.
        """

    @property
    @abstractmethod
    def kind(self) -> str:
        """One of 'platform', 'axis', 'arm'."""

    @property
    @abstractmethod
    def motions(self) -> tuple[type, ...]:
        """Kinds of motion that it has forces for."""

    @property
    def moves_joints(self) -> bool:
        """Whether it is commanded by the motion of its joints; else by that of a platform."""
        return JointMotion in self.motions

    @property
    @abstractmethod
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""

    @property
    @abstractmethod
    def keys(self) -> dict[str, Key]:
        """Keys of its files, by name."""

    @property
    def title(self) -> str:
        """What it is a model of, for a sentence."""
        return title_of(self.values)

    @property
    def units(self) -> tuple[DriveUnits, ...]:
        """Units of the drives' quantities."""
        return (DriveUnits(),) * len(self.drives)

    @cached_property
    def recorded(self) -> RecordedDrives:
        """How recordings hold the drives, by what the model file says.

        Raises
        ------
        ModelError
            For names and columns that cannot be.
        """
        return RecordedDrives(
            self.drives, joint_names(self.values, self.drives),
            recorded_columns(self.values, self.drives), self.gain, self.efforts_in_amperes,
            self.units, tuple(self.effort_limits.tolist()),
            next((EFFORT_UNITS[value] for key, value in self.values.items()
                  if key.endswith('.effort_unit')), 1.0))

    @property
    def content(self) -> str:
        """What the model is built from beside its values: a hash of further files."""
        return ''

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the values in force: it changes with every parameter, not with the ledger."""
        # A node has no ledger, and an empty list where a file says nothing.
        values = {key: value for key, value in self.values.items()
                  if value not in ([], ()) and not key.startswith('history.')}
        if self.content:  # the same wherever the files lie
            values.update({key: self.content for key in FILES if values.get(key)})
        text = json.dumps(values, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def block(self) -> str:
        """Block of its files that describes the robot; '' for that of the paper."""
        return ''

    @property
    def is_described(self) -> bool:
        """Whether its bodies and joints are those of a description, as of a URDF."""
        return False

    @property
    def gain(self) -> tuple[float, ...] | None:
        """Effort per ampere of each drive; None for a model without."""
        return None

    @property
    @abstractmethod
    def moved_mass(self) -> float:
        """Mass of what carries a load, or of all links [kg]."""

    @property
    def gear_ratios(self) -> tuple[float, ...]:
        """Turns of the motor per turn of each drive; 1 where no gear is known."""
        return (1.0,) * len(self.drives)

    @property
    @abstractmethod
    def strokes(self) -> tuple[Array, Array]:
        """Lowest and highest position of each drive [m, rad], (D,) each; may be infinite."""

    @property
    def speed_limits(self) -> Array:
        """Largest speed of each drive [m/s, rad/s], (D,); infinite where none is known."""
        return np.full(len(self.drives), np.inf)

    @property
    def effort_limits(self) -> Array:
        """Largest absolute effort that each drive can apply [N, N m], (D,); may be infinite."""
        return np.full(len(self.drives), np.inf)

    @property
    def faults(self) -> tuple[str, ...]:
        """Sentences on bodies of the model that cannot be."""
        return ()

    @property
    def efforts_in_amperes(self) -> bool:
        """Whether efforts of recordings are currents."""
        return False

    @property
    def effort_kind(self) -> str:
        """What the efforts of recordings are: one of `EFFORT_KINDS`."""
        return effort_kind(self.values)

    @property
    def recorded_gain(self) -> Array:
        """What efforts of recordings are multiplied by to give efforts in N and N m, (D,)."""
        if self.gain is not None and self.efforts_in_amperes:
            return np.asarray(self.gain)
        return np.ones(len(self.drives))

    @property
    def knows_currents(self) -> bool:
        """Whether a gain was given; 1 for every drive is what stands where none was."""
        return self.gain is not None and any(gain != 1 for gain in self.gain)

    def currents(self, effort: Array) -> Array:
        """Return the currents [A] that give efforts, (..., D), where `knows_currents`."""
        current: Array = effort / np.asarray(self.gain)
        return current

    @property
    def rest_speed(self) -> float:
        """Speed below which a drive that stays there stands, and its effort tells nothing.

        0 where efforts at rest count as well.
        """
        return 0.0

    @property
    def blocks_per_period(self) -> float:
        """Means of efforts that are compared in a period of the motion; 0 for means of 10 ms."""
        return 0.0

    def offers(self, effect: type[CatalogueEffect]) -> bool:
        """Return whether an effect of the catalogue can act in what this is a model of."""
        return self.kind in effect.acts_in and (
            len(self.drives) > 1 or not effect.needs_several_drives)

    def bound(self, effect: type[CatalogueEffect]) -> type[CatalogueEffect]:
        """Return an effect of the catalogue with the parameters that it has in this model."""
        # Of one with the parameters that it has elsewhere, its own again.
        return (find_effect(effect.name) or effect).bound(self.robot)

    @abstractmethod
    def motion_of_drives(self, position: Array, velocity: Array, acceleration: Array,
                         seed: Any = None) -> Any:
        """Return the motion, of a kind in `motions`, that belongs to one of the drives.

        Parameters
        ----------
        position, velocity, acceleration : (N, D) array
            [m, rad], per second and per second squared.
        seed : motion, optional
            The sample before the first one.

        Raises
        ------
        PprsError
            Where positions do not close the mechanism, or it is singular there.
        """

    @abstractmethod
    def mechanism(self, motion: Any) -> Any:
        """Return what effects take of a motion of this kind; see `drive_forces`."""

    @abstractmethod
    def at_drives(self, state: Any) -> Any:
        """Return what effects take where drives move as in a state of a model of this kind."""

    def drive_forces(self, motion: Any, state: ModelState | None = None) -> Forces:
        """Return the forces that the drives must apply for a motion of this kind.

        Parameters
        ----------
        motion : PlatformMotion or JointMotion
        state : ModelState, optional
            Carries effects with memory from call to call, and is advanced to the last sample;
            without it every call starts afresh.

        Raises
        ------
        MotionError
            For a motion of another kind, or of other drives.
        WorkspaceError, SingularityError
            Where the mechanism cannot be there. Strokes and efforts are not checked here:
            `limits` does that, so that recordings beyond them can still be compared.
        EffectError
            Where an effect of another package fails.
        """
        self._require_motion(motion)
        # Very large numbers overflow; users of the result check that it is finite.
        with np.errstate(over='ignore', invalid='ignore'):
            return self.forces_at(self.mechanism(motion), state)

    def _require_motion(self, motion: Any) -> None:
        """Raise MotionError for a motion that this model has no forces for."""
        if not isinstance(motion, self.motions):
            kinds = ' or a '.join(kind.__name__ for kind in self.motions)
            raise MotionError('motion', f'it is a {type(motion).__name__}',
                              f'be a {kinds} for {self.title}', 'shape')
        if isinstance(motion, JointMotion) and np.shape(motion.position)[1:] != (
                len(self.drives),):
            raise MotionError('position', f'its shape is {np.shape(motion.position)}',
                              f'be (N, {len(self.drives)}), a column for each of '
                              f'{", ".join(self.drives)}', 'shape')

    def forces_at(self, mechanism: Any, state: ModelState | None = None) -> Forces:
        """Return the forces at a state of the mechanism; see `drive_forces`."""
        return self._with_effects(self.effects, {RIGID_BODY: mechanism.rigid_force}, mechanism,
                                  state)

    def _with_effects(self, effects: Sequence[Effect], parts: dict[str, Array], mechanism: Any,
                      state: ModelState | None) -> Forces:
        """Return the forces of parts that are there and of effects."""
        state = self.initial_state() if state is None else state
        state.advance(mechanism.time, self.initial_state)
        for effect in self.effects:
            effect.check_memory(state.memories)
        with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
            # Bodies and what acts on them change the loads that friction follows: they go first.
            for effect in effects:
                if isinstance(effect, BodyEffect):
                    loaded = effect.apply(mechanism)
                    parts[effect.name] = loaded.rigid_force - mechanism.rigid_force
                    mechanism = loaded
            for effect in effects:
                if not effect.is_measurement and not isinstance(effect, BodyEffect):
                    parts[effect.name] = effect.force(mechanism, state.memories[effect.name])
            return Forces(total_force(tuple(parts.values())), parts, mechanism)

    @abstractmethod
    def at_home(self, samples: int) -> Any:
        """Return a motion at rest where the robot is put together, one sample a second."""

    @abstractmethod
    def singularity_margin(self, state: Any) -> float | None:
        """Return how far a motion stays from singular states: 0 at the limit, at most 1.

        None for what comes near none.
        """

    @abstractmethod
    def variables(self, state: Any) -> dict[str, Array]:
        """Return the variables on which an error may depend beside time and the drives' motion.

        By name in the interface: (N, D) where every drive has its own, (N,) where all share it.
        """

    def initial_state(self, start: float | None = None) -> ModelState:
        """Return a fresh state for effects with memory.

        Parameters
        ----------
        start : float, optional
            When the recording began [s], where that is before the first sample.
        """
        return ModelState({effect.name: effect.initial_memory(start) for effect in self.effects},
                          start)

    def continued_state(self, model: Self, state: ModelState) -> ModelState:
        """Return a state that goes on from another model's for the effects that both have.

        What a machine remembers does not change with a parameter: memories are kept whatever the
        parameters are, and new effects begin when the motion began. The other state must not be
        used any more: memories are handed over, not copied.
        """
        continued = self.initial_state(state.start)
        continued.end = state.end
        known = {effect.name for effect in model.effects} & state.memories.keys()
        for effect in self.effects:
            if effect.name in known:
                continued.memories[effect.name] = effect.continued_memory(
                    continued.memories[effect.name], state.memories[effect.name])
        return continued

    @property
    def assumed_at_start(self) -> dict[str, str]:
        """What a fresh state takes for granted, by effect with a memory."""
        return {effect.name: effect.assumed_at_start for effect in self.effects
                if effect.assumed_at_start}

    def sound_at(self, motion: Any) -> Self:
        """Return the model without those effects of other packages that fail for a motion.

        Raises
        ------
        PprsError
            See `drive_forces`.
        """
        model = self
        while True:
            try:
                model.drive_forces(motion)
            except EffectError as error:
                model = model.without(error.effect)
            else:
                return model

    def without(self, effect: str) -> Self:
        """Return the model without the effect of that name."""
        return replace(self, effects=tuple(each for each in self.effects if each.name != effect))

    def measured(self, forces: Forces, state: ModelState | None = None) -> Forces:
        """Return the measured forces where the drives apply `forces`.

        Effects of measurement become parts of their own; without any, `forces` are returned.

        Parameters
        ----------
        forces : Forces
            Consecutive samples with times, of `drive_forces`.
        state : ModelState, optional
            As there.
        """
        sensors = [effect for effect in self.effects if effect.is_measurement]
        if not sensors:
            return forces
        # Each effect gets the states that its kind of model makes.
        mechanism: Any = forces.mechanism
        parts, total = dict(forces.parts), forces.total
        state = self.initial_state() if state is None else state
        for effect in sensors:
            memory = state.memories[effect.name]
            after = (effect.seen(total, mechanism, memory)
                     if isinstance(effect, MeasurementEffect)
                     else total + effect.force(mechanism, memory))
            parts[effect.name], total = after - total, after
        return Forces(total, parts, mechanism)

    @property
    def misreadings(self) -> tuple[MeasurementEffect, ...]:
        """Effects because of which drives are elsewhere than their encoders say."""
        return tuple(effect for effect in self.effects
                     if isinstance(effect, MeasurementEffect) and effect.shifts_positions())

    def position_error(self, position: Array) -> Array:
        """Return the errors of measured positions (N, D), to be subtracted, but those by load."""
        errors = [one.position_error(self.drives, position) for one in self.misreadings]
        return np.sum(errors, axis=0) if errors else np.zeros_like(position)

    def loaded_position_error(self, transmitted: Array) -> Array:
        """Return the errors of measured positions by what gears pass on, (N, D)."""
        errors = [one.loaded_position_error(self.drives, transmitted) for one in self.misreadings]
        return np.sum(errors, axis=0) if errors else np.zeros_like(transmitted)

    def windup_error(self, transmitted: Array, windup: Array) -> Array:
        """Return what second encoders say beside that, of position and its rates, (3, N, D)."""
        errors: Array = np.sum([one.windup_error(self.drives, transmitted, windup)
                                for one in self.misreadings], axis=0)
        return errors
