# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A single axis of any numbers with effects, its motions and recordings: sums of sines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pprs_dynamics import DriveModel, JointMotion, Recording
from pprs_dynamics.arrays import Array

AXIS = 'axis'  # its drive
SINES = ((0.2, 0.1), (0.5, 0.05), (1.3, 0.01))  # [Hz, m]
TIME = np.arange(0.0, 8.0, 0.005)
Effects = Mapping[str, Mapping[str, float]]  # parameters by name of the effect


def axis_motion(time: Array, seed: int | None = None) -> JointMotion:
    """Return the sum of `SINES` with its rates; a seed draws their phases."""
    w, size = np.array([(2 * np.pi * rate, size) for rate, size in SINES]).T
    drawn = 0.0 if seed is None else np.random.default_rng(seed).uniform(0, 2 * np.pi, len(w))
    phase = time[:, None] * w + drawn
    q, v, a = (np.sum(values, axis=1, keepdims=True) for values in (
        size * np.sin(phase), size * w * np.cos(phase), -size * w ** 2 * np.sin(phase)))
    return JointMotion(q, v, a, time)


def axis_values(mass: float, viscous: float, coulomb: float, offset: float = 0.0,
                gravity: float = 0.0, width: float = 0.001) -> dict[str, Any]:
    """Return the values of a model file."""
    return {**DriveModel.load('config/single_axis.yaml').values,
            'links.mass': (mass,), 'friction.viscous': (viscous,), 'friction.coulomb': (coulomb,),
            'friction.offset': (offset,), 'robot.gravity': (0.0, 0.0, gravity),
            'friction.reversal_velocity': width}


def axis(effects: Effects | None = None, **changes: Any) -> DriveModel:
    """Return an axis of 20 kg with effects."""
    named = effects or {}
    return DriveModel.from_parameters({
        **axis_values(20.0, 40.0, 6.0, -2.0), 'effects.active': list(named),
        **{f'effects.{name}.{AXIS}.{key}': value for name, block in named.items()
           for key, value in block.items()}, **changes})


def axis_recording(model: DriveModel, seed: int = 1, noise: float = 0.1,
                   before: DriveModel | None = None, begins: float = 0.0,
                   time: Array = TIME) -> Recording:
    """Return a recording of an axis, which was another one before a time [s]."""
    motion = axis_motion(time, seed)
    force, earlier = (robot.measured(robot.drive_forces(motion)).total
                      for robot in (model, before or model))
    force = np.where(time[:, None] < begins, earlier, force)
    force = force + noise * np.random.default_rng(seed).normal(size=force.shape)
    return Recording.from_arrays(f'run_{seed}', time, motion.position, None, force, (AXIS,))
