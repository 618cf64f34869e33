# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The rigid body and the model's own friction in one pass over the samples.

No intermediate quantity is stored. The equations are those that states and effects evaluate step
by step, which takes three times as long.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array, Sample, Value
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.evaluation import evaluate
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.motion_sample import motion_sample
from pprs_dynamics.physics.mechanism.reversal import Reversal, smooth_sign
from pprs_dynamics.physics.mechanism.state import MechanismState
from pprs_dynamics.physics.mechanism.tree_evaluation import InverseDynamicsResult
from pprs_dynamics.physics.mechanism.tree_tables import (
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
    JointFriction,
)
from pprs_dynamics.physics.mechanism.vectors import Vector
from pprs_dynamics.physics.model.forces import (
    ACTIVE_FRICTION,
    PASSIVE_FRICTION,
    RIGID_BODY,
    Forces,
    total_force,
)
from pprs_dynamics.physics.three_pprs.active_friction import ActiveFriction, drive_friction
from pprs_dynamics.physics.three_pprs.chains import CHAINS, each_chain
from pprs_dynamics.physics.three_pprs.closure import (
    Wrench,
    condition_bound,
    eliminate,
    invert,
    rows_of_chains,
)
from pprs_dynamics.physics.three_pprs.inverse_kinematics import (
    ChainSample,
    ThreeChains,
    are_within_reach,
    chain_motions,
)
from pprs_dynamics.physics.three_pprs.joint_rates import turnover
from pprs_dynamics.physics.three_pprs.kernel_parameters import Joints, RobotParameters
from pprs_dynamics.physics.three_pprs.passive_friction import (
    PassiveFriction,
    WholeMechanismFriction,
)
from pprs_dynamics.physics.three_pprs.passive_joints import (
    JointResistance,
    friction_forces,
    joint_resistances,
)
from pprs_dynamics.physics.three_pprs.rigid_body import ThreeForces, body_forces
from pprs_dynamics.physics.three_pprs.robot import ThreePprs


class DriveFriction(NamedTuple):
    """Friction of one drive: c [N s/m], mu and the reversal velocity [m/s]."""

    viscous: Value
    coulomb: Value
    reversal_velocity: Value


class ForcesParameters(NamedTuple):
    """Parameters of `forces_kernel`.

    `printed` is 1 for Eq. (7) to the letter, else 0; `bound` is the square of the condition
    number allowed, `drives` six of `DriveFriction`.
    """

    robot: RobotParameters
    platform_radius: Value
    printed: Value
    minimum_sine: Value
    bound: Value
    joints: Joints
    drives: tuple[DriveFriction, ...]


FORCES = 4  # total and three parts
# Samples up to which the drives' motion is kept with the forces: a node checks it before it
# answers; of a recording, writing it would take longer than calculating it where it is needed.
SHORT = 2048


class PlatformPass:
    """One pass of the 3-PPRS.

    Parameters
    ----------
    robot : ThreePprs
    active : ActiveFriction
    passive : WholeMechanismFriction
    reversal : Reversal
    """

    OWN = ActiveFriction, PassiveFriction

    def __init__(self, robot: ThreePprs, active: ActiveFriction, passive: WholeMechanismFriction,
                 reversal: Reversal) -> None:
        self._robot, self._reversal = robot, reversal
        widths = reversal.widths(len(active.viscous)).tolist()
        drives = zip(active.viscous, active.coulomb, widths, strict=True)
        self.parameters = robot.kernel_parameters.extended(
            ForcesParameters, robot.geometry.platform_radius, float(robot.printed),
            robot.bounds.rod_sine, robot.bounds.condition_number ** 2, passive.joints(reversal),
            tuple(DriveFriction(*drive) for drive in drives))

    def forces(self, motion: PlatformMotion, closed: object) -> Forces | None:
        """Return the forces with the own friction.

        None where a sample may be out of reach or too near a singularity: the caller must check
        every sample then.
        """
        rows = motion.rows
        table = np.empty((FORCES + 3 if len(rows) <= SHORT else FORCES, len(rows), 6))
        if evaluate(forces_kernel, self.parameters, rows, table) >= 0:
            return None

        def drive_motion() -> tuple[Array, Array, Array]:
            return table[FORCES], table[FORCES + 1], table[FORCES + 2]

        if len(table) == FORCES:
            return Forces(table[0], lambda: self._parts(table),
                          lambda: self._robot.state(motion, self._reversal))
        return Forces(
            table[0], lambda: self._parts(table),
            lambda: self._robot.state(motion, self._reversal, drive_motion=drive_motion()),
            drive_motion)

    @staticmethod
    def _parts(table: Array) -> dict[str, Array]:
        return {RIGID_BODY: table[1], ACTIVE_FRICTION: table[2], PASSIVE_FRICTION: table[3]}


