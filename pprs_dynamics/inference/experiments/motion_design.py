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

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.effects.laws.joint_friction import IndependentChainsFriction
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion, JointSeries
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces

WIDEST = np.pi  # [rad, m], excursion of a joint, whatever its range
SLIDE_SPEED = 0.5  # [m/s], of the 3-PPRS, whose file has no limit of speed
ACCELERATION = 5.0  # [m/s^2, rad/s^2], of every drive
TILT = 0.35  # [rad], of the platform of the 3-PPRS against the horizontal
# Of the drive Jacobian of the 3-PPRS. Towards a singularity small errors of the model grow large,
# and a few moments there would carry all the evidence.
CONDITION_NUMBER = 8.0
USED = 0.9  # share of every limit
DRAWS, STEPS = 40, 160  # random motions, and steps from the best
FIRST, LAST = 0.3, 0.03  # size of the steps, relative to the largest coefficient
HALVINGS = 7
FINE_RATE = 500.0  # [Hz], at which limits are checked
SAMPLES_PER_PERIOD, LEAST_SAMPLES = 12, 240  # of the highest harmonic and in all, while searching
OUTSIDE = 2.0  # use of limits where the mechanism cannot follow
# Slow motion shows friction, fast motion inertia: highest harmonics, of which one is drawn, and the
# frequency [Hz] above which reconstruction from positions smooths and arms shake their base.
HARMONICS, HIGHEST_FREQUENCY = (4, 8, 16), 1.5
SMALLEST = 0.2  # share of the largest excursion of a coordinate; small motion shows hysteresis
Random = np.random.Generator


class NoMotionError(PprsError, ValueError):
    """The robot has no room for a motion within its limits."""


def room(model: DriveModel) -> tuple[Array, Array]:
    """Return the middle of the drives' motion and the way to either side, (D,) each."""
    if not model.robot.plans_poses:
        middle, reach = model.robot.structure.room(WIDEST)
        return middle, reach
    lower, upper = model.limits.lower, model.limits.upper
    return (lower + upper) / 2, (upper - lower) / 2


