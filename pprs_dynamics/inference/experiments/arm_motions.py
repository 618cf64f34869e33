# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motions of an arm within its limits: Fourier series of the joints, and the search among them.

Each joint moves from rest to rest, from the middle of its range, within the limits of the URDF;
whether links touch each other is not looked at. To excite inertia and friction that one of many
series is taken which determines most of what `pprs fit` estimates, by the determinant of the
information (D-optimal).

References
----------
J. Swevers, C. Ganseman, D. B. Tükel, J. De Schutter, H. Van Brussel, Optimal robot excitation and
identification, IEEE Transactions on Robotics and Automation 13 (1997).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.inference.experiments.climbing import climb
from pprs_dynamics.inference.fit.bodies import Bodies
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.joint_series import JointSeries
from pprs_dynamics.physics.model.drive_model import DriveModel

HARMONICS = 8  # of the duration
WIDEST = np.pi  # [rad, m]: a joint is not moved further from the middle, whatever its range
LOOKED_AT = 150  # samples of a motion, for its efforts and its information
CHECKED = 2000  # samples at which limits are checked
DRAWN = 40  # motions drawn at random
SHRINKS, SHRINK = 40, 0.93  # until a motion keeps the limits
TINY = 1e-12
NOISE = 0.01  # of a joint's largest effort, standard deviation where the model knows no other


@dataclass(frozen=True)
class ArmLimits:
    """Limits of a motion in addition to those of the URDF.

    Parameters
    ----------
    velocity, acceleration : float
        Of every joint [rad/s, rad/s^2, or m/s, m/s^2]; the URDF's speeds hold too.
    margin : float
        Share of every limit that stays unused.
    effort_reserve : float
        Taken off the efforts for what the model does not know of [N m, N].
    """

    velocity: float = np.inf
    acceleration: float = 5.0
    margin: float = 0.1
    effort_reserve: float = 0.0


