# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The search for the most informative motion within the robot's limits.

Random series, each blown up until it meets a limit, are compared first; the best is improved by
steps (`climbing`), and checked at the rate at which it is played. Limits of an arm are in
`arm_motions`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.experiments.arm_motions import ArmDrawing, ArmLimits, ArmMotions
from pprs_dynamics.inference.experiments.climbing import climb
from pprs_dynamics.inference.experiments.criteria import Contest, misfits_of
from pprs_dynamics.inference.experiments.fourier_path import (
    FREEDOMS,
    FourierPath,
    joined_motion,
)
from pprs_dynamics.inference.experiments.motion_limits import MotionLimits, limit_names
from pprs_dynamics.inference.experiments.question import Question
from pprs_dynamics.measurement.motion.treatment import block_length
from pprs_dynamics.physics.mechanism.joint_series import JointSeries
from pprs_dynamics.physics.mechanism.paths import HOME
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces
from pprs_dynamics.physics.three_pprs.robot import SingularityBounds

HARMONICS = 4  # of each degree of freedom
SLOWEST_TOP = 5  # the highest harmonic of the slowest motions
HIGHEST_FREQUENCY = 1.5  # [Hz]; above it reconstruction from positions smooths
SAMPLES_PER_PERIOD, LEAST_SAMPLES = 12, 240  # of the highest harmonic and in all, while searching
DRAWS = 48
NEARBY = (0.1, 1.2)  # scales that put a step back on the limits
REACH, TURN = 0.08, 0.25  # [m, rad], excursions to start from
SCALES = (0.02, 4.0)  # times these
HALVINGS = 7
# Some series are left smaller than the limits allow: slow motion tells of friction near rest.
SMALLER, SMALLEST = 0.25, 0.1
OUTSIDE = 2.0  # use of limits where the mechanism cannot follow
FINE_RATE = 500.0  # [Hz], at which limits are checked
# Slow motion tells of friction, fast of inertia; above 1 Hz an arm shakes what it stands on.
OF_ARM = (4, 8, 16)  # highest harmonics of the duration
SMALLEST_OF_ARM = 0.2  # of the largest motion of a joint: small motion tells of hysteresis


class NoMotionError(PprsError, ValueError):
    """The robot has no room for a motion within its limits."""


@dataclass(frozen=True)
class Found:
    """A motion with its value and its use of the limits.

    Parameters
    ----------
    path : FourierPath or JointSeries
    gram : (P, P) array
        Its information.
    uses : mapping of str to float
        Of the limits, 1 is all.
    value : float
        Of the criterion.
    """

    path: FourierPath | JointSeries
    gram: Array
    uses: Mapping[str, float]
    value: float


@dataclass(frozen=True)
class Drawn:
    """A random motion, its approximate information (P, P), and its value."""

    path: FourierPath
    gram: Array
    value: float


