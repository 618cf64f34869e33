# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model of a mechanism: a single axis, a serial arm, or a robot with loops.

tau = T' RNEA(q, q_dot, q_ddot) + armature q_ddot + F_v q_dot + F_c sgn(q_dot) + offset + effects,
per drive, positive along its positive direction; T, rates of all joints per rate of the drives.
Arms and robots with loops come from a description; of an axis the file says all: M (q_ddot - g).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.errors import MISSING, ModelError
from pprs_dynamics.physics.effects.effect import ARM, SINGLE_AXIS, CatalogueEffect, Effect
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.description import REVOLUTE
from pprs_dynamics.physics.mechanism.evaluation import not_compiling_yet
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.mechanism import Mechanism, MechanismState
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.mechanism.structure import Structure
from pprs_dynamics.physics.mechanism.tool_pose import ToolPose
from pprs_dynamics.physics.mechanism.tree_equations import (
    ARMATURE,
    COULOMB,
    DRIVE_FRICTION,
    JOINT_EFFORT,
    OF_DRIVE,
    OFFSET,
    RIGID,
    TOTAL,
    VISCOUS,
    WIDTH,
    WORST_CONDITION,
    JointFriction,
)
from pprs_dynamics.physics.mechanism.tree_evaluation import NO_FRICTION, InverseDynamicsResult
from pprs_dynamics.physics.model.effects_block import added_effects
from pprs_dynamics.physics.model.force_model import RIGID_BODY, ForceModel, Forces, ModelState
from pprs_dynamics.physics.model.keys import (
    AXIS,
    DRIVES_KEY,
    GAIN,
    ROBOT,
    Key,
    is_axis,
    is_mechanism,
    keys_of,
)
from pprs_dynamics.physics.model.limits import JointLimits
from pprs_dynamics.physics.model.parameter_values import checked_values, source_of_errors
from pprs_dynamics.physics.model.recorded_names import CURRENT, gravity_in_efforts
from pprs_dynamics.physics.model.robot_block import (
    axis_mechanism,
    described_values,
    joint_radii,
    motor_map,
    passive_friction,
    read_structure,
)

# Reversals of friction take a hundredth of a period; what is faster is ripple of motor and gear.
BLOCKS_PER_PERIOD = 100.0
# Elements of an inertia tensor: as files have them, and as `Mechanism` has them.
OF_FILES, OF_MECHANISM = ('xx', 'yy', 'zz', 'xy', 'xz', 'yz'), ('xx', 'xy', 'yy', 'xz', 'yz', 'zz')
FROM_FILES = [OF_FILES.index(axes) for axes in OF_MECHANISM]
TO_FILES = [OF_MECHANISM.index(axes) for axes in OF_FILES]


