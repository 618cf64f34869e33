# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a robot with known effects that its model lacks, for tests of the workbench."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from model_recordings import with_effects
from scipy.signal import lfilter
from single_axis import axis_recording

from pprs_dynamics import DriveModel
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.parameter_file import default_parameters

STEP = 0.005  # [s]
NOISE = 0.05  # [N], half of its variance white
HIDDEN = {'effects.active': ['coulomb_friction', 'payload_mass'],
          'effects.coulomb_friction.lift_2.force': 0.6, 'effects.payload_mass.mass': 0.15}

AXIS = Path(__file__).parents[2] / 'config' / 'single_axis.yaml'


def write_axis(path: Path, seed: int, duration: float = 8.0, friction: float = 6.0,
               **more: dict[str, float]) -> Path:
    """Write a recording of the single axis with effects that its model lacks, friction in [N]."""
    path.parent.mkdir(parents=True, exist_ok=True)
    robot = with_effects(DriveModel.load(AXIS),
                         {'coulomb_friction': {'axis.force': friction}, **more})
    write_recording(path, axis_recording(robot, seed, 1.0, time=np.arange(0.0, duration, STEP)))
    return path


def write_hidden(path: Path, seed: int, duration: float = 8.0,
                 hidden: Mapping[str, Any] = HIDDEN) -> Path:
    """Write a recording of the paper's robot with effects, and return its path."""
    robot = DriveModel.from_parameters({**default_parameters(), **hidden})
    motion = Excitation(duration=duration, seed=seed).motion(np.arange(0.0, duration, STEP))
    forces = robot.drive_forces(motion)
    rng = np.random.default_rng(seed)
    white, slow = rng.normal(0, NOISE / 2 ** 0.5, (2, *forces.total.shape))
    noise = white + lfilter([(1 - 0.9 ** 2) ** 0.5], [1, -0.9], slow, axis=0)
    position = forces.mechanism.position + rng.normal(0, 1e-6, forces.total.shape)
    write_recording(path, Recording.from_arrays(
        path.stem, motion.time, position, forces.mechanism.velocity, forces.total + noise))
    return path
