# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model of a serial arm from its URDF.

tau = RNEA(q, q_dot, q_ddot) + armature q_ddot + F_v q_dot + F_c sgn(q_dot) + offset + effects,
per joint, positive along the joint's positive direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MISSING, ModelError
from pprs_dynamics.physics.effects.effect import ARM, CatalogueEffect
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.arm import Arm, ArmState
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.mechanism.units import DriveUnits
from pprs_dynamics.physics.mechanism.urdf import TURNING, ArmTree, read_arm
from pprs_dynamics.physics.model.effects_block import added_effects
from pprs_dynamics.physics.model.force_model import (
    RIGID_BODY,
    ForceModel,
    Forces,
    ModelState,
    total_force,
)
from pprs_dynamics.physics.model.keys import ARM_GAIN, ARM_JOINTS, ARM_URDF, Key, arm_keys, is_arm
from pprs_dynamics.physics.model.limits import JointLimits
from pprs_dynamics.physics.model.parameter_file import find_file, read_parameters
from pprs_dynamics.physics.model.parameter_values import checked_values, source_of_errors

# Reversals of friction take a hundredth of a period; what is faster is ripple of motor and gear.
BLOCKS_PER_PERIOD = 100.0
# Elements of an inertia tensor: as files have them, and as Pinocchio has them.
OF_FILES, OF_PINOCCHIO = ('xx', 'yy', 'zz', 'xy', 'xz', 'yz'), ('xx', 'xy', 'yy', 'xz', 'yz', 'zz')
FROM_FILES = [OF_FILES.index(axes) for axes in OF_PINOCCHIO]
TO_FILES = [OF_PINOCCHIO.index(axes) for axes in OF_FILES]


@dataclass(frozen=True)
class ArmForces(Forces):
    """Efforts of N samples, (N, n)."""

    mechanism: ArmState


@dataclass(frozen=True, kw_only=True)
class ArmModel(ForceModel):
    """The inverse dynamic model of a serial arm.

    Parameters
    ----------
    arm : Arm
    effects, reversal, values, source
        See `ForceModel`; friction and offset are the first effects.
    """

    kind: ClassVar[str] = ARM
    title: ClassVar[str] = 'a serial arm'

    arm: Arm

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.arm.tree.joints

    @property
    def keys(self) -> dict[str, Key]:
        """Keys of its files, by name."""
        return arm_keys(len(self.drives))

    @property
    def units(self) -> tuple[DriveUnits, ...]:
        """Units of the joints' quantities."""
        return tuple(DriveUnits(kind == TURNING) for kind in self.kinds)

    @property
    def content(self) -> str:
        """Hash of the URDF."""
        return self.arm.tree.digest

    @property
    def gain(self) -> tuple[float, ...]:
        """Torque, or force, per ampere of each joint [N m/A, N/A]."""
        gain: tuple[float, ...] = self.values[ARM_GAIN]
        return gain

    @property
    def gear_ratios(self) -> tuple[float, ...]:
        """Turns of the motor per turn of each joint."""
        ratios: tuple[float, ...] = self.values['arm.gear_ratio']
        return ratios

    @property
    def effort_limits(self) -> Array:
        """Largest absolute effort of each joint by the URDF [N m, N], (D,); may be infinite."""
        return self.limits.efforts

    @property
    def efforts_in_amperes(self) -> bool:
        """Whether efforts of recordings are currents."""
        return bool(self.values['arm.effort_unit'] == 'A')

    @property
    def rest_speed(self) -> float:
        """Speed [rad/s, m/s] below which a joint stands, and its gear holds any torque."""
        return float(np.min(self.reversal.velocity))

    @property
    def blocks_per_period(self) -> float:
        """Means of efforts that are compared in a period of the motion."""
        return BLOCKS_PER_PERIOD

    @cached_property
    def limits(self) -> JointLimits:
        """Ranges and efforts of the URDF, the latter in the unit of recordings and commands."""
        tree, units = self.arm.tree, self.units
        # A URDF may leave them out, of a prismatic joint as well.
        bounded = tree.lower < tree.upper
        return JointLimits(
            tree.joints, tuple(one.position for one in units),
            tuple('A' if self.efforts_in_amperes else one.effort for one in units),
            np.where(bounded, tree.lower, -np.inf), np.where(bounded, tree.upper, np.inf),
            tree.effort * self.amperes)

    @property
    def kinds(self) -> tuple[str, ...]:
        """`revolute` or `prismatic`, of each joint."""
        return self.arm.tree.kinds

    @classmethod
    def load(cls, path: str | PathLike[str]) -> ArmModel:
        """Read a model file, as `DriveModel.load`.

        Raises
        ------
        UnreadableFileError
            Where the file, or its URDF, does not exist or cannot be read.
        ModelError
            For a key that is unknown, missing, of the wrong type or impossible, and for a URDF
            that is not covered.
        MissingLibraryError
            Without Pinocchio.
        """
        file = find_file(path)
        return cls.from_parameters(read_parameters(file), source=str(file))

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any], source: str = '') -> ArmModel:
        """Build the model from flat keys and values, each checked; see `build_model`."""
        with source_of_errors(source):
            if not is_arm(parameters):
                raise ModelError(ARM_URDF, MISSING, 'be given: this needs a serial arm')
            if ARM_JOINTS in parameters and not parameters[ARM_JOINTS]:
                raise ModelError(ARM_JOINTS, parameters[ARM_JOINTS], 'name at least one joint')
            values = checked_values(parameters)
            values[ARM_URDF] = str((Path(source).parent / values[ARM_URDF]).resolve())
            tree = read_arm(values[ARM_URDF], values['arm.base'], values['arm.tool'],
                            values[ARM_JOINTS])
            arm = Arm(tree, _inertial(tree, values), np.array(values['arm.armature']),
                      values['arm.gravity'])
            effects = (AxisFriction(values['friction.viscous'], values['friction.coulomb']),
                       AxisOffset(values['friction.offset']),
                       *added_effects(parameters, cls, tree.joints))
            loaded = arm
            for effect in effects:
                if isinstance(effect, BodyEffect):
                    _require_present(effect, arm)
                    loaded = effect.changed(loaded)
                    _require_bodies(effect, loaded)
            common = values['friction.reversal_velocity']
            width = tuple(own or common for own in values['friction.reversal_velocities'])
            return cls(arm=arm, effects=effects, reversal=Reversal(width), values=values,
                       source=source)

    def drive_forces(self, motion: JointMotion, state: ModelState | None = None) -> ArmForces:
        """Return the efforts that the joints need for a motion.

        Parameters
        ----------
        motion : JointMotion
        state : ModelState, optional
            Carries effects with memory from call to call; see `DriveModel.drive_forces`.
        """
        # Very large numbers overflow; users of the result check that it is finite.
        with np.errstate(over='ignore', invalid='ignore'):
            return self.forces_at(self.mechanism(motion), state)

    def mechanism(self, motion: JointMotion) -> ArmState:
        """Return what effects take of a motion."""
        return ArmState(motion.position, motion.velocity, motion.acceleration, motion.time,
                        robot=self.arm, reversal=self.reversal)

    def forces_at(self, mechanism: ArmState, state: ModelState | None = None) -> ArmForces:
        """Return the efforts at a state of the arm; see `drive_forces`."""
        state = self.initial_state() if state is None else state
        parts = {RIGID_BODY: mechanism.rigid_force}
        for effect in self.effects:
            effect.check_memory(state.memories)
            # Bodies and what acts on them change the loads that friction follows: they go first.
            if isinstance(effect, BodyEffect):
                loaded = effect.apply(mechanism)
                parts[effect.name] = loaded.rigid_force - mechanism.rigid_force
                mechanism = loaded
        at: Any = mechanism
        for effect in self.effects:
            if not effect.is_measurement and not isinstance(effect, BodyEffect):
                parts[effect.name] = effect.force(at, state.memories[effect.name])
        return ArmForces(total_force(tuple(parts.values())), parts, mechanism)

    def variables(self, state: ArmState) -> dict[str, Array]:
        """Return the loads of the gears."""
        return {'load': state.guide_load}


