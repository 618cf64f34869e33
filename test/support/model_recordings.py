# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of what a model itself says about a motion, with white noise on the efforts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pprs_dynamics import DriveModel
from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.paths import Excitation

TIME = np.arange(0, 8.0, 0.005)
EXCITATION = Excitation()


def record(model: DriveModel, noise: float = 0.0, seed: int = 0,
           motion: Callable[[np.ndarray], PlatformMotion] = EXCITATION.motion,
           time: Array = TIME) -> Recording:
    """Return a recording of what a model says about a motion of times [s]."""
    forces = model.drive_forces(motion(time).with_time(time))
    said = model.measured(forces)
    rng = np.random.default_rng(seed)
    return Recording.from_arrays(
        'made', time, forces.mechanism.position
        + model.position_error(forces.mechanism.position),
        effort=said.total + noise * rng.normal(size=said.total.shape))


def with_effects(model: DriveModel, effects: dict[str, dict[str, float]],
                 uncertainties: dict[str, dict[str, float]] | None = None) -> DriveModel:
    """Return a model with effects, and with how well their parameters are known, by key."""
    def flat(block: str, values: dict[str, dict[str, float]]) -> dict[str, Any]:
        return {f'{block}.{name}.{key}': value for name, of_effect in values.items()
                for key, value in of_effect.items()}
    return DriveModel.from_parameters(
        {**model.values, 'effects.active': list(effects), **flat('effects', effects),
         **flat('uncertainties', uncertainties or {})}, model.source)
