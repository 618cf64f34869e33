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
from pprs_dynamics.physics.effects.laws.drive_friction import DriveFriction, DriveOffset
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.mechanism.tree_tables import (
    ARMATURE,
    COEFFICIENT,
    COULOMB,
    DRIVE_FRICTION,
    JOINT_EFFORT,
    OF_DRIVE,
    OFFSET,
    RIGID,
    TOTAL,
    VISCOUS,
    WIDTH,
)
from pprs_dynamics.physics.model.forces import RIGID_BODY, Forces
from pprs_dynamics.physics.three_pprs.independent_chains import IndependentChainsFriction

OWN = DriveFriction, DriveOffset, ModelJointFriction


class OnePass:
    """One pass of a model.

    Parameters
    ----------
    robot : Robot
    effects : tuple of Effect
    reversal : Reversal
    joints : JointFriction or Joints
        The model's own.
    """

    def __init__(self, robot: Any, effects: tuple[Effect, ...], reversal: Reversal, joints: Any,
                 ) -> None:
        self._robot, self._reversal, self._joints = robot, reversal, joints
        self._own = [effect.name for effect in effects if isinstance(effect, OWN)]
        drives = np.zeros((OF_DRIVE, len(robot.drives)))
        drives[ARMATURE], drives[WIDTH] = robot.armature, reversal.velocity
        for effect in effects:
            if isinstance(effect, DriveFriction):
                drives[VISCOUS], drives[COULOMB] = effect.viscous, effect.coulomb
                drives[COEFFICIENT] = effect.coefficient
            elif isinstance(effect, DriveOffset):
                drives[OFFSET] = effect.value
        self.parameters = robot.friction_parameters(joints, drives)
        self._offset = drives[OFFSET]

    def forces(self, motion: Any, closed: dict[Any, Array] | None) -> Forces | None:
        """Return the forces with the own friction.

        None for a motion that has no pass, and where a sample may be out of reach or too near a
        singularity: the caller must check every sample then.
        """
        robot = self._robot
        found = robot.one_pass(motion, self.parameters, closed)
        return None if found is None else Forces(
            found.efforts[TOTAL], lambda: self._parts(found.efforts),
            lambda: robot.state(motion, self._reversal, self._joints, found=found),
            found.motion)

    def _parts(self, efforts: Array) -> dict[str, Array]:
        """Return the parts of efforts by name, in the order of the effects."""
        own = {DriveFriction.name: efforts[DRIVE_FRICTION],
               DriveOffset.name: self._offset + np.zeros_like(efforts[TOTAL]),
               ModelJointFriction.name: efforts[JOINT_EFFORT]}
        return {RIGID_BODY: efforts[RIGID], **{name: own[name] for name in self._own}}


def one_pass_of(robot: Any, effects: tuple[Effect, ...], reversal: Reversal, joints: Any,
                ) -> OnePass | None:
    """Return the one pass of a model; None where an effect changes the bodies.

    The second approach to friction, Eq. (13), has none either.
    """
    if any(isinstance(effect, BodyEffect | IndependentChainsFriction) for effect in effects):
        return None
    return OnePass(robot, effects, reversal, joints)
