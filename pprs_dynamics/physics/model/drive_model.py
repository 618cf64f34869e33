# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The model of every robot: forces that drives must apply for a motion, as a sum over a list.

    tau = rigid body + own friction + effects

per drive, positive along its positive direction; Eq. (14). What differs from robot to robot
belongs to the robot, a `Mechanism`; `ThreePprs` is one in closed form.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits, RecordedDrives
from pprs_dynamics.errors import EffectError, MotionError
from pprs_dynamics.physics.effects.catalogue import find_effect
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Effect
from pprs_dynamics.physics.effects.laws.drive_friction import DriveFriction, DriveOffset
from pprs_dynamics.physics.effects.laws.joint_friction import (
    IndependentChainsFriction,
    ModelJointFriction,
    PrintedFriction,
)
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism import tree_equations as rows
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.state import (
    MECHANISM,
    MechanismState,
    Motion,
    Reversal,
)
from pprs_dynamics.physics.model.forces import RIGID_BODY, DriveLimits, Forces, ModelState
from pprs_dynamics.physics.model.keys import (
    EFFORT_UNITS,
    FILES,
    GAIN,
    Key,
    is_described,
    keys_of,
    title_of,
)
from pprs_dynamics.physics.model.parameter_file import DEFAULT_MODEL, find_file, read_parameters
from pprs_dynamics.physics.model.parameter_values import (
    added_effects,
    checked_values,
    source_of_errors,
)
from pprs_dynamics.physics.model.recorded_names import (
    CURRENT,
    effort_kind,
    joint_names,
    recorded_columns,
)
from pprs_dynamics.physics.model.robot_block import read_mechanism, read_platform

OWN = DriveFriction, DriveOffset, ModelJointFriction  # effects that the one pass evaluates
# Reversals of friction take a hundredth of a period; what is faster is ripple of motor and gear.
BLOCKS_PER_PERIOD = 100.0


