# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Motions of an arm that excite its inertia and friction: Fourier series of the joints.

Each joint moves from rest to rest, from the middle of its range, within the limits of the URDF;
whether links touch each other is not looked at. Of many series that one is taken which tells most
of what `pprs fit` determines, by the determinant of the information (D-optimal).

References
----------
J. Swevers, C. Ganseman, D. B. Tükel, J. De Schutter, H. Van Brussel, Optimal robot excitation and
identification, IEEE Transactions on Robotics and Automation 13 (1997).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.identification.bodies import Bodies
from pprs_dynamics.mechanism.joint_motion import JointMotion
from pprs_dynamics.mechanism.joint_series import JointSeries
from pprs_dynamics.model.arm_model import ArmModel

HARMONICS = 8  # of the duration
WIDEST = np.pi  # [rad, m]: a joint is not moved further from the middle, whatever its range
LOOKED_AT = 150  # samples of a motion, for its information
CHECKED = 2000  # samples at which limits are checked
DRAWN, CLIMBED = 40, 160  # motions drawn at random, and steps from the best of them
STEP = 0.3  # of a coefficient of unit size, at the first step; it shrinks to a tenth
SHRINKS, SHRINK = 40, 0.93  # until a motion keeps the limits
NOISE = 0.01  # of a joint's largest effort, standard deviation where the model knows no other


@dataclass(frozen=True)
class ArmLimits:
    """Limits of a motion beside those of the URDF.

    Parameters
    ----------
    velocity, acceleration : float
        Of every joint [rad/s, rad/s^2, or m/s, m/s^2]; the URDF's speeds hold too.
    margin : float
        Share of every limit that stays unused.
    """

    velocity: float = np.inf
    acceleration: float = 5.0
    margin: float = 0.1


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
    determined: int = 0
    total: int = 0
    limits: dict[str, float] | None = None

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

    def to_json(self) -> dict[str, Any]:
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
    random = np.random.default_rng(seed)
    search = _Search(model, limits, duration)
    size = JointSeries.size(HARMONICS)
    best, most = None, -np.inf
    for k in range(DRAWN + CLIMBED):
        if progress is not None:
            progress(k / (DRAWN + CLIMBED))
        if best is None or k < DRAWN:
            drawn = random.normal(size=(len(model.drives), size))
        else:
            step = STEP * (1 - 0.9 * (k - DRAWN) / CLIMBED)
            shape = best.series.coefficients
            drawn = (shape / np.abs(shape).max(axis=1, keepdims=True)
                     + step * random.normal(size=shape.shape))
        tried = search.within_limits(drawn)
        told = search.information(tried)
        value = float(np.sum(np.log1p(np.maximum(told, 0.0))))
        if value > most:
            best, most = replace(tried, determined=int(np.sum(told > 1)), total=len(told)), value
    assert best is not None
    return replace(best, limits=search.uses(best))


class _Search:
    """Motions of one duration within limits, and what they tell.

    Parameters
    ----------
    model : ArmModel
    limits : ArmLimits
    duration : float
    """

    def __init__(self, model: ArmModel, limits: ArmLimits, duration: float) -> None:
        tree, left = model.arm.tree, 1 - limits.margin
        self.model, self.duration = model, duration
        lower, upper = np.maximum(tree.lower, -WIDEST), np.minimum(tree.upper, WIDEST)
        self.middle, self.reach = (lower + upper) / 2, left * (upper - lower) / 2
        self.speed = left * np.minimum(tree.speed, limits.velocity)
        self.acceleration = np.full(len(model.drives), left * limits.acceleration)
        self.effort = left * tree.effort
        self.bodies = Bodies(model.arm.inertial)

    def within_limits(self, drawn: Array) -> ArmExcitation:
        """Return the largest motion of a shape that keeps the limits."""
        time = np.linspace(0, self.duration, CHECKED)
        found = JointSeries(drawn, self.middle, self.duration, HARMONICS)
        motion = found.motion(time)
        uses = np.max([np.abs(values).max(axis=0) / bound for values, bound in (
            (motion.position - self.middle, self.reach), (motion.velocity, self.speed),
            (motion.acceleration, self.acceleration))], axis=0)
        found = replace(found, coefficients=drawn / np.maximum(uses, 1e-12)[:, None])
        few = time[::CHECKED // LOOKED_AT]
        for _ in range(SHRINKS):
            efforts = self.model.drive_forces(found.motion(few)).total
            if np.all(np.abs(efforts) <= self.effort):
                break
            found = replace(found, coefficients=SHRINK * found.coefficients)
        return ArmExcitation(self.model, found)

    def information(self, found: ArmExcitation) -> Array:
        """Return by how much each combination is told better than by the description, squared."""
        motion = found.motion(np.linspace(0, self.duration, LOOKED_AT))
        count = len(self.middle)
        rows = self.model.arm.regressor(motion.position, motion.velocity, motion.acceleration)
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

    def uses(self, found: ArmExcitation) -> dict[str, float]:
        """Return the use of each limit, the margin taken off."""
        motion = found.motion(np.linspace(0, self.duration, CHECKED))
        efforts = self.model.drive_forces(motion).total
        return {name: float(np.max(np.abs(values) / bound)) for name, values, bound in (
            ('range', motion.position - self.middle, self.reach),
            ('speed', motion.velocity, self.speed),
            ('acceleration', motion.acceleration, self.acceleration),
            ('effort', efforts, self.effort))}
