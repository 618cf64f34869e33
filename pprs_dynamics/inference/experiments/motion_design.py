# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The search for the most informative motion within limits.

Random Fourier series are enlarged until they meet a limit. The best is improved by random steps
that become smaller: the value of a motion is rough, because drives reverse within a millimetre per
second. The motion is checked at the rate at which it is played.

References
----------
J. Swevers, C. Ganseman, D. B. Tükel, J. De Schutter, H. Van Brussel, Optimal robot excitation and
identification, IEEE Transactions on Robotics and Automation 13 (1997) 730-740.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError, WorkspaceError
from pprs_dynamics.inference.experiments.fourier_path import FREEDOMS, FourierPath
from pprs_dynamics.inference.experiments.motion_limits import ArmLimits, MotionLimits
from pprs_dynamics.physics.mechanism.joint_series import JointSeries
from pprs_dynamics.physics.mechanism.paths import HOME
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.three_pprs.robot import SingularityBounds

DRAWS, STEPS = 40, 160  # random motions, and steps from the best
FIRST, LAST = 0.3, 0.03  # size of the steps, relative to the largest coefficient
HALVINGS = 7
FINE_RATE = 500.0  # [Hz], at which limits are checked
SAMPLES_PER_PERIOD, LEAST_SAMPLES = 12, 240  # of the highest harmonic and in all, while searching
OUTSIDE = 2.0  # use of limits where the mechanism cannot follow
Motion = FourierPath | JointSeries
Random = np.random.Generator


class NoMotionError(PprsError, ValueError):
    """The robot has no room for a motion within its limits."""


class Motions(Protocol):
    """The motions of one duration among which a design searches."""

    duration: float
    scales: tuple[float, float]
    """Factors that bring a drawn motion to the limits."""

    def draw(self, random: Random) -> tuple[Any, float]:
        """Return a random motion, and the share of its largest size that it is to have."""

    def beside(self, motion: Any, step: float, random: Random) -> Any:
        """Return a motion that differs by a step, relative to the largest coefficient."""

    def uses(self, motion: Any, time: Array) -> dict[str, float]:
        """Return the use of each limit, its margin taken off; at most 1 within the limits."""


def design(motions: Motions, value: Callable[[Any], float], seed: int,
           progress: Callable[[float], None] = lambda share: None,
           screened: Callable[[list[Any]], Callable[[Any], float]] | None = None) -> Any:
    """Return the motion of the largest value that the search finds.

    Parameters
    ----------
    motions : Motions
    value : callable
        Of a motion.
    seed : int
    progress : callable, optional
        Called with the share that is done.
    screened : callable, optional
        Takes the random motions, and returns the value to use from then on.
    """
    drawn = random_motions(motions, seed, DRAWS, lambda share: progress(0.3 * share))
    value = value if screened is None else screened(drawn)
    first = max(drawn, key=value)
    best, most = first, value(first)
    random = np.random.default_rng(seed)
    for k in range(STEPS):
        progress(0.3 + 0.7 * k / STEPS)
        step = FIRST + (LAST - FIRST) * k / STEPS
        tried = to_limits(motions, motions.beside(best, step, random), (0.1, 1.2))
        found = value(tried)
        if found > most:
            best, most = tried, found
    # Values while searching are of few samples: at the full rate the start may be better.
    return max((within_limits(motions, motion) for motion in (first, best)), key=value)


def random_motions(motions: Motions, seed: int, count: int,
                   progress: Callable[[float], None] = lambda share: None) -> list[Any]:
    """Return random motions within the limits."""
    random, drawn = np.random.default_rng(seed), []
    for k in range(count):
        motion, share = motions.draw(random)
        drawn.append(to_limits(motions, motion, motions.scales).scaled(share))
        progress((k + 1) / count)
    return drawn


def to_limits(motions: Motions, motion: Any, scales: tuple[float, float]) -> Any:
    """Return the motion times the largest factor that the limits allow."""
    time = coarse_time(motion)
    if _worst(motions, motion.scaled(scales[1]), time) <= 1:
        return motion.scaled(scales[1])
    low, high = np.log(scales)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if _worst(motions, motion.scaled(float(np.exp(middle))), time) <= 1:
            low = middle
        else:
            high = middle
    return motion.scaled(float(np.exp(low)))


