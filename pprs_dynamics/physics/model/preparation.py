# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Compilation, or loading of compiled code, before the first evaluation.

`python -m pprs_dynamics.physics.model.preparation` does it once after an installation.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.mechanism_model import MechanismModel
from pprs_dynamics.physics.three_pprs.forward_motion import solve_forward_motion

HEIGHT = 0.5  # [m], of the home pose
SAMPLES = 3  # more than one, as for recordings


def prepare(model: DriveModel | MechanismModel) -> None:
    """Evaluate a model once, both ways, alone and in a batch.

    A robot that cannot be at the home pose refuses it, after what is needed has been compiled.
    Effects that fail are told of when they are asked for an answer.
    """
    if isinstance(model, MechanismModel):
        with suppress(PprsError):
            structure = model.robot.structure
            closed = np.tile(structure.home[structure.tables.drives], (SAMPLES, 1))
            zero = np.zeros_like(closed)
            at_rest = JointMotion(closed, zero, zero, np.arange(SAMPLES, dtype=float))
            model.sound_at(at_rest).drive_forces(at_rest)
        return
    home = PlatformMotion.at_rest(np.tile([0.0, 0.0, HEIGHT], (SAMPLES, 1)),
                                  np.tile([0.0, 0.0, 0.0, 1.0], (SAMPLES, 1)))
    with suppress(PprsError):
        model = model.sound_at(home)
        forces = model.drive_forces(home)
        model.drive_forces(home[:1])
        position = forces.mechanism.position
        solve_forward_motion(model.robot.geometry, position, np.zeros_like(position),
                             np.zeros_like(position))
        for effect in model.effects:
            effect.force(forces.mechanism, effect.initial_memory())


if __name__ == '__main__':
    prepare(DriveModel.load())