class TreePass:
    """One pass of any other mechanism.

    Parameters
    ----------
    robot : Mechanism
    effects : tuple of Effect
    reversal : Reversal
    joints : JointFriction
        The model's own.
    """

    OWN = AxisFriction, AxisOffset, ModelJointFriction

    def __init__(self, robot: Mechanism, effects: tuple[Effect, ...], reversal: Reversal,
                 joints: JointFriction) -> None:
        self._robot, self._reversal, self._joints = robot, reversal, joints
        self._own = [effect.name for effect in effects if isinstance(effect, self.OWN)]
        self._actuators = np.zeros((OF_DRIVE, len(robot.drives)))
        self._actuators[ARMATURE] = robot.armature
        self._actuators[WIDTH] = reversal.velocity
        for effect in effects:
            if isinstance(effect, AxisFriction):
                self._actuators[VISCOUS], self._actuators[COULOMB] = effect.viscous, effect.coulomb
            elif isinstance(effect, AxisOffset):
                self._actuators[OFFSET] = effect.value

    def forces(self, motion: JointMotion | PlatformMotion, closed: dict[Any, Array] | None,
               ) -> Forces | None:
        """Return the forces with the own friction for a motion of the drives.

        None for a motion of the tool, and where a sample is out of reach or singular.
        """
        if not isinstance(motion, JointMotion):
            return None
        structure = self._robot.structure
        found = structure.evaluation.inverse_dynamics(
            (motion.position, motion.velocity, motion.acceleration), self._robot.by_joint,
            self._robot.gravity_row, self._joints, self._actuators,
            nearby=None if closed is None else closed.get(structure))
        if found is None:
            return None
        if closed is not None and structure.loops and len(motion):
            closed[structure] = found.q[-1].copy()
        return Forces(found.efforts[TOTAL], lambda: self._parts(found),
                      lambda: self._state(motion, found),
                      lambda: (motion.position, motion.velocity, motion.acceleration))

    def _parts(self, found: InverseDynamicsResult) -> dict[str, Array]:
        """Return the parts of efforts by name, in the order of the effects."""
        offset = self._actuators[OFFSET] + np.zeros_like(found.efforts[TOTAL])
        own = {AxisFriction.name: found.efforts[DRIVE_FRICTION], AxisOffset.name: offset,
               ModelJointFriction.name: found.efforts[JOINT_EFFORT]}
        return {RIGID_BODY: found.efforts[RIGID], **{name: own[name] for name in self._own}}

    def _state(self, motion: JointMotion, found: InverseDynamicsResult) -> MechanismState:
        """Return the state of the mechanism whose efforts are known already."""
        state = self._robot.state(motion, self._reversal, self._joints)
        vars(state).update(inverse_dynamics=found, rigid_force=found.efforts[RIGID])
        return state


def one_pass_of(robot: Any, effects: tuple[Effect, ...], reversal: Reversal,
                joints: JointFriction) -> PlatformPass | TreePass | None:
    """Return the one pass of a model; None where an effect changes the bodies.

    The second approach to friction, Eq. (13), has none either.
    """
    if any(isinstance(effect, BodyEffect) for effect in effects):
        return None
    match robot, effects:
        case ThreePprs(), (ActiveFriction() as active, WholeMechanismFriction() as passive, *_):
            return PlatformPass(robot, active, passive, reversal)
        case Mechanism(), _:
            return TreePass(robot, effects, reversal, joints)
    return None


def forces_kernel(p: ForcesParameters, s: Sample, motion: Array, parts: Any) -> Any:
    """Fill tables of forces from one of motions, see `PlatformPass.forces`."""
    m, geometry = motion_sample(motion, s), p.robot.geometry
    rods = chain_motions(geometry, m)
    if len(parts) > FORCES:
        for i in range(CHAINS):
            _write_motion(i, parts, s, rods[i])
    rows = rows_of_chains(geometry, rods)
    inverse = invert(geometry, eliminate(geometry, rows, rods), rods)
    zero = 0.0 * rods[0].cos_u
    nothing = Vector(zero, zero, zero)
    bodies = body_forces(p.robot, m, rods, inverse, Wrench(nothing, nothing), nothing, p.printed)
    k = _joint_resistances(p, rods, bodies)
    passive = friction_forces(geometry, rods, inverse, k, p.joints.printed)
    for i in range(CHAINS):
        c, f = rods[i], bodies[i]
        _write_forces(i, p, parts, s, f.slide, c.slide_velocity, f.slide_load, passive.slides[i])
        _write_forces(CHAINS + i, p, parts, s, f.lift, c.lift_velocity, f.lift_load,
                      passive.lifts[i])
    bound = condition_bound(inverse, rows, rods, p.platform_radius)
    return are_within_reach(rods, p.minimum_sine) & (bound <= p.bound)


@each_chain
def _joint_resistances(
    i: int, p: ForcesParameters, rods: ThreeChains, bodies: ThreeForces,
) -> JointResistance:
    f = bodies[i]
    return joint_resistances(p.joints, f.H, f.V, f.W, f.V_star, f.W_star,
                             turnover(rods[i].u_dot, rods[i].omega, p.joints.width))


def _write_forces(
    drive: int, p: ForcesParameters, parts: Any, s: Sample, rigid_body: Any, velocity: Any,
    load: Any, passive: Any,
) -> None:
    """Write the parts of a drive's force, and their sum."""
    c, mu, width = p.drives[drive]
    active = drive_friction(c, mu, velocity, load, smooth_sign(velocity, width))
    parts[0, s, drive] = total_force((rigid_body, active, passive))
    parts[1, s, drive], parts[2, s, drive], parts[3, s, drive] = rigid_body, active, passive


def _write_motion(i: int, parts: Any, s: Sample, c: ChainSample) -> None:
    """Write the motion of a chain's two drives."""
    parts[FORCES, s, i], parts[FORCES, s, 3 + i] = c.slide, c.lift
    parts[FORCES + 1, s, i], parts[FORCES + 1, s, 3 + i] = c.slide_velocity, c.lift_velocity
    parts[FORCES + 2, s, i] = c.slide_acceleration
    parts[FORCES + 2, s, 3 + i] = c.lift_acceleration
