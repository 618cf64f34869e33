# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model of the 3-PPRS: drive forces Q^m of the rigid body, the paper's friction and effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.effects.effect import PLATFORM, Effect
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.model.effects_block import added_effects
from pprs_dynamics.physics.model.force_model import ForceModel, Forces, ModelState
from pprs_dynamics.physics.model.keys import KEYS, is_axis, is_mechanism, title_of
from pprs_dynamics.physics.model.limits import Limits
from pprs_dynamics.physics.model.one_pass import OnePass
from pprs_dynamics.physics.model.parameter_file import DEFAULT_MODEL
from pprs_dynamics.physics.model.parameter_values import checked_values, source_of_errors
from pprs_dynamics.physics.model.recorded_names import gravity_in_efforts
from pprs_dynamics.physics.three_pprs.active_friction import ActiveFriction
from pprs_dynamics.physics.three_pprs.forward_motion import solve_forward_motion
from pprs_dynamics.physics.three_pprs.jacobians import condition_number
from pprs_dynamics.physics.three_pprs.passive_friction import (
    IndependentChainsFriction,
    JointCoefficients,
    PassiveFriction,
    WholeMechanismFriction,
)
from pprs_dynamics.physics.three_pprs.robot import Geometry, Masses, Robot
from pprs_dynamics.physics.three_pprs.state import ThreePprsState, solve_mechanism

HOME_HEIGHT = 0.5  # [m], of the platform at home
# Of a long trajectory that many samples are looked at for their condition number, evenly spread:
# neighbours hardly differ, and a singular value decomposition each would cost more than the model.
MOST_CONDITIONS = 64


