# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The first motion of an arm: the one that determines most of its parameters (D-optimal)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.experiments.motion_design import ArmMotions, design, limits_of
from pprs_dynamics.inference.experiments.motion_limits import ArmLimits
from pprs_dynamics.inference.fit.bodies import Bodies
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.joint_series import JointSeries
from pprs_dynamics.physics.model.drive_model import DriveModel

HARMONICS = 8  # of the duration
SAMPLES = 150  # of a motion, for its information
NOISE = 0.01  # of a joint's largest effort, standard deviation where the model knows no other


@dataclass(frozen=True)
class ArmExcitation:
    """A designed motion.

    Parameters
    ----------
    model : DriveModel
    series : JointSeries
    determined, total : int
        Combinations of parameters of links, rotors and friction: those that it determines better
        than the description, and all.
    limits : dict of str to float
        Use of each limit, its margin taken off: at most 1.
    """

    model: DriveModel
    series: JointSeries
    determined: int
    total: int
    limits: dict[str, float]

    def motion(self, time: Array) -> JointMotion:
        """Return the motion at times [s]."""
        return self.series.motion(time)

    @property
    def text(self) -> str:
        """What it promises, in a sentence."""
        return (f'A motion of {self.series.duration:g} s that determines {self.determined} of '
                f'{self.total} parameters of links, rotors and friction better than the URDF. '
                'Collisions of links are not checked.')

    def to_dict(self) -> dict[str, Any]:
        """Return what it promises."""
        return {'separates': [], 'expected_evidence': 0.0, 'determined': self.determined,
                'total': self.total, 'limits': self.limits, 'duration': self.series.duration}


def excite_arm(model: DriveModel, limits: ArmLimits, duration: float, seed: int,
               progress: Callable[[float], None] | None = None) -> ArmExcitation:
    """Return the most informative motion about an arm's parameters.

    Parameters
    ----------
    model : DriveModel
    limits : ArmLimits
    duration : float
        [s]
    seed : int
    progress : callable, optional
    """
    motions = ArmMotions(model, limits, duration, (HARMONICS,), 1.0)
    known = ArmInformation(motions)
    best = design(motions, lambda series: float(np.sum(np.log1p(known.of(series)))), seed,
                  progress or (lambda share: None))
    gains = known.of(best)
    return ArmExcitation(model, best, int(np.sum(gains > 1)), len(gains),
                         limits_of(motions, best))


class ArmInformation:
    """Information of motions about an arm's parameters.

    Parameters
    ----------
    motions : ArmMotions
    """

    def __init__(self, motions: ArmMotions) -> None:
        self.model, self.duration = motions.model, motions.duration
        self.effort = motions.effort
        bodies = Bodies(motions.model.robot.inertial)
        self.count = len(bodies)
        origin, step = np.zeros(self.count), 1e-6
        self.described = bodies.inertial(origin).ravel()
        self.slopes = np.column_stack([
            (bodies.inertial(origin + step * unit).ravel() - self.described) / step
            for unit in np.eye(self.count)])

    def of(self, found: JointSeries) -> Array:
        """Return the squared gain in precision of each combination over the description."""
        motion = found.motion(np.linspace(0, self.duration, SAMPLES))
        count = len(self.effort)
        rows = self.model.robot.regressor(motion.position, motion.velocity, motion.acceleration)
        direction = np.tanh(motion.velocity / np.asarray(self.model.reversal.velocity))
        own = np.zeros((SAMPLES, count, 4 * count))
        for j in range(count):
            own[:, j, 4 * j:4 * j + 4] = np.column_stack((
                motion.acceleration[:, j], motion.velocity[:, j], direction[:, j],
                np.ones(SAMPLES)))
        efforts = np.abs(rows @ self.described).max(axis=0)
        largest = np.where(np.isfinite(self.effort), self.effort, np.maximum(efforts, 1e-3))
        columns = np.concatenate((rows @ self.slopes, own), axis=2) / (NOISE * largest)[:, None]
        # Friction and offsets are not known to begin with: to a tenth of the largest effort.
        scale = np.concatenate((np.ones(self.count), np.repeat(0.1 * largest, 4)))
        J = (columns * scale).reshape(-1, columns.shape[2])
        gains: Array = np.maximum(np.linalg.eigvalsh(J.T @ J), 0.0)
        return gains
