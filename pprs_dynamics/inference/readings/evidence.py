# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How likely a reading is: the regression of efforts on a model's inertia, gravity and friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.table import Reading, plain
from pprs_dynamics.inference.residuals.excerpt import PIECE, Excerpt, excerpt_of
from pprs_dynamics.inference.residuals.reconstruction import follow
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.drive_motion import DriveMotion
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.reversal import smooth_sign
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import RIGID_BODY

CONDITION = 1e-6  # of a column beside others: less is rounding


@dataclass(frozen=True)
class Parts:
    """A model's forces on an excerpt, (N, D) each; NaN where the mechanism cannot follow."""

    inertia: Array
    gravity: Array
    others: Array
    velocity: Array
    direction: Array

    def rows(self, which: NDArray[np.bool_]) -> Parts:
        """Return some of the samples."""
        return Parts(*(part[which] for part in (
            self.inertia, self.gravity, self.others, self.velocity, self.direction)))


def parts_of(model: DriveModel, excerpt: Excerpt, reading: Reading, in_pieces: bool = False,
             ) -> Parts | None:
    """Return a model's forces on an excerpt in a reading; None where it cannot follow at all."""
    motion = read_motion(excerpt.motion, reading)
    position = motion.position
    moved = replace(motion, position=position - model.position_error(position))
    count = len(position)
    rows = [slice(k, min(k + PIECE, count)) for part in motion.segments
            for k in range(part.start, part.stop, PIECE)] if in_pieces else [slice(0, count)]
    found = np.full((3, count, position.shape[1]), np.nan)
    for part in rows:
        try:
            found[:, part] = _forces(model, _taken(moved, part), excerpt.time[part])
        except (PprsError, np.linalg.LinAlgError):
            if not in_pieces:
                return None
    if not np.isfinite(found).any():
        return None
    # A drive that is always slow turns over within its own speeds.
    width = np.minimum(model.reversal.velocity, table.REVERSAL * np.sqrt(
        np.mean(motion.velocity ** 2, axis=0)) + 1e-300)
    return Parts(found[0], found[1], found[2], motion.velocity, smooth_sign(motion.velocity, width))


def read_motion(motion: DriveMotion, reading: Reading) -> DriveMotion:
    """Return a recorded motion in a reading."""
    return replace(motion, position=motion.position @ reading.position.T + reading.offset,
                   velocity=motion.velocity @ reading.position.T,
                   acceleration=motion.acceleration @ reading.position.T)


def _taken(motion: DriveMotion, part: slice) -> DriveMotion:
    segments = motion.segments if part.stop - part.start == len(motion.position) else (
        slice(0, part.stop - part.start),)
    return replace(motion, position=motion.position[part], velocity=motion.velocity[part],
                   acceleration=motion.acceleration[part], index=motion.index[part],
                   segments=segments)


def _forces(model: DriveModel, motion: DriveMotion, time: Array) -> Array:
    """Return forces by inertia, by gravity and by all else, (3, N, D)."""
    bodies = {RIGID_BODY, DriveInertia.name, *(
        effect.name for effect in model.effects if isinstance(effect, BodyEffect))}
    still = np.zeros_like(motion.velocity)
    rigid, others = [], np.zeros_like(still)
    with np.errstate(all='ignore'):
        for each in (motion, replace(motion, velocity=still, acceleration=still)):
            followed = follow(model, time, each).with_time(time)
            forces = model.drive_forces(followed)
            rigid.append(np.sum([forces.parts[name] for name in forces.parts if name in bodies],
                                axis=0))
            if not len(rigid) > 1:
                others = forces.total - rigid[0]
    return np.stack([rigid[0] - rigid[1], rigid[1], others])


class Likelihood(NamedTuple):
    """Score of efforts under a model [nats], and their residual over the effort, squared."""

    score: float
    left: float


