# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS as a mechanism that MuJoCo simulates like every other robot."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.laws.drive_friction import DriveFriction, DriveOffset
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.mechanism.description import REVOLUTE
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.three_pprs.robot import SPHERICAL
from pprs_dynamics.simulation.export.exported_robot import BALLS, HINGES, MJCF, described, written


@dataclass(frozen=True, kw_only=True)
class PlatformMechanism(DriveModel):
    """The 3-PPRS as a tree of bodies with three closures.

    Friction of its guides follows the load across them, as in the model of the paper.
    """

    block: ClassVar[str] = 'three_pprs'

    @classmethod
    def of(cls, model: DriveModel) -> PlatformMechanism:
        """Return the mechanism of a model file, without added effects."""
        of_joints = next(effect.blocks for effect in model.effects
                         if isinstance(effect, ModelJointFriction))
        blocks = {drive: {key: model.values[f'friction.drives.{key}'][d]
                          for key in ('viscous', 'coulomb')} for d, drive in enumerate(DRIVES)}
        for kind, joints in ((REVOLUTE, HINGES), (SPHERICAL, BALLS)):
            blocks |= dict.fromkeys(joints, of_joints[kind])
        effects: tuple[Effect, ...] = (DriveFriction(0.0, 0.0), DriveOffset(0.0),
                                       ModelJointFriction(blocks))
        robot = model.robot.as_mechanism(model.limits.strokes, model.limits.efforts)
        return cls(robot=robot, effects=effects, reversal=model.reversal, limits=model.limits,
                   values=model.values)

    @cached_property
    def mjcf(self) -> str:
        """The robot in MuJoCo's format."""
        return written(described(self.block, self.robot), MJCF)


def as_mechanism(model: DriveModel) -> DriveModel:
    """Return a model as a mechanism."""
    return model if model.moves_joints else PlatformMechanism.of(model)
