# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The rigid body and the model's own friction in one pass over the samples.

No intermediate quantity is stored. The equations are those that states and effects evaluate step
by step, which takes three times as long.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.evaluation import evaluate
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.reversal import Reversal
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
from pprs_dynamics.physics.model.forces import (
    ACTIVE_FRICTION,
    PASSIVE_FRICTION,
    RIGID_BODY,
    Forces,
)
from pprs_dynamics.physics.three_pprs.active_friction import ActiveFriction
from pprs_dynamics.physics.three_pprs.closed_form import (
    ACCELERATION,
    ACTIVE,
    EVERYTHING,
    FORCES,
    NO_LOAD,
    PASSIVE,
    POSITION,
    VELOCITY,
    DriveFriction,
    forces_kernel,
)
from pprs_dynamics.physics.three_pprs.passive_friction import (
    PassiveFriction,
    WholeMechanismFriction,
)
from pprs_dynamics.physics.three_pprs.robot import ClosedForm, ThreePprs

# Samples up to which everything is kept with the forces: a node checks the drives' motion before
# it answers; of a recording, writing it would take longer than calculating it where it is needed.
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
        self.parameters = robot.parameters(
            passive.joints(reversal), tuple(DriveFriction(*drive) for drive in drives))

    def forces(self, motion: PlatformMotion, closed: object) -> Forces | None:
        """Return the forces with the own friction.

        None where a sample may be out of reach or too near a singularity: the caller must check
        every sample then.
        """
        rows = motion.rows
        table = np.empty((EVERYTHING if len(rows) <= SHORT else FORCES, len(rows), 6))
        if evaluate(forces_kernel, self.parameters, rows, NO_LOAD, table) >= 0:
            return None
        if len(table) == FORCES:
            return Forces(table[TOTAL], lambda: self._parts(table),
                          lambda: self._robot.state(motion, self._reversal))
        return Forces(
            table[TOTAL], lambda: self._parts(table),
            lambda: self._robot.state(motion, self._reversal,
                                      found=ClosedForm(self._robot, motion, table=table)),
            lambda: (table[POSITION], table[VELOCITY], table[ACCELERATION]))

    @staticmethod
    def _parts(table: Array) -> dict[str, Array]:
        return {RIGID_BODY: table[RIGID], ACTIVE_FRICTION: table[ACTIVE],
                PASSIVE_FRICTION: table[PASSIVE]}


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