class ArmMotions:
    """Motions of one duration within limits.

    Parameters
    ----------
    model : DriveModel
    limits : ArmLimits
    duration : float
    """

    def __init__(self, model: DriveModel, limits: ArmLimits, duration: float) -> None:
        tree, left = model.robot.structure, 1 - limits.margin
        self.model, self.duration = model, duration
        self.middle, reach = tree.room(WIDEST)
        self.reach = left * reach
        self.speed = left * np.minimum(tree.speed, limits.velocity)
        self.acceleration = np.full(len(model.drives), left * limits.acceleration)
        self.effort = np.maximum(left * tree.effort - limits.effort_reserve, 0.0)

    def within_limits(self, drawn: Array, harmonics: int = HARMONICS,
                      share: Array | float = 1.0) -> JointSeries:
        """Return the largest motion of a shape that keeps the limits.

        Parameters
        ----------
        drawn : (n, p) array
            Coefficients of the series of each joint, of any size.
        harmonics : int
        share : float or (n,) array
            Of the largest motion of each joint.
        """
        time = np.linspace(0, self.duration, CHECKED)
        found = JointSeries(drawn, self.middle, self.duration, harmonics)
        motion = found.motion(time)
        uses = np.max([np.abs(values).max(axis=0) / bound for values, bound in (
            (motion.position - self.middle, self.reach), (motion.velocity, self.speed),
            (motion.acceleration, self.acceleration))], axis=0)
        found = replace(found, coefficients=drawn * (
            np.broadcast_to(share, len(uses)) / np.maximum(uses, TINY))[:, None])
        few = time[::CHECKED // LOOKED_AT]
        for _ in range(SHRINKS):
            try:
                efforts = self.model.drive_forces(found.motion(few)).total
                if np.all(np.abs(efforts) <= self.effort):
                    break
            except WorkspaceError:
                pass  # loops that do not close, or nearly lose hold
            found = replace(found, coefficients=SHRINK * found.coefficients)
        return found

    def uses(self, found: JointSeries) -> dict[str, float]:
        """Return the use of each limit, the margin taken off."""
        motion = found.motion(np.linspace(0, self.duration, CHECKED))
        efforts = self.model.drive_forces(motion).total
        return {name: float(np.max(np.abs(values) / bound)) for name, values, bound in (
            ('range', motion.position - self.middle, self.reach),
            ('speed', motion.velocity, self.speed),
            ('acceleration', motion.acceleration, self.acceleration),
            ('effort', efforts, np.maximum(self.effort, TINY)))}


@dataclass(frozen=True)
class ArmDrawing:
    """How motions of an arm are drawn at random, and changed.

    Parameters
    ----------
    motions : ArmMotions
    highest : sequence of int
        Highest harmonics that are drawn.
    smallest : float
        Share of the largest motion of a joint; from there to 1 is drawn, evenly in its logarithm.
    """

    motions: ArmMotions
    highest: Sequence[int] = (HARMONICS,)
    smallest: float = 1.0

    def best(self, value: Callable[[JointSeries], float], seed: int,
             progress: Callable[[float], None] = lambda share: None) -> JointSeries:
        """Return the motion of the largest value: the best of many drawn, and steps from there."""
        random = np.random.default_rng(seed)
        first = max((self.draw(random) for _ in range(DRAWN)), key=lambda one: value(one[0]))
        return climb(first, self.beside, lambda one: value(one[0]), random, progress)[0]

    def draw(self, random: np.random.Generator) -> tuple[JointSeries, Array]:
        """Return a random motion, and the share of the largest one that each joint makes."""
        count, harmonics = len(self.motions.middle), int(random.choice(self.highest))
        share = np.exp(random.uniform(np.log(self.smallest), 0.0, count))
        drawn = random.normal(size=(count, JointSeries.size(harmonics)))
        return self.motions.within_limits(drawn, harmonics, share), share

    def beside(self, best: tuple[JointSeries, Array], step: float, random: np.random.Generator,
               ) -> tuple[JointSeries, Array]:
        """Return a motion that differs by a step from another one."""
        series, share = best
        shape = series.coefficients
        drawn = (shape / np.abs(shape).max(axis=1, keepdims=True)
                 + step * random.normal(size=shape.shape))
        share = np.minimum(share * np.exp(
            -step * np.log(self.smallest) * random.normal(size=len(share))), 1.0)
        return self.motions.within_limits(drawn, series.harmonics, share), share


@dataclass(frozen=True)
class ArmExcitation:
    """A designed motion.

    Parameters
    ----------
    model : DriveModel
    series : JointSeries
    determined, total : int
        Combinations of parameters of links, rotors and friction that it determines better than the
        description, and all.
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
        return (f'A motion of {self.series.duration:g} s that tells {self.determined} of '
                f'{self.total} numbers of links, rotors and friction better than the URDF; the '
                'rest does not show in any effort, or hardly. Whether links touch each other is '
                'not checked.')

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
    motions = ArmMotions(model, limits, duration)
    known = _Information(motions)
    best = ArmDrawing(motions).best(
        lambda one: float(np.sum(np.log1p(np.maximum(known.of(one), 0.0)))), seed,
        progress or (lambda share: None))
    told = known.of(best)
    return ArmExcitation(model, best, int(np.sum(told > 1)), len(told), motions.uses(best))


class _Information:
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
        motion = found.motion(np.linspace(0, self.duration, LOOKED_AT))
        count = len(self.effort)
        rows = self.model.robot.regressor(motion.position, motion.velocity, motion.acceleration)
        direction = np.tanh(motion.velocity / np.asarray(self.model.reversal.velocity))
        own = np.zeros((LOOKED_AT, count, 4 * count))
        for j in range(count):
            own[:, j, 4 * j:4 * j + 4] = np.column_stack((
                motion.acceleration[:, j], motion.velocity[:, j], direction[:, j],
                np.ones(LOOKED_AT)))
        efforts = np.abs(rows @ self.described).max(axis=0)
        largest = np.where(np.isfinite(self.effort), self.effort, np.maximum(efforts, 1e-3))
        columns = np.concatenate((rows @ self.slopes, own), axis=2) / (NOISE * largest)[:, None]
        # Friction and offsets are not known to begin with: to a tenth of the largest effort.
        scale = np.concatenate((np.ones(self.count), np.repeat(0.1 * largest, 4)))
        J = (columns * scale).reshape(-1, columns.shape[2])
        return np.asarray(np.linalg.eigvalsh(J.T @ J), dtype=float)