@dataclass(frozen=True, kw_only=True)
class MechanismModel(ForceModel):
    """The inverse dynamic model of a mechanism.

    Parameters
    ----------
    robot : Mechanism
    effects, reversal, values, source
        See `ForceModel`; friction and offset are the first effects.
    """

    takes_long: ClassVar[bool] = True

    robot: Mechanism

    @property
    def motions(self) -> tuple[type, ...]:
        """What it has forces for; poses of the tool where it has loops."""
        return (JointMotion, PlatformMotion) if self.robot.structure.loops else (JointMotion,)

    @property
    def kind(self) -> str:
        """'axis', or 'arm' for what has a description."""
        return ARM if self.is_described else SINGLE_AXIS

    @property
    def is_described(self) -> bool:
        """Whether bodies and joints are those of a description; not of an axis."""
        return self.block != AXIS

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return self.robot.structure.drives

    @property
    def strokes(self) -> tuple[Array, Array]:
        """Lowest and highest position of each drive [m, rad], (D,) each."""
        return self.limits.strokes

    @property
    def speed_limits(self) -> Array:
        """Largest speed of each drive by the description [m/s, rad/s], (D,)."""
        speed: Array = self.robot.structure.speed
        return speed

    @property
    def friction(self) -> AxisFriction:
        """The friction of its drives."""
        return next(one for one in self.effects if isinstance(one, AxisFriction))

    @property
    def offset(self) -> AxisOffset:
        """The constant efforts of its drives."""
        return next(one for one in self.effects if isinstance(one, AxisOffset))

    @property
    def block(self) -> str:
        """Block of its file: `robot` or `axis`."""
        return ROBOT if is_mechanism(self.values) else AXIS

    @cached_property
    def keys(self) -> dict[str, Key]:
        """Keys of its files, by name."""
        return keys_of(self.values)

    @property
    def units(self) -> tuple[DriveUnits, ...]:
        """Units of the drives' quantities."""
        return tuple(DriveUnits(kind == REVOLUTE) for kind in self.robot.structure.kinds)

    @property
    def content(self) -> str:
        """Hash of the description."""
        return self.robot.structure.description.digest

    @property
    def gain(self) -> tuple[float, ...] | None:
        """Torque, or force, per ampere of each drive [N m/A, N/A]; None of an axis."""
        return self.values.get(GAIN)

    @property
    def gear_ratios(self) -> tuple[float, ...]:
        """Turns of the motor per turn of each drive."""
        ratios: tuple[float, ...] = self.values.get('robot.gear_ratio', super().gear_ratios)
        return ratios

    @property
    def moved_mass(self) -> float:
        """Mass of all links [kg]."""
        return float(self.robot.masses.sum())

    @property
    def effort_limits(self) -> Array:
        """Largest absolute effort of each joint by the URDF [N m, N], (D,); may be infinite."""
        return self.limits.efforts

    @property
    def faults(self) -> tuple[str, ...]:
        """Sentences on bodies that cannot be, unless the file has other inertia than the URDF."""
        return () if self.values.get('links.inertia') else self.robot.structure.description.faults

    @property
    def efforts_in_amperes(self) -> bool:
        """Whether efforts of recordings are currents."""
        return (self.effort_kind == CURRENT
                or self.values.get('robot.effort_unit') == 'A')

    @property
    def rest_speed(self) -> float:
        """Speed [rad/s, m/s] below which a joint stands, and its gear holds any torque.

        The file's own, not that of a fit: which samples count must not change with the widths
        that are fitted to them. An axis on a bench has no such gear: its efforts at rest count.
        """
        return float(self.values['friction.reversal_velocity']) if self.is_described else 0.0

    @property
    def blocks_per_period(self) -> float:
        """Means of efforts that are compared in a period of the motion."""
        return BLOCKS_PER_PERIOD if self.is_described else 0.0

    @cached_property
    def limits(self) -> JointLimits:
        """Ranges and efforts of the description."""
        structure, units = self.robot.structure, self.units
        return JointLimits(
            structure.drives, tuple(one.position for one in units),
            tuple(one.effort for one in units),
            structure.lower, structure.upper, structure.effort)

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any], source: str = '') -> MechanismModel:
        """Build the model from flat keys and values; see `ForceModel.from_parameters`."""
        with source_of_errors(source):
            if is_axis(parameters):
                return cls._axis(parameters, source)
            if not is_mechanism(parameters):
                raise ModelError('robot.urdf', MISSING, 'be given: this needs a serial arm, a '
                                 'robot with loops or a single axis')
            if DRIVES_KEY in parameters and not parameters[DRIVES_KEY]:
                raise ModelError(DRIVES_KEY, parameters[DRIVES_KEY], 'name at least one joint')
            values = checked_values(parameters)
            structure = read_structure(values, Path(source).parent)
            values.update(described_values(structure, values))
            robot = _mechanism(structure, values)
            effects = (AxisFriction(values['friction.viscous'], values['friction.coulomb']),
                       AxisOffset(values['friction.offset']), *passive_friction(structure, values),
                       *added_effects(parameters, ARM, structure.drives, robot,
                                      structure.turning))
            loaded = robot
            for effect in effects:
                if isinstance(effect, BodyEffect):
                    loaded = effect.changed(loaded)
                    _require_bodies(effect, loaded)
            common = values['friction.reversal_velocity']
            width = tuple(own or common for own in values['friction.reversal_velocities'])
            return cls(robot=robot, effects=effects,
                       reversal=Reversal(width, values.get('friction.reversal_rate', common),
                                         values.get('friction.reversal_slide', common)),
                       values=values, source=source)

    @classmethod
    def _axis(cls, parameters: Mapping[str, Any], source: str) -> MechanismModel:
        """Build the model of an axis."""
        values = checked_values(parameters)
        robot = axis_mechanism(values['axis.mass'], gravity_in_efforts(values, 'axis.gravity'))
        drives = robot.structure.drives
        effects = (AxisFriction(values['axis.viscous'], values['axis.coulomb']),
                   AxisOffset(values['axis.offset']),
                   *added_effects(parameters, SINGLE_AXIS, drives, robot))
        return cls(robot=robot, effects=effects, values=values, source=source,
                   reversal=Reversal(values['friction.reversal_velocity']))

    @cached_property
    def tool_pose(self) -> ToolPose:
        """The drives' motion from that of the tool.

        Raises
        ------
        ModelError
            Where the tool's pose does not determine the drives.
        """
        return ToolPose(self.robot.structure)

    def drive_forces(self, motion: JointMotion | PlatformMotion, state: ModelState | None = None,
                     ) -> Forces:
        """Return the forces for a motion; see `ForceModel.drive_forces`.

        With a state the loops close from where they were at its last sample, where that is near.
        """
        self._require_motion(motion)
        structure, added = self.robot.structure, self._added
        if isinstance(motion, JointMotion) and added is not None:
            found = structure.evaluation.inverse_dynamics(
                (motion.position, motion.velocity, motion.acceleration), self.robot.by_joint,
                self.robot.gravity_row, self._joint_friction, self._actuators,
                nearby=None if state is None else state.closed.get(structure))
            if found is not None:
                if state is not None and structure.loops and len(motion):
                    state.closed[structure] = found.q[-1].copy()
                if added:
                    return self._with_effects(added, self._parts(found),
                                              self._state(motion, found), state)
                if state is not None:
                    state.advance(motion.time, self.initial_state)
                return Forces(found.efforts[TOTAL], lambda: self._parts(found),
                              lambda: self._state(motion, found))
        if state is None:
            state = self.initial_state()
        with np.errstate(over='ignore', invalid='ignore'):
            mechanism = self.mechanism(motion, state.closed)
            forces = self.forces_at(mechanism, state)
        if len(motion) and structure.loops:
            state.closed[structure] = mechanism.closed[-1].copy()
        return forces

    @cached_property
    def _added(self) -> tuple[Effect, ...] | None:
        """Effects beside the model's own friction; None where one of them changes the bodies."""
        own = AxisFriction, AxisOffset, ModelJointFriction
        added = tuple(effect for effect in self.effects if not isinstance(effect, own))
        return None if any(isinstance(effect, BodyEffect) for effect in added) else added

    @cached_property
    def _actuators(self) -> Array:
        """Rotors and friction of the drives, see `actuator_efforts`."""
        actuators = np.zeros((OF_DRIVE, len(self.drives)))
        actuators[ARMATURE] = self.robot.armature
        actuators[WIDTH] = self.reversal.velocity
        for effect in self.effects:
            if isinstance(effect, AxisFriction):
                actuators[VISCOUS], actuators[COULOMB] = effect.viscous, effect.coulomb
            elif isinstance(effect, AxisOffset):
                actuators[OFFSET] = effect.value
        return actuators

    def _parts(self, found: InverseDynamicsResult) -> dict[str, Array]:
        """Return the parts of efforts by name, in the order of the effects."""
        offset = self._actuators[OFFSET] + np.zeros_like(found.efforts[TOTAL])
        own = {AxisFriction.name: found.efforts[DRIVE_FRICTION], AxisOffset.name: offset,
               ModelJointFriction.name: found.efforts[JOINT_EFFORT]}
        return {RIGID_BODY: found.efforts[RIGID],
                **{effect.name: own[effect.name] for effect in self.effects if effect.name in own}}

    def _state(self, motion: JointMotion, found: InverseDynamicsResult) -> MechanismState:
        """Return the state of the mechanism whose efforts are known already."""
        state = self.mechanism(motion)
        vars(state).update(inverse_dynamics=found, rigid_force=found.efforts[RIGID])
        return state

    def motion_of_drives(self, position: Array, velocity: Array, acceleration: Array,
                         seed: JointMotion | None = None) -> JointMotion:
        """Return the same: loops are closed where forces are evaluated."""
        return JointMotion(position, velocity, acceleration)

    def mechanism(self, motion: JointMotion | PlatformMotion,
                  closed: dict[Any, Array] | None = None) -> MechanismState:
        """Return what effects take of a motion; see `drive_forces` and `ModelState.closed`."""
        closed = {} if closed is None else closed
        start, nearby = None, closed.get(self.robot.structure)
        if isinstance(motion, PlatformMotion):
            # The assembly is that of the pose, whichever the same drives would find from home.
            motion, start = self.tool_pose.drives(motion, closed)
            nearby = None
        return MechanismState(motion.position, motion.velocity, motion.acceleration, motion.time,
                              channels=motion.channels, robot=self.robot, reversal=self.reversal,
                              start=start, nearby=nearby, friction=self._joint_friction)

    @cached_property
    def _joint_friction(self) -> JointFriction:
        """The model's own friction of joints, which is found in one pass with the efforts."""
        return next((effect.table(self.robot, self.reversal) for effect in self.effects
                     if isinstance(effect, ModelJointFriction)), NO_FRICTION)

    def at_drives(self, state: MechanismState) -> MechanismState:
        """Return the state in which the links follow drives that move as in another."""
        return self.mechanism(state)

    def at_home(self, samples: int) -> JointMotion:
        """Return the drives at rest where the description has them."""
        structure = self.robot.structure
        position = np.tile(structure.home[structure.tables.drives], (samples, 1))
        still = np.zeros_like(position)
        return JointMotion(position, still, still, np.arange(samples, dtype=float))

    def singularity_margin(self, state: MechanismState) -> float | None:
        """Return 1 minus the condition number of the closures over its limit; None without any."""
        if not self.robot.structure.loops:
            return None
        return float(1 - state.links.condition.max() / WORST_CONDITION)

    def variables(self, state: MechanismState) -> dict[str, Array]:
        """Return the loads of the gears, where they are known."""
        return {'load': state.friction_load} if self.robot.load_is_known else {}


