# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Compilation, or loading of compiled code, before the first evaluation.

`python -m pprs_dynamics.physics.model.preparation` does it once after an installation.
"""

from __future__ import annotations

from contextlib import suppress

from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import DEFAULT_MODEL

LOOPS_MODEL = 'config/hexapod.yaml'  # what it needs serves every mechanism
SAMPLES = 3  # more than one, as for recordings


def prepare(model: DriveModel) -> None:
    """Evaluate a model once, both ways, alone and in a batch.

    A robot that cannot be at home refuses it, after what is needed has been compiled. Effects that
    fail raise their error in the first real call.
    """
    home = model.robot.at_home(SAMPLES)
    with suppress(PprsError):
        model = model.sound_at(home)
        forces = model.drive_forces(home)
        model.drive_forces(home[:1])
        model.drive_forces(JointMotion(*forces.drive_motion))
        for effect in model.effects:
            effect.force(forces.mechanism, effect.initial_memory())


if __name__ == '__main__':
    for file in DEFAULT_MODEL, LOOPS_MODEL:
        loaded = DriveModel.load(file)
        prepare(loaded)
        state = loaded.drive_forces(loaded.robot.at_home(SAMPLES)).mechanism
        list(loaded.robot.under_loads(state, [state]))  # what the columns of a diagnosis need