@dataclass(frozen=True)
class Motions:
    """The motions of one duration among which a design searches, within limits.

    Those of the model file, and those above. Collisions are not checked.

    Parameters
    ----------
    model : DriveModel
    duration : float
        [s]
    effort_reserve : float
        Taken off the efforts for what the model does not know of [N, N m].

    Raises
    ------
    NoMotionError
        Where the limits do not even let the robot stand in the middle of its workspace.
    PprsError
        Where the model has no forces at that pose.
    """

    model: DriveModel
    duration: float
    effort_reserve: float = 0.0

    def __post_init__(self) -> None:
        standing = JointSeries(np.zeros((len(self.middle), JointSeries.size(2))), self.middle,
                               self.duration, 2)
        uses = self.uses(standing, np.linspace(0.0, self.duration, 4))
        worst = max(uses, key=uses.__getitem__)
        if uses[worst] > 1:
            raise NoMotionError('no motion is allowed: at rest in the middle of its workspace the '
                                f'robot already exceeds its limit of {worst}, less the margin; '
                                'raise the limits in the model file')

    @cached_property
    def middle(self) -> Array:
        """Positions of the drives about which they move, (D,)."""
        return room(self.model)[0]

    def sampled(self, series: JointSeries, time: Array) -> PlatformMotion | JointMotion:
        """Return the motion of a series at times [s]: of the 3-PPRS that of its platform."""
        moved, robot = series.motion(time), cast(Any, self.model.robot)
        return moved if not robot.plans_poses else robot.platform_motion(robot.at(
            moved.position, moved.velocity, moved.acceleration)).with_time(time)

    def forces(self, series: JointSeries, time: Array) -> Forces:
        """Return the model's forces along a series at times [s]."""
        return self.model.drive_forces(series.motion(time))

    def uses(self, series: JointSeries, time: Array | None = None) -> dict[str, float]:
        """Return the use of each limit, its margin taken off; by default at the full rate."""
        if time is None:
            time = np.arange(round(self.duration * FINE_RATE) + 1) / FINE_RATE
        model, forces = self.model, self.forces(series, time)
        state: Any = forces.mechanism
        shares = self._of_drives(state.position, state.velocity, state.acceleration)
        shares['effort'] = (np.abs(forces.total) + self.effort_reserve) / (
            USED * model.limits.efforts)
        found = {f'{name} of {drive}': share[:, d] for name, share in shares.items()
                 for d, drive in enumerate(model.drives)}
        return {name: float(share.max()) for name, share in (
            {**found, **self._of_platform(state)} if model.robot.plans_poses else found).items()}

    def _of_drives(self, position: Array, velocity: Array, acceleration: Array,
                   ) -> dict[str, Array]:
        """Return the use of range, speed and acceleration of every drive, (N, D) each."""
        middle, reach = room(self.model)
        usual = SLIDE_SPEED if self.model.robot.plans_poses else np.inf
        fastest = np.minimum(self.model.robot.structure.speed, usual)
        return {name: np.abs(values) / (USED * bound) for name, values, bound in (
            ('range', position - middle, np.maximum(reach, 1e-12)),
            ('velocity', velocity, fastest), ('acceleration', acceleration, ACCELERATION))}

    def _of_platform(self, state: Any) -> dict[str, Array]:
        """Return the use of what limits the 3-PPRS alone, (N,) each."""
        robot: Any = self.model.robot
        bounds, (u, *_) = robot.bounds, robot.rods(state.links)
        angles = {'rod angle of chain': (1 - np.abs(np.sin(u))) / (USED * (1 - bounds.rod_sine))}
        if any(isinstance(effect, IndependentChainsFriction) for effect in self.model.effects):
            angles['cosine of rod angle'] = (1 - np.abs(np.cos(u))) / (
                USED * (1 - bounds.rod_cosine))
        return {
            **{f'{name} {k + 1}': share[:, k] for name, share in angles.items() for k in range(3)},
            'tilt of the platform': robot.variables(state)['platform_tilt'] / (USED * TILT),
            'condition number': robot.condition_number(robot.jacobian(state.links)) / (
                USED * min(bounds.condition_number, CONDITION_NUMBER))}

    def draw(self, random: Random) -> JointSeries:
        """Return a random motion: each coordinate has a random share of its largest size."""
        highest = [k for k in HARMONICS if k <= HIGHEST_FREQUENCY * self.duration]
        harmonics, count = int(random.choice(highest or HARMONICS[:1])), len(self.middle)
        series = JointSeries(random.normal(size=(count, JointSeries.size(harmonics))),
                             self.middle, self.duration, harmonics)
        return self._sized(series, np.exp(random.uniform(np.log(SMALLEST), 0.0, count)))

    def beside(self, series: JointSeries, step: float, random: Random) -> JointSeries:
        """Return a motion that differs by a step, in shape and in the size of each coordinate."""
        a = series.coefficients
        share = self._excursions(series) * np.exp(
            -step * np.log(SMALLEST) * random.normal(size=len(a)))
        moved = a + step * np.abs(a).max(axis=1, keepdims=True) * random.normal(size=a.shape)
        return self._sized(replace(series, coefficients=moved), np.minimum(share, 1.0))

    def to_limits(self, series: JointSeries, scales: tuple[float, float]) -> JointSeries:
        """Return the motion times the largest factor, between two, that the limits allow."""
        time = coarse_time(series)
        if self._worst(series.scaled(scales[1]), time) <= 1:
            return series.scaled(scales[1])
        low, high = np.log(scales)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            if self._worst(series.scaled(float(np.exp(middle))), time) <= 1:
                low = middle
            else:
                high = middle
        return series.scaled(float(np.exp(low)))

    def within_limits(self, series: JointSeries) -> JointSeries:
        """Return the motion, made smaller until it keeps the limits at the full rate."""
        while (worst := self._worst(series)) > 1:
            series = series.scaled(0.995 if worst < 1.01 else 0.97)
        return series

    def drawn(self, seed: int, count: int = DRAWS) -> list[JointSeries]:
        """Return random motions within the limits."""
        random = np.random.default_rng(seed)
        return [self.to_limits(self.draw(random), (0.02, 1.0)) for _ in range(count)]

    def _worst(self, series: JointSeries, time: Array | None = None) -> float:
        try:
            return max(self.uses(series, time).values())
        except PprsError:
            return OUTSIDE

    def _excursions(self, series: JointSeries) -> Array:
        """Return the largest use of range, speed and acceleration of each drive, (D,)."""
        motion = series.motion(coarse_time(series))
        largest: Array = np.max([share.max(axis=0) for share in self._of_drives(
            motion.position, motion.velocity, motion.acceleration).values()], axis=0)
        return np.maximum(largest, 1e-12)

    def _sized(self, series: JointSeries, share: Array) -> JointSeries:
        """Return a motion in which each coordinate has a share of its largest size."""
        return replace(series, coefficients=series.coefficients * (
            share / self._excursions(series))[:, None])


def design(motions: Motions, drawn: Sequence[JointSeries], value: Callable[[JointSeries], float],
           seed: int, progress: Callable[[float], None] = lambda share: None) -> JointSeries:
    """Return the motion of the largest value that the search finds, from the best that was drawn.

    Parameters
    ----------
    motions : Motions
    drawn : sequence of JointSeries
        Random ones within the limits.
    value : callable
        Of a motion.
    seed : int
    progress : callable, optional
        Called with the share that is done.
    """
    first = max(drawn, key=value)
    best, most = first, value(first)
    random = np.random.default_rng(seed)
    for k in range(STEPS):
        progress(k / STEPS)
        step = FIRST + (LAST - FIRST) * k / STEPS
        tried = motions.to_limits(motions.beside(best, step, random), (0.1, 1.2))
        found = value(tried)
        if found > most:
            best, most = tried, found
    # Values while searching are of few samples: at the full rate the start may be better.
    return max(map(motions.within_limits, (first, best)), key=value)


def coarse_time(series: JointSeries) -> Array:
    """Return times of the samples of a motion while searching, (N,) [s]."""
    samples = max(SAMPLES_PER_PERIOD * series.harmonics, LEAST_SAMPLES)
    time: Array = np.arange(samples, dtype=float) * (series.duration / samples)
    return time