def inertial_values(inertial: Array) -> dict[str, tuple[float, ...]]:
    """Return the keys and values in files of inertial parameters (B, 10); see `Mechanism`."""
    return {'links.mass': tuple(inertial[:, 0].tolist()),
            'links.moment': tuple(inertial[:, 1:4].ravel().tolist()),
            'links.inertia': tuple(inertial[:, 4:][:, TO_FILES].ravel().tolist())}


def _mechanism(structure: Structure, values: Mapping[str, Any]) -> Mechanism:
    """Return the mechanism with its bodies, from the file where it has them."""
    bodies = np.flatnonzero(structure.inertial.any(axis=1))
    inertial = structure.inertial[bodies]
    for key, first, size in (('links.mass', 0, 1), ('links.moment', 1, 3),
                             ('links.inertia', 4, 6)):
        if not values[key]:
            continue
        if len(values[key]) != size * len(bodies):
            names = ', '.join(structure.moved_by[int(row)] for row in bodies)
            raise ModelError(key, list(values[key]), f'hold {size * len(bodies)} numbers, {size} '
                             f'for each of {names}')
        given = np.reshape(values[key], (-1, size))
        inertial[:, first:first + size] = given[:, FROM_FILES] if size == 6 else given
    for row, (mass, *moment) in zip(bodies, inertial[:, :4], strict=True):
        if mass < 0 or (mass == 0 and any(moment)):
            name = next(name for name, at in structure.rows.items() if at == row)
            raise ModelError('links.mass', float(mass), f'be greater than 0 for what {name} moves')
    robot = Mechanism(structure, bodies, inertial, np.array(values['robot.armature']),
                      gravity_in_efforts(values, 'robot.gravity'), joint_radii(values),
                      motor_map(structure, values))
    _require_driven_bodies(robot)
    return robot


def _require_driven_bodies(robot: Mechanism) -> None:
    """Raise ModelError for a drive that moves no mass at home."""
    structure = robot.structure
    home = structure.home[None, structure.tables.drives]
    for d, name in enumerate(structure.drives):
        pushed = np.zeros_like(home)
        pushed[0, d] = 1.0
        rest = np.zeros_like(home)
        with not_compiling_yet():
            moved, still = (robot.torques(home, rest, one)[0, d] for one in (pushed, rest))
        if not moved - still + robot.armature[d] > 0:
            raise ModelError(DRIVES_KEY, name,
                             'move a body: no link that it moves has a mass')


def _require_bodies(effect: CatalogueEffect, robot: Mechanism) -> None:
    """Raise ModelError where an effect leaves bodies that cannot be."""
    moments = robot.inertial[:, 1:4].any(axis=1)
    if np.any((robot.masses < 0) | (robot.masses == 0) & moments):
        raise ModelError(f'effects.{effect.name}', effect.to_file(),
                         'leave masses greater than 0')