def within_limits(motions: Motions, motion: Any) -> Any:
    """Return the motion, made smaller until it keeps the limits at the full rate."""
    time = np.arange(round(motions.duration * FINE_RATE) + 1) / FINE_RATE
    while (worst := _worst(motions, motion, time)) > 1:
        motion = motion.scaled(0.995 if worst < 1.01 else 0.97)
    return motion


def limits_of(motions: Motions, motion: Any) -> dict[str, float]:
    """Return the use of each limit at the full rate."""
    return motions.uses(motion, np.arange(round(motions.duration * FINE_RATE) + 1) / FINE_RATE)


def coarse_time(motion: Motion) -> Array:
    """Return times of the samples of a motion while searching, (N,) [s]."""
    samples = max(SAMPLES_PER_PERIOD * int(np.max(motion.harmonics)), LEAST_SAMPLES)
    time: Array = np.arange(samples, dtype=float) * (motion.duration / samples)
    return time


def _worst(motions: Motions, motion: Any, time: Array) -> float:
    try:
        return max(motions.uses(motion, time).values())
    except PprsError:
        return OUTSIDE


class PlatformMotions:
    """Motions of the platform of a 3-PPRS.

    Parameters
    ----------
    model : DriveModel
    limits : MotionLimits
    duration : float
        [s]

    Raises
    ------
    NoMotionError
        Where the limits do not even let the robot stand at the centre.
    """

    HARMONICS = 4  # of each degree of freedom
    SLOWEST_TOP = 5  # the highest harmonic of the slowest motions
    HIGHEST_FREQUENCY = 1.5  # [Hz]; above it reconstruction from positions smooths
    REACH, TURN = 0.08, 0.25  # [m, rad], excursions to start from
    # Some series are smaller than the limits allow: slow motion shows friction near rest.
    SMALLER, SMALLEST = 0.25, 0.1
    scales = (0.02, 4.0)

    def __init__(self, model: DriveModel, limits: MotionLimits, duration: float) -> None:
        self.limits, self.duration = limits, duration
        # Poses near a singularity are compared, not refused, while searching.
        self.model = replace(model, robot=replace(model.robot, bounds=SingularityBounds(
            rod_sine=1e-3)))
        self._strict = model
        self.top = max(self.HARMONICS + 1, int(self.HIGHEST_FREQUENCY * duration))
        self.centre = self._centre()

    def draw(self, random: Random) -> tuple[FourierPath, float]:
        """Return a random motion, and the share of its largest size that it is to have."""
        highest = int(np.exp(random.uniform(np.log(min(self.SLOWEST_TOP, self.top)),
                                            np.log(self.top + 1))))
        highest = min(max(highest, self.HARMONICS), self.top)
        harmonics = np.stack([np.sort(1 + random.choice(highest, self.HARMONICS, replace=False))
                              for _ in range(FREEDOMS)])
        path = FourierPath.at_rest(self.duration, harmonics, self.centre)
        x = random.normal(size=(FREEDOMS, path.size // FREEDOMS))
        x *= np.exp(random.normal(scale=0.7, size=FREEDOMS))[:, None]
        x *= np.repeat((self.REACH, self.TURN), 3)[:, None] / np.abs(x).max()
        share = (float(np.exp(random.uniform(np.log(self.SMALLEST), 0)))
                 if random.random() < self.SMALLER else 1.0)
        return path.with_parameters(x.ravel()), share

    def beside(self, motion: FourierPath, step: float, random: Random) -> FourierPath:
        """Return a motion that differs by a step."""
        unit = np.repeat((self.REACH, self.TURN), motion.size // 2)
        x = motion.parameters / unit
        return motion.with_parameters(unit * (
            x + step * np.abs(x).max() * random.normal(size=len(x))))

    def uses(self, motion: FourierPath, time: Array) -> dict[str, float]:
        """Return the use of each limit."""
        return self.limits.uses(self._strict, self.model.drive_forces(motion.motion(time)))

    def _centre(self) -> tuple[float, float, float]:
        """Return the home pose, or the middle of the lifts' strokes if home is at a limit."""
        geometry = self.model.robot.geometry
        lean = (geometry.base_radius - geometry.platform_radius * float(np.mean(np.cos(
            np.subtract(geometry.platform_angles, geometry.chain_angles))))) / geometry.rod_length
        rise = geometry.rod_length * float(np.sqrt(max(1 - lean ** 2, 0.0)))
        middle = (float(sum(end[-1] for end in self.model.strokes)) / 2
                  + geometry.elbow_sign * rise)
        reason = ''
        for centre in (HOME, (0.0, 0.0, middle)):
            standing = FourierPath.at_rest(self.duration, np.tile((1, 2), (FREEDOMS, 1)), centre)
            try:
                uses = self.uses(standing, np.linspace(0.0, self.duration, 4))
            except PprsError as error:
                reason = str(error)
                continue
            reason = max(uses, key=lambda name: uses[name])
            if uses[reason] <= 1:
                return centre
        raise NoMotionError(f'no motion is allowed: at rest at {HOME} m or {middle:.4g} m high '
                            f'the robot is beyond {reason} already; the limits, with their '
                            'margin, must leave room')


class ArmMotions:
    """Motions of the joints of an arm, from the middle of their ranges.

    Collisions of links are not checked.

    Parameters
    ----------
    model : DriveModel
    limits : ArmLimits
        In addition to those of the URDF.
    duration : float
        [s]
    highest : tuple of int
        Highest harmonics of the duration, of which one is drawn. Slow motion shows friction, fast
        motion inertia; above 1 Hz an arm shakes what it stands on.
    smallest : float
        Share of the largest motion of a joint; small motion shows hysteresis.
    """

    WIDEST = np.pi  # [rad, m], excursion of a joint, whatever its range
    scales = (0.02, 1.0)

    def __init__(self, model: DriveModel, limits: ArmLimits, duration: float,
                 highest: tuple[int, ...] = (4, 8, 16), smallest: float = 0.2) -> None:
        tree, left = model.robot.structure, 1 - limits.margin
        self.model, self.duration, self.highest = model, duration, highest
        self.smallest = smallest
        self.middle, reach = tree.room(self.WIDEST)
        self.bounds = (left * reach, left * np.minimum(tree.speed, limits.velocity),
                       np.full(len(model.drives), left * limits.acceleration))
        self.effort = np.maximum(left * tree.effort - limits.effort_reserve, 1e-12)

    def draw(self, random: Random) -> tuple[JointSeries, float]:
        """Return a random motion in which each joint has a random share of its largest size."""
        harmonics, count = int(random.choice(self.highest)), len(self.middle)
        series = JointSeries(random.normal(size=(count, JointSeries.size(harmonics))),
                             self.middle, self.duration, harmonics)
        return self._sized(series, np.exp(random.uniform(np.log(self.smallest), 0.0, count))), 1.0

    def beside(self, motion: JointSeries, step: float, random: Random) -> JointSeries:
        """Return a motion that differs by a step, in shape and in the size of each joint."""
        a = motion.coefficients
        share = self._use_by_joint(motion) * np.exp(
            -step * np.log(self.smallest) * random.normal(size=len(a)))
        return self._sized(replace(motion, coefficients=a + step * np.abs(a).max(
            axis=1, keepdims=True) * random.normal(size=a.shape)), np.minimum(share, 1.0))

    def uses(self, motion: JointSeries, time: Array) -> dict[str, float]:
        """Return the use of each limit."""
        moved = motion.motion(time)
        try:
            efforts = self.model.drive_forces(moved).total
        except WorkspaceError:  # loops that do not close
            efforts = np.full((1, len(self.effort)), np.inf)
        return {name: float(np.max(np.abs(values) / bound)) for name, values, bound in (
            *zip(('range', 'speed', 'acceleration'), (
                moved.position - self.middle, moved.velocity, moved.acceleration), self.bounds,
                strict=True), ('effort', efforts, self.effort))}

    def _use_by_joint(self, motion: JointSeries) -> Array:
        moved = motion.motion(coarse_time(motion))
        use: Array = np.max([np.abs(values).max(axis=0) / bound for values, bound in zip(
            (moved.position - self.middle, moved.velocity, moved.acceleration), self.bounds,
            strict=True)], axis=0)
        return np.maximum(use, 1e-12)

    def _sized(self, motion: JointSeries, share: Array) -> JointSeries:
        """Return a motion in which each joint has a share of its largest size."""
        return replace(motion, coefficients=motion.coefficients * (
            share / self._use_by_joint(motion))[:, None])