def likelihood(effort: Array, parts: Parts, drive: int, scale: float, masses: float,
               ) -> Likelihood | None:
    """Return how likely efforts, (N,), are `scale` times those of a drive; None where all is 0.

    Inertia and gravity are the model's within a relative tolerance of its masses, friction
    opposes the motion with any size, and a constant is small in comparison.
    """
    columns = [part[:, drive] for part in (parts.inertia, parts.gravity, parts.others,
                                           parts.velocity, parts.direction)]
    known = np.isfinite(effort) & np.isfinite(columns[0])
    total = float(np.sum(effort[known] ** 2))
    swing = float(np.var(effort[known])) * int(known.sum()) + table.WEAK ** 2 * total
    count = int(known.sum())
    if count < len(columns) + 2 or not total > 0:
        return None
    inertia, gravity, *resisting = (column[known] for column in columns)
    ones = np.full(count, root_mean_square(effort[known]) / abs(scale))
    matrix = np.column_stack([inertia, gravity, *resisting, ones, -ones]) * scale
    # Coefficients in units of the model's forces: mean and standard deviation of each.
    mean = np.array([1.0, 1.0, *[0.0] * (matrix.shape[1] - 2)])
    width = np.array([masses, masses, *[np.inf] * len(resisting),
                      table.CONSTANT, table.CONSTANT])
    triangle = np.asarray(np.linalg.qr(np.column_stack([matrix, effort[known]]), mode='r'))
    variance = total / count
    for _ in range(3):
        weight = np.sqrt(variance * count / table.SAMPLES) / width
        found, _ = nnls(np.vstack([triangle[:, :-1], np.diag(weight)]),
                        np.concatenate([triangle[:, -1], weight * mean]))
        rest = triangle[:, -1] - triangle[:, :-1] @ found
        variance = max(float(rest @ rest), table.CLOSEST * swing) / count
    misfit = 0.5 * ((found - mean) / width) ** 2
    # Masses are off by factors.
    misfit[:2] = 0.5 * (np.log(np.maximum(found[:2], CONDITION)) / masses) ** 2
    rigid = matrix[:, :2]
    moves = np.linalg.norm(rigid, axis=0) > table.WEAK * np.linalg.norm(rigid)
    if abs(scale) != 1 and np.all(misfit[:2][moves] > table.MASSES_MOST):
        return Likelihood(-table.MASSES_MOST, 1.0)  # neither weight nor inertia has this unit
    cost = float(np.sum(np.minimum(misfit[:2], table.MASSES_MOST)[moves]) + np.sum(misfit[2:]))
    # Friction beyond some times the rigid body's forces is unlikely.
    friction, weight_of = (root_mean_square(each) + 1e-300 for each in (
        matrix[:, 2:5] @ found[2:5], rigid @ np.ones(2)))
    excess = float(np.log(friction / weight_of / table.FRICTION))
    cost += min(0.5 * max(excess, 0.0) ** 2, table.FRICTION_MOST)
    score = -0.5 * table.SAMPLES * float(np.log(variance * count / swing)) - cost
    # A residual that is larger than the effort is no worse than one that is as large.
    return Likelihood(max(score, -table.MASSES_MOST),
                      variance * count / float(np.sqrt(swing * total)))


@dataclass(frozen=True)
class Shares:
    """What an effort consists of, by least squares on a model's parts.

    Parameters
    ----------
    inertia, gravity : float
        Shares of the model's in the effort.
    inertia_doubt, gravity_doubt : float
        By how much each changes if the whole residual is attributed to it; infinite where the
        motion does not show it.
    viscous, dry : float
        Friction, over the swing of the effort; the former with its sign.
    friction, friction_by_chance : float
        Both together, negative where they drive the motion; and the friction that the residual
        alone would show.
    left, noise : float
        Residual, and fast noise, over the swing of the effort.
    """

    inertia: float
    inertia_doubt: float
    gravity: float
    gravity_doubt: float
    viscous: float
    dry: float
    friction: float
    friction_by_chance: float
    left: float
    noise: float

    @classmethod
    def of(cls, effort: Array, parts: Parts, drive: int, noise: float = np.inf) -> Shares:
        """Return the shares of efforts, (N,), of a drive, with its fast noise [N, N m]."""
        inertia, gravity, velocity, direction = (part[:, drive] for part in (
            parts.inertia, parts.gravity, parts.velocity, parts.direction))
        swing = float(np.std(effort))
        columns = [inertia, gravity, velocity, direction]
        found, doubts, left = fitted(effort, [*columns, np.ones_like(effort)])
        share, doubt = found[1], doubts[1]
        if np.std(gravity) < table.STEADY * root_mean_square(gravity):
            # A weight that hardly changes cannot be separated from a constant: it is one.
            alone, alone_doubts, _ = fitted(effort, columns)
            share, doubt = alone[1], alone_doubts[1]
        resistance = found[2] * velocity + found[3] * direction
        friction = root_mean_square(resistance) * float(np.sign(np.mean(resistance * velocity)))
        return cls(found[0], doubts[0], share, doubt, found[2] * float(np.std(velocity)) / swing,
                   abs(found[3]) * float(np.std(direction)) / swing, friction / swing,
                   left * float(np.sqrt(2 / len(effort))) / swing, left / swing, noise / swing)

    @property
    def scale(self) -> tuple[float, float]:
        """Factor of weight and inertia over the model's, and its doubt."""
        weights = [1 / max(doubt, 1e-6) ** 2 for doubt in (self.gravity_doubt, self.inertia_doubt)]
        if not sum(weights) > 0:
            return 0.0, float('inf')
        mean = float(np.average([self.gravity, self.inertia], weights=weights))
        return mean, float(1 / np.sqrt(sum(weights)))

    @property
    def lacks_inertia(self) -> bool:
        """Whether there is certainly less than half of the model's inertia."""
        return abs(self.inertia) + self.inertia_doubt < table.LEAST_SHARE

    @property
    def lacks_gravity(self) -> bool:
        """Whether there is certainly less than half of the model's gravity."""
        return abs(self.gravity) + self.gravity_doubt < table.LEAST_SHARE

    @property
    def shows_gravity(self) -> bool:
        """Whether half of the model's gravity would show."""
        return self.gravity_doubt < table.LEAST_SHARE

    @property
    def compliance(self) -> float:
        """Common factor of inertia and gravity; 0 where they have none."""
        share, doubt = min((self.inertia, self.inertia_doubt), (self.gravity, self.gravity_doubt),
                           key=lambda pair: pair[1])
        apart = abs(self.inertia - self.gravity)
        is_one = share > 2 * doubt and not apart > self.inertia_doubt + self.gravity_doubt
        return share if is_one else 0.0

    @property
    def has_friction(self) -> bool:
        """Whether friction is part of it."""
        return abs(self.friction) > max(table.LEAST_FRICTION,
                                        table.CERTAIN * self.friction_by_chance)

    @property
    def kind(self) -> str:
        """What the effort looks like in place of a measurement; '' where it may be one."""
        if self.lacks_inertia and (self.lacks_gravity or not self.shows_gravity):
            follows = (self.viscous > 0 and self.viscous ** 2 > table.FOLLOWS
                       and self.dry < table.LEAST_FRICTION)
            if follows or 0 < self.compliance < table.LARGEST_COMPLIANCE:
                return table.POSITION_ERROR
            if self.compliance:
                return ''  # a gain, or another unit
            if self.lacks_gravity:
                return table.EXTERNAL
        if self.lacks_inertia and not self.has_friction:
            return table.COMMAND
        if abs(self.gravity) + self.gravity_doubt < table.LEFT_GRAVITY and not self.compliance:
            return table.WITHOUT_GRAVITY
        is_exact = self.noise < table.LEAST_NOISE or self.left < table.LEAST_LEFT
        return table.NOISE_FREE if is_exact else ''


