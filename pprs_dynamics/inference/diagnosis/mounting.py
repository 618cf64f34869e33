# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The mounting of a robot: the direction of gravity in its base, in which forces are linear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.next_step import MOUNTING
from pprs_dynamics.inference.readings.findings import NoMeasurement
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.base_tilt import BaseTilt
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

SAME_SIZE = 0.05  # relative error of gravity's size, up to which a vector is gravity
LEAST_TILT = BaseTilt.linear[0].upper  # [rad]; a smaller one is the effect base_tilt
MOST_LEFT = 0.25  # of the variance of each drive's error, with another direction


def other_mounting(model: DriveModel, recordings: Sequence[Recording],
                   ) -> dict[str, NoMeasurement]:
    """Return the finding that gravity has another direction than in the model, by drive.

    Efforts are fitted with a free gravity vector, and each drive's inertia, friction and offset.
    """
    given = np.asarray(model.robot.gravity, dtype=float) if model.moves_joints else np.zeros(3)
    size = float(np.linalg.norm(given))
    if size == 0:
        return {}
    residuals = measure_residuals(model, recordings)[0]
    q, v, a = (residuals.variables[name] for name in ('position', 'velocity', 'acceleration'))
    still = np.zeros_like(q)

    def weight(gravity: Array) -> Array:
        """Return the efforts that hold the robot at rest, (M, D)."""
        robot = replace(model.robot, gravity=tuple(gravity.tolist()))
        held: Array = replace(model, robot=robot, effects=()).drive_forces(
            JointMotion(q, still, still, residuals.time)).total
        return held

    nothing = weight(np.zeros(3))
    columns = np.stack([weight(axis) - nothing for axis in size * np.eye(3)], axis=2)
    error = residuals.error + columns @ (given / size)
    rows, targets, before = [], [], []
    for d in range(len(model.drives)):
        known = np.isfinite(error[:, d])
        own = np.stack((v[:, d], np.sign(v[:, d]), a[:, d], np.ones(len(q))), axis=1)[known]

        def rest(y: Array, own: Array = own) -> Array:
            """Return what the drive's inertia, friction and offset do not explain."""
            left: Array = y - own @ np.linalg.lstsq(own, y, rcond=None)[0]
            return left

        now = rest(residuals.error[known, d])
        scale = max(float(np.sqrt(np.mean(now ** 2))), 1e-300) if len(now) else 1.0
        before.append(now / scale)
        rows.append(rest(columns[known, d]) / scale)
        targets.append(rest(error[known, d]) / scale)
    share = np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=1e-3)[0]
    is_explained = all(np.sum((y - G @ share) ** 2) < MOST_LEFT * np.sum(now ** 2)
                       for G, y, now in zip(rows, targets, before, strict=True) if np.any(G))
    norm = float(np.linalg.norm(share))
    tilt = float(np.arccos(np.clip(share @ given / max(norm * size, 1e-300), -1.0, 1.0)))
    if (abs(norm - 1) > SAME_SIZE or tilt < LEAST_TILT
            or not is_explained):
        return {}
    found, said = (', '.join(f'{round(value, 1) + 0.0:.1f}' for value in vector)
                   for vector in (size * share.round(3), given))
    finding = NoMeasurement.of(
        MOUNTING, model.drives, range(len(model.drives)),
        f'gravity in the base is ({found}) m/s² in this recording and ({said}) m/s² in the model: '
        'the robot is mounted in another direction', f'robot: {{gravity: [{found}]}}')
    return dict.fromkeys(model.drives, finding)
