# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Efforts of a mechanism at one sample, as a control loop asks for them: one compiled call."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.effects.laws.joint_friction import LinkageFriction, friction_table
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.linkage import Sample
from pprs_dynamics.physics.model.arm_model import ArmModel


class ArmSample:
    """Returns the efforts (D,) at one position, velocity and acceleration, (D,) each.

    Parameters
    ----------
    model : ArmModel
        Effects with memory begin anew at every call; `ArmModel.drive_forces` carries them on.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model = model
        values, robot, count = model.values, model.robot, len(model.drives)
        is_plain = all(isinstance(effect, (AxisFriction, AxisOffset, LinkageFriction))
                       for effect in model.effects)
        friction = friction_table(robot.structure, {}, 1.0)
        for effect in model.effects:
            if isinstance(effect, LinkageFriction):
                friction = effect.table(model.reversal.rate)
        own = np.array([robot.armature, values['friction.viscous'], values['friction.coulomb'],
                        np.broadcast_to(model.reversal.velocity, count),
                        values['friction.offset']])
        sample = Sample(robot.structure.tables, robot.structure.home, robot.by_joint,
                        np.array(robot.gravity, dtype=float), friction, own)
        self._sample = sample if is_plain and sample.is_compiled else None

    def __call__(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Return what the drives need [N m, N]."""
        if self._sample is None:
            motion = JointMotion(position[None], velocity[None], acceleration[None], np.zeros(1))
            efforts: Array = self.model.drive_forces(motion).total[0]
            return efforts
        found = self._sample(position, velocity, acceleration)
        if found is None:
            raise WorkspaceError(0, 'the loops do not close for the positions of the drives',
                                 'must be within reach, on the way from home')
        return found