def effort_contents(model: DriveModel, recording: Recording, excerpt: Excerpt | None = None,
                    ) -> dict[str, Shares]:
    """Return the shares of the efforts of drives that move and have enough samples."""
    excerpt = excerpt or excerpt_of(recording, table.STRETCHES)
    parts = None if excerpt is None else parts_of(model, excerpt, plain(len(model.drives)))
    if excerpt is None or parts is None:
        return {}
    width = np.broadcast_to(model.reversal.velocity, (len(model.drives),))
    found = {}
    for d, drive in enumerate(model.drives):
        known = np.isfinite(excerpt.effort[:, d])
        effort = excerpt.effort[known, d]
        if (known.sum() >= table.LEAST_MEANS and np.ptp(effort) > 0
                and root_mean_square(parts.velocity[known, d]) > width[d]):
            found[drive] = Shares.of(effort, parts.rows(known), d, _fast_noise(recording, d))
    return found


def _fast_noise(recording: Recording, drive: int) -> float:
    """Return the standard deviation of changes that are faster than a motion.

    By the median of differences of samples 10 ms apart, so that reversals have no part in it; at
    least that of rounding.
    """
    found = [np.zeros(0)]
    for part in recording.segments:
        time = recording.time[part]
        step = max(1, round(table.NOISE_STEP / float(np.median(np.diff(time)))))
        found.append(np.abs(np.diff(recording.effort[part, drive][::step], table.NOISE_ORDER)))
    differences = np.concatenate(found)
    differences = differences[np.isfinite(differences)]
    if not len(differences):
        return float('inf')
    # White noise has its differences multiplied by the root of the sum of squared binomials.
    gain = np.sqrt(comb(2 * table.NOISE_ORDER, table.NOISE_ORDER))
    values = np.unique(recording.effort[np.isfinite(recording.effort[:, drive]), drive])
    return float(max(table.NORMAL * np.median(differences) / gain,
                     np.min(np.diff(values)) / np.sqrt(12)))


def rigid_factor(effort: Array, parts: Parts, drive: int) -> float:
    """Return the factor of a model's inertia and gravity together in efforts, (N,); 0 for none."""
    known = np.isfinite(effort) & np.isfinite(parts.inertia[:, drive])
    rigid, velocity, direction = (part[known, drive] for part in (
        parts.inertia + parts.gravity, parts.velocity, parts.direction))
    is_steady = np.std(rigid) < table.STEADY * root_mean_square(rigid)
    return fitted(effort[known], [rigid, velocity, direction, *(
        [] if is_steady else [np.ones_like(rigid)])])[0][0]


def fitted(effort: Array, columns: Sequence[Array]) -> tuple[list[float], list[float], float]:
    """Return coefficients, their doubts and the residual's root mean square.

    Columns that are combinations of others, or 0, have the coefficient 0 and infinite doubt.
    """
    matrix = np.column_stack(columns)
    sizes = np.sqrt(np.mean(matrix ** 2, axis=0))
    used = np.flatnonzero(sizes > 0)
    unit = matrix[:, used] / sizes[used]
    solution = np.linalg.lstsq(unit, effort, rcond=CONDITION)[0]
    left = root_mean_square(effort - unit @ solution)
    values, doubts = [0.0] * len(columns), [np.inf] * len(columns)
    for k, column in enumerate(used):
        others = np.delete(unit, k, axis=1)
        beyond = unit[:, k] - others @ np.linalg.lstsq(others, unit[:, k], rcond=CONDITION)[0]
        alone = root_mean_square(beyond)
        if alone > CONDITION:
            values[column] = float(solution[k] / sizes[column])
            doubts[column] = left / (alone * float(sizes[column]))
    return values, doubts, left
