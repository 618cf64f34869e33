"""The drive forces Q^m as a sum over a list: the rigid body, the paper's friction, and effects."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from pprs_dynamics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.effects.effect import Effect
from pprs_dynamics.effects.structure_effect import BodyEffect
from pprs_dynamics.mechanism.jacobians import condition_number
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.reversal import Reversal
from pprs_dynamics.mechanism.robot import DRIVES, Array, Robot
from pprs_dynamics.mechanism.state import MechanismState, solve_mechanism
from pprs_dynamics.model.limits import Limits

RIGID_BODY = 'rigid_body'


@dataclass(frozen=True)
class DriveForces:
    """Drive forces of N samples.

    Parameters
    ----------
    total : (N, 6) array
        What the drives must apply [N], in drive order.
    parts : dict of (N, 6) arrays
        `rigid_body`, `active_friction`, `passive_friction` and one per added effect; they sum
        to `total`.
    mechanism : MechanismState
        Drive motion, Jacobians, reactions: what the forces were computed from.
    """

    total: Array
    parts: dict[str, Array]
    mechanism: MechanismState


class ModelState:
    """What effects with memory keep between calls; made by `DriveModel.initial_state`."""

    def __init__(self, memories: dict[str, Any]) -> None:
        self.memories = memories

    @property
    def has_memory(self) -> bool:
        """Whether any effect keeps anything."""
        return any(memory is not None for memory in self.memories.values())

    def copy(self) -> ModelState:
        """Return an independent copy, to look ahead without advancing this one."""
        return ModelState(copy.deepcopy(self.memories))


@dataclass(frozen=True)
class DriveModel:
    """The inverse dynamic model of a 3-PPRS with friction, Eq. (14): Q^m = sum of parts.

    Parameters
    ----------
    robot : Robot
    effects : tuple of Effect
        What acts beside the rigid body; the paper's friction comes first.
    limits : Limits
    reversal : Reversal
    equations : {'corrected', 'printed'}
        'printed' takes (7), (12), (13) to the letter.
    values : mapping
        The flat keys and values that the model was built from, complete with defaults.
    source : str
        The file that it came from, if any.
    """

    robot: Robot
    effects: tuple[Effect, ...]
    limits: Limits
    reversal: Reversal
    equations: str = 'corrected'
    values: Mapping[str, Any] = field(default_factory=dict)
    source: str = ''

    @classmethod
    def load(cls, path: str | PathLike[str] = 'config/paper.yaml') -> DriveModel:
        """Read a model file.

        Parameters
        ----------
        path : path
            A file; or, where there is none of that name, one of the package's own, as in
            'config/paper.yaml'.

        Raises
        ------
        UnreadableFileError
            Where the file does not exist or is not YAML.
        ModelError
            For a key that is unknown, missing, of the wrong type or impossible.
        """
        from pprs_dynamics.model.model_file import load_model

        return load_model(path)

    def initial_state(self) -> ModelState:
        """Return a fresh state for effects with memory."""
        return ModelState({effect.name: effect.initial_memory() for effect in self.effects})

    def continued_state(self, model: DriveModel, state: ModelState) -> ModelState:
        """Return a state that goes on from another model's for the effects that both have."""
        fresh = self.initial_state()
        for effect in self.effects:
            if effect in model.effects:
                fresh.memories[effect.name] = copy.deepcopy(state.memories[effect.name])
        return fresh

    def mechanism(self, motion: PlatformMotion) -> MechanismState:
        """Return drive motion, Jacobians and frictionless forces for a platform motion.

        Raises
        ------
        WorkspaceError
            For a pose out of reach.
        SingularityError
            For a pose nearer to a singularity than `limits.rod_sine` or
            `limits.condition_number` allow.
        """
        # Absurd numbers overflow; what comes out is checked by whoever uses it.
        with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
            return solve_mechanism(
                self.robot, motion, reversal=self.reversal, printed=self.equations == 'printed',
                minimum_sine=self.limits.rod_sine, condition_limit=self.limits.condition_number)

    def drive_forces(
        self, motion: PlatformMotion, state: ModelState | None = None,
    ) -> DriveForces:
        """Return the forces that the drives must apply for a platform motion.

        Parameters
        ----------
        motion : PlatformMotion
        state : ModelState, optional
            Carries effects with memory from call to call, and is advanced to the last sample;
            without it every call starts afresh.

        Raises
        ------
        WorkspaceError, SingularityError
            See `mechanism`. Strokes and efforts are not checked here: `limits` does that, so
            that recordings beyond them can still be compared.
        """
        return self.forces_at(self.mechanism(motion), state)

    def forces_at(
        self, mechanism: MechanismState, state: ModelState | None = None,
    ) -> DriveForces:
        """Return the forces at a solved state of the mechanism; see `drive_forces`."""
        parts = {RIGID_BODY: mechanism.rigid_body.force}
        state = self.initial_state() if state is None else state
        for effect in self.effects:
            effect.check_memory(state.memories)
        with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
            # Bodies and what acts on them change the loads that friction follows: they go first.
            for effect in self.effects:
                if isinstance(effect, BodyEffect):
                    loaded = effect.apply(mechanism)
                    parts[effect.name] = loaded.rigid_body.force - mechanism.rigid_body.force
                    mechanism = loaded
            for effect in self.effects:
                if not effect.is_measurement and not isinstance(effect, BodyEffect):
                    parts[effect.name] = effect.force(mechanism, state.memories[effect.name])
            total: Array = np.sum(list(parts.values()), axis=0)                # Eq. (14)
        return DriveForces(total, parts, mechanism)

    def measured(self, forces: DriveForces, state: ModelState | None = None) -> DriveForces:
        """Return what the sensors say where the drives apply `forces`.

        Effects of measurement become parts of their own; without any, `forces` are returned.

        Parameters
        ----------
        forces : DriveForces
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
            memory = state.memories[effect.name]
            after = (effect.sensed(total, mechanism.time, mechanism.drives, memory)
                     if isinstance(effect, MeasurementEffect)
                     else total + effect.force(mechanism, memory))
            parts[effect.name], total = after - total, after
        return DriveForces(total, parts, mechanism)

    @property
    def position_error(self) -> Array:
        """What must be taken off measured drive positions [m], (6,)."""
        errors = [effect.position_error(DRIVES) for effect in self.effects
                  if isinstance(effect, MeasurementEffect)]
        total: Array = np.sum(errors, axis=0) if errors else np.zeros(len(DRIVES))
        return total

    def condition_number(self, motion: PlatformMotion) -> Array:
        """Return the condition number of the drive Jacobian, rotations times r, (N,).

        Unlike `drive_forces` it answers beyond `limits.condition_number` too.
        """
        mechanism = solve_mechanism(self.robot, motion, minimum_sine=self.limits.rod_sine)
        return condition_number(self.robot.geometry, mechanism.jacobians.J)
