# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motions of an arm that excite its inertia and friction: Fourier series of the joints.

Of many series that one is taken which tells most of what `pprs fit` determines, by the
determinant of the information (D-optimal).

References
----------
J. Swevers, C. Ganseman, D. B. Tükel, J. De Schutter, H. Van Brussel, Optimal robot excitation and
identification, IEEE Transactions on Robotics and Automation 13 (1997).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.experiments.arm_motions import (
    LOOKED_AT,
    ArmLimits,
    ArmMotions,
    best_motion,
)
from pprs_dynamics.inference.fit.bodies import Bodies
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.arm_model import ArmModel
from pprs_dynamics.physics.three_pprs.joint_series import JointSeries

NOISE = 0.01  # of a joint's largest effort, standard deviation where the model knows no other


@dataclass(frozen=True)
class ArmExcitation:
    """A designed motion.

    Parameters
    ----------
    model : ArmModel
    series : JointSeries
    determined, total : int
        Numbers of links, rotors and friction that it tells better than the description, and all.
    limits : dict of str to float
        Use of each limit, its margin taken off: at most 1.
    """

    model: ArmModel
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
        return (f'A motion of {self.series.duration:g} s that tells {self.determined} of '
                f'{self.total} numbers of links, rotors and friction better than the URDF; the '
                'rest does not show in any effort, or hardly. Whether links touch each other is '
                'not checked.')

    def to_dict(self) -> dict[str, Any]:
        """Return what it promises."""
        return {'separates': [], 'expected_evidence': 0.0, 'determined': self.determined,
                'total': self.total, 'limits': self.limits, 'duration': self.series.duration}


def excite_arm(model: ArmModel, limits: ArmLimits, duration: float, seed: int,
               progress: Callable[[float], None] | None = None) -> ArmExcitation:
    """Return a motion that tells most of an arm's numbers.

    Parameters
    ----------
    model : ArmModel
    limits : ArmLimits
    duration : float
        [s]
    seed : int
    progress : callable, optional
    """
    motions = ArmMotions(model, limits, duration)
    known = _Information(motions)
    best = best_motion(motions, lambda one: float(np.sum(np.log1p(np.maximum(known.of(one), 0.0)))),
                       seed, progress=progress)
    told = known.of(best)
    return ArmExcitation(model, best, int(np.sum(told > 1)), len(told), motions.uses(best))


class _Information:
    """What motions tell of an arm's numbers.

    Parameters
    ----------
    motions : ArmMotions
    """

    def __init__(self, motions: ArmMotions) -> None:
        self.model, self.duration = motions.model, motions.duration
        self.effort = motions.effort
        self.bodies = Bodies(motions.model.robot.inertial)

    def of(self, found: JointSeries) -> Array:
        """Return by how much each combination is told better than by the description, squared."""
        motion = found.motion(np.linspace(0, self.duration, LOOKED_AT))
        count = len(self.effort)
        rows = self.model.robot.regressor(motion.position, motion.velocity, motion.acceleration)
        origin = np.zeros(len(self.bodies))
        described = self.bodies.inertial(origin).ravel()
        step = 1e-6
        slopes = np.column_stack([
            (self.bodies.inertial(origin + step * unit).ravel() - described) / step
            for unit in np.eye(len(origin))])
        direction = np.tanh(motion.velocity / np.asarray(self.model.reversal.velocity))
        own = np.zeros((LOOKED_AT, count, 4 * count))
        for j in range(count):
            own[:, j, 4 * j:4 * j + 4] = np.column_stack((
                motion.acceleration[:, j], motion.velocity[:, j], direction[:, j],
                np.ones(LOOKED_AT)))
        efforts = np.abs(rows @ described).max(axis=0)
        largest = np.where(np.isfinite(self.effort), self.effort, np.maximum(efforts, 1e-3))
        columns = np.concatenate((rows @ slopes, own), axis=2) / (NOISE * largest)[:, None]
        # Friction and offsets are not known to begin with: to a tenth of the largest effort.
        scale = np.concatenate((np.ones(len(origin)), np.repeat(0.1 * largest, 4)))
        J = (columns * scale).reshape(-1, columns.shape[2])
        return np.asarray(np.linalg.eigvalsh(J.T @ J), dtype=float)
