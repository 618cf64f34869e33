# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The search for the motion of an arm that tells most about a question of its recordings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.experiments.arm_motions import ArmLimits, ArmMotions, best_motion
from pprs_dynamics.inference.experiments.question import Question
from pprs_dynamics.inference.experiments.trajectory_search import SAMPLES_PER_PERIOD, Found
from pprs_dynamics.physics.three_pprs.joint_series import JointSeries

# Slow motion tells of friction, fast of inertia; above 1 Hz an arm shakes what it stands on.
HIGHEST = (4, 8, 16)  # harmonics of the duration
SMALLEST = 0.2  # of the largest motion of a joint: small motion tells of hysteresis


class ArmSearch:
    """Searches for a motion that answers a question.

    Parameters
    ----------
    question : Question
    limits : ArmLimits
    duration : float
        [s]
    seed : int
    """

    def __init__(self, question: Question, limits: ArmLimits, duration: float, seed: int) -> None:
        self.question, self.seed = question, seed
        self.motions = ArmMotions(question.model, limits, duration)

    def run(self, progress: Callable[[float], None] = lambda share: None) -> Found:
        """Return the best motion found."""
        best = best_motion(self.motions, self._worth, self.seed, HIGHEST, SMALLEST, progress)
        return Found(best, self._gram(best), self.motions.uses(best), self._worth(best))

    def _worth(self, series: JointSeries) -> float:
        question = self.question
        return question.criterion.value(question.known + self._gram(series))

    def _gram(self, series: JointSeries) -> Array:
        question, duration = self.question, self.motions.duration
        samples = SAMPLES_PER_PERIOD * series.harmonics
        time: Array = np.arange(samples, dtype=float) * (duration / samples)
        forces = question.model.drive_forces(series.motion(time))
        columns, = question.plan.on_motions(forces, time)
        return question.information.of_motion(columns, duration)