class TrajectorySearch:
    """Searches for a motion that answers a question.

    Parameters
    ----------
    question : Question
    limits : MotionLimits
    duration : float
        [s]
    seed : int

    Raises
    ------
    NoMotionError
        Where the limits do not even let the robot stand at the centre.
    """

    def __init__(self, question: Question, limits: MotionLimits, duration: float,
                 seed: int) -> None:
        self.question, self.limits, self.duration, self.seed = question, limits, duration, seed
        model = question.model
        # Poses near a singularity are compared, not refused, while searching.
        self._lenient = replace(model, robot=replace(model.robot, bounds=SingularityBounds(
            rod_sine=1e-3)))
        self.top = max(HARMONICS + 1, int(HIGHEST_FREQUENCY * duration))
        self.centre = self._centre()
        samples = max(SAMPLES_PER_PERIOD * self.top, LEAST_SAMPLES)
        self._time: Array = np.arange(samples, dtype=float) * (duration / samples)
        self._fine: Array = np.arange(round(duration * FINE_RATE) + 1) / FINE_RATE

    def run(self, progress: Callable[[float], None] = lambda share: None) -> Found:
        """Return the best motion found.

        Contests that no motion drawn could decide are left out of the rest of the search.
        """
        drawn = self.screen(lambda share: progress(0.3 * share))
        hopeful = self._hopeful(drawn)
        if 0 < len(hopeful) < len(self.question.contests):
            self.question = self.question.with_contests(hopeful)
            drawn = self._ranked([replace(one, value=self.question.worth(one.gram))
                                  for one in drawn])
        best = climb(drawn[0].path, self._beside, lambda path: self.question.worth(
            self._gram(path)), np.random.default_rng(self.seed),
            lambda share: progress(0.3 + 0.6 * share))
        # Values while searching are of few samples: at full rate the start may be the better one.
        return max(map(self.assess, (drawn[0].path, best)), key=lambda one: one.value)

    def _hopeful(self, drawn: list[Drawn]) -> list[Contest]:
        """Return the contests that at least one motion drawn would decide."""
        contests = self.question.contests
        if not contests:
            return []
        known = self.question.known
        gained = np.max([misfits_of(contests, known + draw.gram) for draw in drawn],
                        axis=0) - misfits_of(contests, known)
        return [one for one, more in zip(contests, gained, strict=True)
                if one.now + more > self.question.decisions.rival_margin]

    def screen(self, progress: Callable[[float], None] = lambda share: None,
               draws: int = DRAWS) -> list[Drawn]:
        """Return random motions within the limits, best first."""
        rng = np.random.default_rng(self.seed)
        fitted = []
        for k in range(draws):
            path, share = self._draw(rng)
            fitted.append(self._to_limits(path).scaled(share))
            progress(0.5 * (k + 1) / draws)
        drawn: list[Drawn] = []
        for path in fitted:
            gram = self._gram(path)
            drawn.append(Drawn(path, gram, self.question.worth(gram)))
            progress(0.5 + 0.5 * len(drawn) / draws)
        return self._ranked(drawn)

    def _ranked(self, drawn: list[Drawn]) -> list[Drawn]:
        return sorted(drawn, key=lambda one: -one.value)

    def assess(self, path: FourierPath) -> Found:
        """Return a motion at full rate, made smaller where it exceeds a limit there."""
        path = self._allowed(path)
        forces = self._forces([path], self._fine)
        uses = self.limits.uses(self.question.model, forces, len(self._fine))[0].tolist()
        question = self.question
        gram, = question.grams(forces, self._fine, self.duration, block_length(1 / FINE_RATE))
        return Found(path, gram, dict(zip(limit_names(question.model), uses, strict=True)),
                     question.worth(gram))

    def _draw(self, rng: np.random.Generator) -> tuple[FourierPath, float]:
        """Return a motion of some size, and the share of the limits that it is to use."""
        highest = int(np.exp(rng.uniform(np.log(min(SLOWEST_TOP, self.top)),
                                         np.log(self.top + 1))))
        highest = min(max(highest, HARMONICS), self.top)
        harmonics = np.stack([np.sort(1 + rng.choice(highest, HARMONICS, replace=False))
                              for _ in range(FREEDOMS)])
        path = FourierPath.at_rest(self.duration, harmonics, self.centre)
        x = rng.normal(size=(FREEDOMS, path.size // FREEDOMS))
        x *= np.exp(rng.normal(scale=0.7, size=FREEDOMS))[:, None]
        x /= np.abs(x).max()
        x[:3] *= REACH
        x[3:] *= TURN
        share = float(np.exp(rng.uniform(np.log(SMALLEST), 0))) if rng.random() < SMALLER else 1.0
        return path.with_parameters(x.ravel()), share

    def _to_limits(self, path: FourierPath, scales: tuple[float, float] = SCALES) -> FourierPath:
        """Return the motion times the largest factor that the limits allow."""
        low, high = np.log(scales)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            if self._worst(path.scaled(np.exp(middle)), self._time) <= 1:
                low = middle
            else:
                high = middle
        return path.scaled(np.exp(low))

    def _allowed(self, path: FourierPath) -> FourierPath:
        """Return the path, made smaller until it keeps the limits at full rate."""
        worst = self._worst(path, self._fine)
        while worst > 1:
            path = path.scaled(0.995 if worst < 1.01 else 0.97)
            worst = self._worst(path, self._fine)
        return path

    def _worst(self, path: FourierPath, time: Array) -> float:
        try:
            forces = self._forces([path], time)
        except PprsError:
            return OUTSIDE
        return float(self.limits.uses(self.question.model, forces, len(time)).max())

    def _forces(self, paths: list[FourierPath], time: Array) -> Forces:
        return forces_of(self._lenient, paths, time)

    def _gram(self, path: FourierPath) -> Array:
        """Return the information of a path."""
        return self.question.grams(self._forces([path], self._time), self._time, self.duration)[0]

    def _beside(self, path: FourierPath, step: float, random: np.random.Generator) -> FourierPath:
        """Return a path on the limits that differs by a step."""
        # Lengths and angles, of like size.
        unit = np.repeat((REACH, TURN), path.size // 2)
        x = path.parameters / unit
        return self._to_limits(path.with_parameters(unit * (
            x + step * np.abs(x).max() * random.normal(size=len(x)))), NEARBY)

    def _centre(self) -> tuple[float, float, float]:
        """Return the home pose, or the middle of the lifts' strokes if home is at a limit."""
        geometry, strokes = self.question.model.robot.geometry, self.question.model.strokes
        lean = (geometry.base_radius - geometry.platform_radius * float(np.mean(np.cos(
            np.subtract(geometry.platform_angles, geometry.chain_angles))))) / geometry.rod_length
        rise = geometry.rod_length * float(np.sqrt(max(1 - lean ** 2, 0.0)))
        middle = float(sum(end[-1] for end in strokes)) / 2 + geometry.elbow_sign * rise
        middle_pose = (0.0, 0.0, middle)
        for centre in (HOME, middle_pose):
            if self._worst(self._standing(centre), self._time_at_rest()) <= 1:
                return centre
        raise NoMotionError(f'no motion is allowed: standing at {HOME} m or {middle:.4g} m high '
                            f'the robot is beyond {self._first_limit(middle_pose)} already; the '
                            'limits, with their margin, must leave room')

    def _standing(self, centre: tuple[float, float, float]) -> FourierPath:
        return FourierPath.at_rest(self.duration, np.tile((1, 2), (FREEDOMS, 1)), centre)

    def _first_limit(self, centre: tuple[float, float, float]) -> str:
        time = self._time_at_rest()
        try:
            forces = self._forces([self._standing(centre)], time)
        except PprsError as error:
            return str(error)
        uses = self.limits.uses(self.question.model, forces, len(time))[0]
        return limit_names(self.question.model)[int(uses.argmax())]

    def _time_at_rest(self) -> Array:
        return np.linspace(0.0, self.duration, 4)


def forces_of(model: DriveModel, paths: list[FourierPath], time: Array) -> Forces:
    """Return the forces that drives must apply along paths, one after the other."""
    return model.drive_forces(joined_motion(paths, time))


class ArmSearch:
    """Searches for a motion of an arm that answers a question of its recordings.

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
        best = ArmDrawing(self.motions, OF_ARM, SMALLEST_OF_ARM).best(
            lambda series: self.question.worth(self._gram(series)), self.seed, progress)
        gram = self._gram(best)
        return Found(best, gram, self.motions.uses(best), self.question.worth(gram))

    def _gram(self, series: JointSeries) -> Array:
        question, duration = self.question, self.motions.duration
        samples = SAMPLES_PER_PERIOD * series.harmonics
        time: Array = np.arange(samples, dtype=float) * (duration / samples)
        forces = question.model.drive_forces(series.motion(time))
        return question.grams(forces, time, duration)[0]
