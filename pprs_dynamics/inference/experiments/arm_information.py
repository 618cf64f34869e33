# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Information of motions about the links, rotors and friction of an arm (D-optimality)."""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.fit.bodies import Bodies
from pprs_dynamics.physics.mechanism.joint_series import JointSeries
from pprs_dynamics.physics.model.drive_model import DriveModel

SAMPLES = 150  # of a motion
NOISE = 0.01  # of a joint's largest effort, standard deviation where the model knows no other
FRICTION = 0.1  # of a joint's largest effort, to which friction and offset are known


class ArmInformation:
    """Information of motions about an arm's parameters.

    Parameters
    ----------
    model : DriveModel
    limits : ArmLimits
    """

    def __init__(self, model: DriveModel, limits: Any) -> None:
        self.model, self.effort = model, limits.efforts(model)
        bodies = Bodies(model.robot.inertial)
        origin, step = np.zeros(len(bodies)), 1e-6
        self.described = bodies.inertial(origin).ravel()
        self.slopes = np.column_stack([
            (bodies.inertial(origin + step * unit).ravel() - self.described) / step
            for unit in np.eye(len(bodies))])

    def of(self, series: JointSeries) -> Array:
        """Return the squared gain in precision of each combination over the description."""
        motion = series.motion(np.linspace(0, series.duration, SAMPLES))
        count = len(self.effort)
        rows = self.model.robot.regressor(motion.position, motion.velocity, motion.acceleration)
        efforts = np.abs(rows @ self.described).max(axis=0)
        largest = np.where(np.isfinite(self.effort), self.effort, np.maximum(efforts, 1e-3))
        # Inertia of the rotor, viscous friction, dry friction and offset, each of its joint alone.
        each = np.stack((motion.acceleration, motion.velocity, np.tanh(
            motion.velocity / np.asarray(self.model.reversal.velocity)),
            np.ones_like(motion.velocity)), axis=2) * FRICTION * largest[:, None]
        own = np.einsum('njk,ji->njik', each, np.eye(count)).reshape(SAMPLES, count, -1)
        columns = np.concatenate((rows @ self.slopes, own), axis=2) / (NOISE * largest)[:, None]
        J = columns.reshape(-1, columns.shape[2])
        return np.maximum(np.linalg.eigvalsh(J.T @ J), 0.0)