@dataclass(frozen=True, kw_only=True)
class DriveModel(ForceModel):
    """The inverse dynamic model of a 3-PPRS with friction, Eq. (14): Q^m = sum of parts.

    Parameters
    ----------
    robot : Robot
    limits : Limits
    equations : {'corrected', 'printed'}
        'printed' takes (7), (12), (13) to the letter.
    effects, reversal, values, source
        See `ForceModel`; the paper's friction comes first.
    """

    kind: ClassVar[str] = PLATFORM
    motions: ClassVar[tuple[type, ...]] = (PlatformMotion,)
    default_file: ClassVar[str] = DEFAULT_MODEL
    drives: ClassVar[tuple[str, ...]] = DRIVES
    keys = KEYS

    robot: Robot
    limits: Limits
    equations: str = 'corrected'

    @property
    def strokes(self) -> tuple[Array, Array]:
        """Lowest and highest position of each drive [m], (6,) each."""
        return self.limits.strokes

    @property
    def moved_mass(self) -> float:
        """Mass of the platform and its payload [kg]."""
        return float(self.values['masses.platform'] + self.values['masses.payload'])

    @property
    def effort_limits(self) -> Array:
        """Largest absolute effort that each drive can apply [N], (6,)."""
        return self.limits.efforts

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any], source: str = '') -> DriveModel:
        """Build the model from flat keys and values; see `ForceModel.from_parameters`."""
        with source_of_errors(source):
            other = next((name for name in parameters if is_axis((name,)) or is_mechanism((name,))),
                         None)
            if other is not None:
                raise ModelError(other, parameters[other], 'not be given: this needs a 3-PPRS, and '
                                 f'{title_of(parameters)} is for pprs compare, diagnose, adopt, '
                                 'fit and history')
            values = checked_values(parameters)
            for stroke in ('limits.slide_stroke', 'limits.lift_stroke'):
                if not values[stroke][0] < values[stroke][1]:
                    raise ModelError(stroke, values[stroke],
                                     'be a lower and a higher position [m]')
            robot = Robot(Geometry(**_group(values, 'geometry.')),
                          Masses(**_group(values, 'masses.')),
                          gravity_in_efforts(values, 'gravity'),
                          (values['friction.revolute.diameter'] / 2,
                           values['friction.spherical.diameter'] / 2))
            limits = Limits.of(values)
            effects = (ActiveFriction(**_group(values, 'friction.drives.')),
                       _passive_friction(values, limits),
                       *added_effects(parameters, cls.kind, cls.drives, robot))
            _require_bodies(robot, effects)
            reversal = Reversal(_reversal_velocity(values), values['friction.reversal_rate'])
            return cls(robot=robot, effects=effects, limits=limits, reversal=reversal,
                       equations=values['equations'], values=values, source=source)

    def motion_of_drives(self, position: Array, velocity: Array, acceleration: Array,
                         seed: PlatformMotion | None = None) -> PlatformMotion:
        """Return the platform's motion, by forward kinematics."""
        return solve_forward_motion(
            self.robot.geometry, position, velocity, acceleration, seed).motion

    def mechanism(self, motion: PlatformMotion) -> ThreePprsState:
        """Return drive motion, Jacobians and frictionless forces for a platform motion.

        Raises
        ------
        WorkspaceError
            For a pose out of reach.
        SingularityError
            For a pose nearer to a singularity than `limits.rod_sine` or
            `limits.condition_number` allow.
        """
        # Very large numbers overflow; users of the result check that it is finite.
        with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
            return solve_mechanism(
                self.robot, motion, reversal=self.reversal, printed=self.equations == 'printed',
                minimum_sine=self.limits.rod_sine, condition_limit=self.limits.condition_number)

    def at_drives(self, state: ThreePprsState) -> ThreePprsState:
        """Return the state in which the platform follows drives that move as in another."""
        found = solve_forward_motion(self.robot.geometry, state.position, state.velocity,
                                     state.acceleration, state.motion[:1]).motion.with_channels(
                                         state.channels)
        return self.mechanism(found if state.time is None else found.with_time(state.time))

    def drive_forces(self, motion: PlatformMotion, state: ModelState | None = None) -> Forces:
        """Return the forces for a platform motion; see `ForceModel.drive_forces`."""
        self._require_motion(motion)
        one_pass = self._one_pass
        table = None if one_pass is None else one_pass.forces(motion)
        if one_pass is None or table is None:
            return self.forces_at(self.mechanism(motion), state)
        added = self.effects[2:]
        if added:
            return self._with_effects(added, one_pass.parts(table),
                                      one_pass.mechanism(motion, table), state)
        if state is not None:
            state.advance(motion.time, self.initial_state)
        return Forces(table[0], lambda: one_pass.parts(table),
                      lambda: one_pass.mechanism(motion, table))

    @cached_property
    def _one_pass(self) -> OnePass | None:
        """The paper's model in one pass, where no effect changes the bodies that it is of."""
        match self.effects:
            case (ActiveFriction() as active, WholeMechanismFriction() as passive, *added):
                if not any(isinstance(effect, BodyEffect) for effect in added):
                    return OnePass(self.robot, active, passive, self.limits, self.reversal,
                                   self.equations == 'printed')
        return None

    def variables(self, state: ThreePprsState) -> dict[str, Array]:
        """Return loads of the guides, rod angles, and where the platform is."""
        motion = state.motion
        x, y, z = motion.position.T
        return {'load': state.friction_load, 'rod_angle': np.tile(state.chains.rod_angle, 2),
                'platform_x': x, 'platform_y': y, 'platform_z': z,
                'platform_tilt': motion.tilt, 'platform_turn': motion.turn}

    def condition_number(self, motion: PlatformMotion) -> Array:
        """Return the condition number of the drive Jacobian, rotations times r, (N,).

        Unlike `drive_forces` it answers beyond `limits.condition_number` too.
        """
        mechanism = solve_mechanism(self.robot, motion, minimum_sine=self.limits.rod_sine)
        return condition_number(self.robot.geometry, mechanism.jacobians.J)

    def at_home(self, samples: int) -> PlatformMotion:
        """Return the platform at rest at its home pose."""
        return PlatformMotion.at_rest(np.tile([0.0, 0.0, HOME_HEIGHT], (samples, 1)),
                                      np.tile([0.0, 0.0, 0.0, 1.0], (samples, 1)))

    def singularity_margin(self, state: ThreePprsState) -> float:
        """Return 1 minus the largest of three shares, see `ForceModel.singularity_margin`.

        Condition number over its limit, smallest sine of a rod angle over that of the rods, and,
        with independent chains, the ratio for the cosine.
        """
        limits, J = self.limits, state.jacobians.J
        number = condition_number(self.robot.geometry, J[::-(-len(J) // MOST_CONDITIONS)])
        used = [number.max() / limits.condition_number,
                limits.rod_sine / np.abs(state.chains.sin_u).min()]
        if any(isinstance(effect, IndependentChainsFriction) for effect in self.effects):
            used.append(limits.rod_cosine / np.abs(state.chains.cos_u).min())
        return float(1 - max(used))


def _group(values: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Return the keys and values right below a prefix."""
    return {name.removeprefix(prefix): value for name, value in values.items()
            if name.startswith(prefix) and '.' not in name.removeprefix(prefix)}


def _passive_friction(values: Mapping[str, Any], limits: Limits) -> PassiveFriction:
    joints = (JointCoefficients(**_group(values, 'friction.revolute.')),
              JointCoefficients(**_group(values, 'friction.spherical.')))
    printed = values['equations'] == 'printed'
    if values['friction.approach'] == WholeMechanismFriction.approach:
        return WholeMechanismFriction(*joints, printed)
    return IndependentChainsFriction(*joints, printed, limits.rod_cosine)


def _reversal_velocity(values: Mapping[str, Any]) -> float | tuple[float, ...]:
    """Return the width that all drives share, or one for each."""
    common: float = values['friction.reversal_velocity']
    own: tuple[float, ...] = values['friction.reversal_velocities']
    return tuple(width or common for width in own) if any(own) else common


def _require_bodies(robot: Robot, effects: Sequence[Effect]) -> None:
    """Raise ModelError where effects leave bodies that cannot be."""
    for effect in effects:
        if isinstance(effect, BodyEffect):
            robot = effect.changed(robot)
            if not robot.masses.total > 0 or min(robot.masses.rods) < 0:
                raise ModelError(f'effects.{effect.name}', effect.to_file(),
                                 'leave masses greater than 0')