def inertial_values(inertial: Array) -> dict[str, tuple[float, ...]]:
    """Return the keys and values in files of inertial parameters (n, 10); see `Arm`."""
    return {'links.mass': tuple(inertial[:, 0].tolist()),
            'links.moment': tuple(inertial[:, 1:4].ravel().tolist()),
            'links.inertia': tuple(inertial[:, 4:][:, TO_FILES].ravel().tolist())}


def _inertial(tree: ArmTree, values: Mapping[str, Any]) -> Array:
    """Return the inertial parameters of the links, from the file where it has them."""
    inertial = tree.inertial.copy()
    if values['links.mass']:
        inertial[:, 0] = values['links.mass']
    if values['links.moment']:
        inertial[:, 1:4] = np.reshape(values['links.moment'], (-1, 3))
    if values['links.inertia']:
        inertial[:, 4:] = np.reshape(values['links.inertia'], (-1, 6))[:, FROM_FILES]
    for name, mass in zip(tree.joints, inertial[:, 0], strict=True):
        if not mass > 0:
            raise ModelError('links.mass', float(mass), f'be greater than 0 for what {name} moves')
    return inertial


def _require_present(effect: BodyEffect, arm: Arm) -> None:
    """Raise ModelError where an effect changes a body that the arm does not have."""
    for name in sorted(effect.absent(arm)):
        if effect.values[name]:
            raise ModelError(
                f'effects.{effect.name}.{name}', effect.values[name], 'be left out: this arm has '
                'no such link, or it is the one that carries the tool, of which payload_mass tells')


def _require_bodies(effect: CatalogueEffect, arm: Arm) -> None:
    """Raise ModelError where an effect leaves bodies that cannot be."""
    if not np.all(arm.masses > 0):
        raise ModelError(f'effects.{effect.name}', effect.to_file(),
                         'leave masses greater than 0')