@dataclass(frozen=True, kw_only=True)
class DriveModel:
    """An inverse dynamic model: motion in, drive forces out.

    Parameters
    ----------
    robot : Mechanism
        Bodies and joints; effects take their parameters from it.
    effects : tuple of Effect
        What acts in addition to the rigid body; the model's own friction comes first.
    reversal : Reversal
    limits : DriveLimits
    values : mapping
        The flat keys and values that the model was built from, complete with defaults.
    source : str
        The file that it came from, if any.
    """

    robot: Mechanism
    effects: tuple[Effect, ...]
    reversal: Reversal
    limits: DriveLimits
    values: Mapping[str, Any] = field(default_factory=dict)
    source: str = ''

    @classmethod
    def load(cls, path: str | PathLike[str] = DEFAULT_MODEL) -> Self:
        """Read a model file.

        Parameters
        ----------
        path : path
            A file; or, where there is none of that name, one of the package's own, as in
            'config/paper.yaml'.

        Raises
        ------
        UnreadableFileError
            Where the file, or a description that it names, does not exist or cannot be read.
        ModelError
            See `from_parameters`.
        """
        file = find_file(path)
        return cls.from_parameters(read_parameters(file), source=str(file))

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any], source: str = '') -> Self:
        """Build the model from flat keys and values, each checked.

        Parameters
        ----------
        parameters : mapping
            E.g. {'geometry.rod_length': 0.3, ...}; keys of nodes are ignored. Keys of
            `robot` describe an axis, an arm or a robot with loops, others a 3-PPRS.
        source : str
            Named in errors; the path of a description counts from its folder.

        Raises
        ------
        ModelError
            For a key that is unknown, missing, of the wrong type or impossible.
        """
        with source_of_errors(source):
            values = checked_values(parameters)
            robot, own, reversal, limits = (
                read_mechanism(values, Path(source).parent) if is_described(parameters)
                else read_platform(values))
            effects = (*own, *added_effects(parameters, robot))
            loaded = robot
            for effect in effects:
                if isinstance(effect, BodyEffect):
                    loaded = effect.changed(loaded)
                    loaded.require_bodies(f'effects.{effect.name}', effect.values)
            return cls(robot=robot, effects=effects, reversal=reversal, limits=limits,
                       values=values, source=source)

    @property
    def kind(self) -> str:
        """One of 'platform', 'slide', 'mechanism'; effects say in which of them they act."""
        return self.robot.kind

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return self.robot.drives

    @cached_property
    def keys(self) -> dict[str, Key]:
        """Keys of its files, by name."""
        return keys_of(self.values)

    @property
    def has_bodies(self) -> bool:
        """Whether `pprs fit` identifies its bodies by regression; a slide has one inertia alone."""
        return self.kind == MECHANISM

    @property
    def has_links(self) -> bool:
        """Whether its file may have numbers of links and friction as `pprs fit` writes them."""
        return 'links.mass' in self.keys

    @property
    def units(self) -> tuple[DriveUnits, ...]:
        """Units of the drives' quantities."""
        return self.limits.units

    @property
    def gain(self) -> tuple[float, ...] | None:
        """Effort per ampere of each drive [N m/A, N/A]; None for a model without."""
        return self.values.get(GAIN)

    @property
    def gear_ratios(self) -> tuple[float, ...]:
        """Turns of the motor per turn of each drive; 1 where no gear is known."""
        ratios: tuple[float, ...] = self.values.get('robot.gear_ratio', (1.0,) * len(self.drives))
        return ratios

    @property
    def faults(self) -> tuple[str, ...]:
        """Sentences on bodies that cannot be, unless the file has other inertia than the URDF."""
        return () if self.values.get('links.inertia') else self.robot.structure.description.faults

    @property
    def efforts_in_amperes(self) -> bool:
        """Whether efforts of recordings are currents."""
        return self.effort_kind == CURRENT or self.values.get('robot.effort_unit') == 'A'

    @property
    def rest_speed(self) -> float:
        """Speed below which a drive stands and its effort is unknown; 0 where that counts too.

        A described joint has a gear that holds any torque at rest. The speed is the file's own, not
        that of a fit: which samples count must not change with the widths that are fitted to them.
        """
        return float(self.values['friction.reversal_velocity']) if self.has_bodies else 0.0

    @property
    def blocks_per_period(self) -> float:
        """Means of efforts that are compared in a period of the motion; 0 for means of 10 ms."""
        return BLOCKS_PER_PERIOD if self.has_bodies else 0.0

    @property
    def friction(self) -> DriveFriction:
        """The friction of its drives."""
        return next(effect for effect in self.effects if isinstance(effect, DriveFriction))

    @property
    def offset(self) -> Array:
        """The constant efforts of its drives, (D,) [N m, N]."""
        return sum((effect.value for effect in self.effects if isinstance(effect, DriveOffset)),
                   np.zeros(len(self.drives)))

    @property
    def title(self) -> str:
        """Kind of robot, for a sentence."""
        return title_of(self.values)

    @cached_property
    def recorded(self) -> RecordedDrives:
        """Names, columns and units of the drives in recordings, from the model file.

        Raises
        ------
        ModelError
            For names and columns that cannot be.
        """
        return RecordedDrives(
            self.drives, joint_names(self.values, self.drives),
            recorded_columns(self.values, self.drives), self.gain, self.efforts_in_amperes,
            self.units, tuple(self.limits.efforts.tolist()),
            EFFORT_UNITS[self.values.get('robot.effort_unit', 'N m')])

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the values in force: it changes with every parameter, not with the ledger."""
        # A node has no ledger, and an empty list where a file says nothing.
        values = {key: value for key, value in self.values.items()
                  if value not in ([], ()) and not key.startswith('history.')}
        content = self.robot.structure.description.digest  # the same wherever the files are
        values.update({key: content for key in FILES if values.get(key)})
        text = json.dumps(values, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def effort_kind(self) -> str:
        """Kind of the recorded efforts, one of `EFFORT_KINDS`."""
        return effort_kind(self.values)

    @property
    def recorded_gain(self) -> Array:
        """Factors from recorded efforts to N and N m, (D,)."""
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

    def offers(self, effect: type[CatalogueEffect]) -> bool:
        """Return whether an effect of the catalogue can act in this robot, as no other does."""
        return (self.kind in effect.acts_in and (
            len(self.drives) > 1 or not effect.needs_several_drives) and (
            self.robot.tool_place.is_spread or not effect.is_in_payload))

    def bound(self, effect: type[CatalogueEffect]) -> type[CatalogueEffect]:
        """Return an effect of the catalogue with the parameters that it has in this model."""
        # Of one with the parameters that it has elsewhere, its own again.
        return (find_effect(effect.name) or effect).bound(self.robot)

    def mechanism(self, motion: Motion, closed: dict[Any, Array] | None = None) -> MechanismState:
        """Return the mechanism's state for a motion; see `drive_forces` and `ModelState.closed`."""
        return self.robot.state(motion, self.reversal, self._joint_friction, closed)

    @cached_property
    def _joint_friction(self) -> Any:
        """The model's own friction of joints, which is computed in one pass with the efforts."""
        return next((effect.table(self.robot, self.reversal) for effect in self.effects
                     if isinstance(effect, ModelJointFriction)),
                    self.robot.friction_table({}, self.reversal))

    def drive_forces(self, motion: Motion, state: ModelState | None = None) -> Forces:
        """Return the forces that the drives must apply for a motion.

        Parameters
        ----------
        motion : PlatformMotion or JointMotion
            One of the robot's `motions`.
        state : ModelState, optional
            Carries effects with memory from call to call, and is advanced to the last sample;
            without it every call starts afresh. With a state the loops close from where they were
            at its last sample, where that is near.

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
        parameters, closed = self._own_parameters, None if state is None else state.closed
        found = None if parameters is None else self.robot.one_pass(motion, parameters, closed)
        if found is None:
            # No pass, or a sample out of reach or near a singularity: every sample is checked.
            # Very large numbers overflow; users of the result check that it is finite.
            with np.errstate(over='ignore', invalid='ignore'):
                mechanism = self.mechanism(motion, closed)
                if parameters is not None and isinstance(motion, JointMotion):
                    vars(mechanism)['inverse_dynamics'] = None  # a second pass would fail alike
                forces = self.forces_at(mechanism, state)
            if state is not None:
                self.robot.remember(mechanism, state.closed)
            return forces
        forces = Forces(
            found.efforts[rows.TOTAL], lambda: self._own_parts(found.efforts),
            lambda: self.robot.state(motion, self.reversal, self._joint_friction, found=found),
            found.motion)
        if self._added:
            return self._with_effects(self._added, forces.parts, forces.mechanism, state)
        if state is not None:
            state.advance(motion.time, self.initial_state)
        return forces

    @cached_property
    def _own_parameters(self) -> Any:
        """Parameters of the pass over bodies and own friction, None where there is none.

        Effects that change the bodies have none, nor have Eq. (13), and Eq. (12) as printed.
        """
        drives = np.zeros((rows.OF_DRIVE, len(self.drives)))
        drives[rows.ARMATURE], drives[rows.WIDTH] = self.robot.armature, self.reversal.velocity
        for effect in self.effects:
            if isinstance(effect, DriveFriction):
                drives[rows.VISCOUS], drives[rows.COULOMB] = effect.viscous, effect.coulomb
                drives[rows.COEFFICIENT] = effect.coefficient
            elif isinstance(effect, DriveOffset):
                drives[rows.OFFSET] = effect.value
            elif isinstance(effect, BodyEffect | IndependentChainsFriction | PrintedFriction):
                return None
        return self.robot.friction_parameters(self._joint_friction, drives)

    def _own_parts(self, efforts: Array) -> dict[str, Array]:
        """Return the parts of efforts by name, in the order of the effects."""
        parts = {RIGID_BODY: efforts[rows.RIGID]}
        for effect in self.effects:
            if isinstance(effect, DriveOffset):
                parts[effect.name] = effect.value + np.zeros_like(efforts[rows.TOTAL])
            elif isinstance(effect, OWN):
                parts[effect.name] = efforts[
                    rows.DRIVE_FRICTION if isinstance(effect, DriveFriction) else rows.JOINT_EFFORT]
        return parts

    @cached_property
    def _added(self) -> tuple[Effect, ...]:
        """Effects that are not part of the one pass."""
        return tuple(effect for effect in self.effects if not isinstance(effect, OWN))

    def _require_motion(self, motion: Motion) -> None:
        """Raise MotionError for a motion that this model has no forces for."""
        if not isinstance(motion, self.robot.motions):
            kinds = ' or a '.join(kind.__name__ for kind in self.robot.motions)
            raise MotionError('motion', f'it is a {type(motion).__name__}',
                              f'be a {kinds} for {self.title}', 'shape')
        if isinstance(motion, JointMotion) and np.shape(motion.position)[1:] != (
                len(self.drives),):
            raise MotionError('position', f'its shape is {np.shape(motion.position)}',
                              f'be (N, {len(self.drives)}), a column for each of '
                              f'{", ".join(self.drives)}', 'shape')

    def forces_at(self, mechanism: MechanismState, state: ModelState | None = None) -> Forces:
        """Return the forces at a state of the mechanism; see `drive_forces`."""
        return self._with_effects(self.effects, {RIGID_BODY: mechanism.rigid_force}, mechanism,
                                  state)

    def _with_effects(self, effects: Sequence[Effect], parts: dict[str, Array],
                      mechanism: MechanismState, state: ModelState | None) -> Forces:
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
            first, *others = parts.values()
            return Forces(sum(others, first), parts, mechanism)                    # Eq. (14)

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
        """Assumptions of a fresh state, by effect with a memory."""
        return {effect.name: effect.assumed_at_start for effect in self.effects
                if effect.assumed_at_start}

    def sound_at(self, motion: Motion) -> Self:
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
        return replace(self, effects=tuple(kept for kept in self.effects if kept.name != effect))

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
        mechanism, parts, total = forces.mechanism, dict(forces.parts), forces.total
        state = self.initial_state() if state is None else state
        for effect in sensors:
            after = effect.measured(total, mechanism, state.memories[effect.name])
            parts[effect.name], total = after - total, after
        return Forces(total, parts, mechanism)

    @property
    def position_effects(self) -> tuple[MeasurementEffect, ...]:
        """Measurement effects that shift the measured positions of drives."""
        return tuple(effect for effect in self.effects
                     if isinstance(effect, MeasurementEffect) and effect.shifts_positions())

    @property
    def lateness(self) -> Array:
        """Delays of the measured efforts, (D,) [s]."""
        return np.array([sum(effect.drives.get(drive, {}).get(effect.late_by, 0.0)
                             for effect in self.effects if isinstance(effect, MeasurementEffect))
                         for drive in self.drives])

    def position_error(self, position: Array) -> Array:
        """Return the errors of measured positions (N, D), to be subtracted, but those by load."""
        return sum((effect.position_error(self.drives, position)
                    for effect in self.position_effects), np.zeros_like(position))

    def loaded_position_error(self, transmitted: Array) -> Array:
        """Return the errors of measured positions by what gears pass on, (N, D)."""
        return sum((effect.loaded_position_error(self.drives, transmitted)
                    for effect in self.position_effects), np.zeros_like(transmitted))

    def windup_error(self, transmitted: Array, windup: Array) -> Array:
        """Return the further errors of second encoders, of position and its rates, (3, N, D)."""
        return sum((effect.windup_error(self.drives, transmitted, windup)
                    for effect in self.position_effects), np.zeros_like(windup))


@dataclass(frozen=True)
class Margins:
    """Smallest distances from the limits over all samples: 0 at the limit, at most 1.

    Parameters
    ----------
    singularity : float or None
        See `Mechanism.singularity_margin`.
    workspace : float
        Distance of a drive from an end of its stroke, over half the stroke.
    drive : str
        The drive nearest to an end of its stroke.
    """

    singularity: float | None
    workspace: float
    drive: str


def margins(model: DriveModel, mechanism: MechanismState) -> Margins:
    """Return the margins of a motion that the model has accepted.

    Parameters
    ----------
    model : DriveModel
    mechanism : MechanismState
        What `model.drive_forces` returned with the forces.
    """
    lower, upper = model.limits.lower, model.limits.upper
    position = mechanism.position
    with np.errstate(invalid='ignore'):  # no limit of a joint: infinity over infinity
        room: Array = np.minimum(position - lower, upper - position).min(axis=0) / (
            upper - lower) * 2
    room = np.where(np.isnan(room), 1.0, room)
    nearest = int(room.argmin())
    return Margins(model.robot.singularity_margin(mechanism), float(room[nearest]),
                   model.drives[nearest])
