# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether gravity has another direction in recordings than in the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.readings.findings import NoMeasurement
from pprs_dynamics.inference.readings.table import MOUNTINGS
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.base_tilt import BaseTilt
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

MOUNTING = 'mounting'  # kind of the finding
OBLIQUE = 0.1  # [rad] from an axis; nearer ones may be a zero that is a quarter turn off
SAME_SIZE = 0.05  # relative error of gravity's size, up to which a vector is gravity
LEAST_TILT = BaseTilt.linear[0].upper  # [rad]; a smaller one is the effect base_tilt
MOST_LEFT = 0.25  # of the variance of each drive's error, with another direction


def other_mounting(model: DriveModel, recordings: Sequence[Recording], is_oblique: bool = False,
                   ) -> dict[str, NoMeasurement]:
    """Return the finding that gravity has another direction than in the model, by drive.

    `is_oblique`: only where it is along no axis of the base, nor against the model's.
    """
    given = np.asarray(model.robot.gravity, dtype=float) if model.moves_joints else np.zeros(3)
    gravity = _other_gravity(model, recordings, given)
    if gravity is None or (is_oblique and any(
            _angle(gravity, np.array(axis, float)) < OBLIQUE for axis in (*MOUNTINGS, -given))):
        return {}
    found, said = (', '.join(f'{round(value, 1) + 0.0:.1f}' for value in vector)
                   for vector in (gravity, given))
    finding = NoMeasurement.of(
        MOUNTING, model.drives, range(len(model.drives)),
        f'gravity in the base is ({found}) m/s² in this recording and ({said}) m/s² in the model: '
        'the robot is mounted in another direction', f'robot: {{gravity: [{found}]}}')
    return dict.fromkeys(model.drives, finding)


def _other_gravity(model: DriveModel, recordings: Sequence[Recording], given: Array,
                   ) -> Array | None:
    """Return gravity in the base, (3,) [m/s^2], where it has another direction than `given`.

    Efforts are fitted with a free gravity vector, and each drive's inertia, friction and offset.
    """
    size = float(np.linalg.norm(given))
    if size == 0:
        return None
    try:
        residuals = measure_residuals(model, recordings)[0]
    except PprsError:  # of what cannot be compared nothing is known
        return None
    q, v, a = (residuals.variables[name] for name in ('position', 'velocity', 'acceleration'))

    def weight(gravity: Array) -> Array:
        """Return the efforts at rest, (M, D)."""
        robot = replace(model.robot, gravity=tuple(gravity.tolist()))
        efforts: Array = replace(model, robot=robot, effects=()).drive_forces(
            JointMotion(q, 0.0 * q, 0.0 * q, residuals.time)).total
        return efforts

    nothing = weight(np.zeros(3))
    columns = np.stack([weight(axis) - nothing for axis in size * np.eye(3)], axis=2)
    own = np.stack((v, np.sign(v), a, np.ones_like(v)), axis=2)
    rows, targets = [], []
    for d in np.flatnonzero(np.isfinite(residuals.error).any(axis=0)):
        at = np.isfinite(residuals.error[:, d])
        y = np.column_stack((residuals.error[at, d], columns[at, d]))
        # What the drive's inertia, friction and offset do not explain.
        rest = y - own[at, d] @ np.linalg.lstsq(own[at, d], y, rcond=None)[0]
        rest /= max(root_mean_square(rest[:, 0]), 1e-300)
        rows.append(rest[:, 1:])
        targets.append(rest[:, 0] + rest[:, 1:] @ (given / size))
    share = np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=1e-3)[0]
    is_explained = all(np.mean((target - G @ share) ** 2) < MOST_LEFT
                       for G, target in zip(rows, targets, strict=True) if np.any(G))
    norm = float(np.linalg.norm(share))
    if abs(norm - 1) > SAME_SIZE or _angle(share, given) < LEAST_TILT or not is_explained:
        return None
    gravity: Array = size * share.round(3)
    return gravity


def _angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors, (3,) [rad]."""
    sizes = max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300)
    return float(np.arccos(np.clip(a @ b / sizes, -1.0, 1.0)))
