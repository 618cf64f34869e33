# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS as a mechanism that MuJoCo simulates like every other robot."""

from __future__ import annotations

from dataclasses import replace

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.effects.laws.drive_friction import DriveFriction, DriveOffset
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.model.drive_model import DriveModel


def as_mechanism(model: DriveModel) -> DriveModel:
    """Return a model as a mechanism; of a 3-PPRS a tree with three closures, without added effects.

    Friction of its guides follows the load across them, as in the model of the paper.
    """
    if model.moves_joints:
        return model
    of_joints = next(effect.blocks for effect in model.effects
                     if isinstance(effect, ModelJointFriction))
    blocks = {drive: {key: model.values[f'friction.drives.{key}'][d]
                      for key in ('viscous', 'coulomb')} for d, drive in enumerate(DRIVES)}
    for joint in model.robot.passive_joints:
        blocks |= dict.fromkeys(joint.joints, of_joints[joint.name])
    return replace(
        model, robot=model.robot.as_mechanism(model.limits.strokes, model.limits.efforts),
        effects=(DriveFriction(0.0, 0.0), DriveOffset(0.0), ModelJointFriction(blocks)), source='')
