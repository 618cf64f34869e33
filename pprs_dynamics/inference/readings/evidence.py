# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How likely a reading is: the regression of efforts on a model's inertia, gravity and friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.table import Reading
from pprs_dynamics.inference.residuals.excerpt import PIECE, Excerpt, excerpt_of
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.drive_motion import DriveMotion
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.laws.payload_mass import PayloadMass
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.state import smooth_sign
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import RIGID_BODY

CONDITION = 1e-6  # of a column among others: less is rounding
# Columns of the regression of one drive; the effort is the last one.
INERTIA, GRAVITY, OTHERS, VELOCITY, DIRECTION, CONSTANT, EFFORT = range(7)


class Likelihood(NamedTuple):
    """Score of efforts under a model [nats], prior cost in it, and their residual.

    The residual is the square of that over the effort.
    """

    score: float
    prior: float
    residual: float


@dataclass
class Evidence:
    """Regression of the efforts of an excerpt on a model's forces, for D drives and E columns.

    Parameters
    ----------
    roots : (D, E, 7, 7) array
        By drive and column of efforts: triangle of the QR decomposition of inertia, gravity, other
        forces, velocity, its direction, 1 and the effort.
    count, total, swing : (D, E) arrays
        Samples, sum of the squared efforts, and of their differences from the mean.
    size, speed : (D,) arrays
        Root mean squares of the model's forces, and of velocities.
    force : (N, D) array
        Of the model; NaN where the mechanism cannot follow.
    balance : (D,) array
        Weights of the bodies on a drive, as the root of their sum of squares, over their sum.
    """

    roots: Array
    count: Array
    total: Array
    swing: Array
    size: Array
    speed: Array
    force: Array
    balance: Array

    @classmethod
    def of(cls, model: DriveModel, excerpt: Excerpt, reading: Reading | None = None,
           ) -> Evidence | None:
        """Return the evidence of a reading of an excerpt; None where no motion can be followed.

        Without a reading, as it was recorded: such a motion may be followed in parts alone.
        """
        in_pieces = reading is None
        motion = excerpt.motion if reading is None else read_motion(excerpt.motion, reading)
        position = motion.position
        moved = replace(motion, position=position - model.position_error(position))
        count = len(position)
        forces = np.full((3, *position.shape), np.nan)
        rows = [slice(0, count)] + [slice(first, min(first + PIECE, count)) for first in range(
            0, count, PIECE)] * in_pieces
        for part in rows:
            try:
                forces[:, part] = forces_of(model, _taken(moved, part), excerpt.time[part])
            except (PprsError, np.linalg.LinAlgError):
                if not in_pieces:
                    return None
            else:
                if part == rows[0]:
                    break
        followed = np.asarray(np.isfinite(forces).all(axis=0))
        if not np.any(followed):
            return None
        # A width of its own would be evidence for a unit of velocities.
        speed = np.sqrt(np.mean(motion.velocity ** 2, axis=0))
        direction = smooth_sign(motion.velocity, table.REVERSAL * speed + 1e-300)
        columns = np.stack([*forces, motion.velocity, direction, np.ones_like(position)], axis=2)
        roots = np.array([[_root(columns[:, d], followed[:, d], effort)
                           for effort in excerpt.effort.T] for d in range(position.shape[1])])
        samples, squares = (np.sum(roots[..., k] ** 2, axis=2) for k in (CONSTANT, EFFORT))
        swing = squares - np.sum(roots[..., CONSTANT] * roots[..., EFFORT], axis=2) ** 2 / (
            np.maximum(samples, 1))
        force = forces.sum(axis=0)
        return cls(roots, samples, squares, np.maximum(swing, 0.0) + table.WEAK ** 2 * squares,
                   np.sqrt(np.nanmean(force ** 2, axis=0)), speed, force,
                   _balance(model, position[followed.all(axis=1)]))

    @property
    def has_weight(self) -> bool:
        """Whether the model has any."""
        size = np.linalg.norm(self.roots[..., GRAVITY], axis=-1)
        rest = np.linalg.norm(self.roots[..., INERTIA], axis=-1)
        return bool(np.any(size > table.WEAK * rest))

    def moves(self, model: DriveModel) -> NDArray[np.bool_]:
        """Return which drives are faster than friction holds them, (D,) bool.

        A wide reversal may be that of cables or gears, which move within it.
        """
        return np.asarray(self.speed > np.minimum(model.reversal.velocity, table.RESTING))

    def is_measured(self, drive: int, column: int) -> bool:
        """Whether there are enough efforts for a regression."""
        return bool(self.count[drive, column] > EFFORT and self.total[drive, column] > 0)

    def likelihood(self, drive: int, column: int, scale: float, masses: float) -> Likelihood:
        """Return the log-likelihood that efforts are `scale` times those of a drive.

        Inertia and gravity are the model's within a relative tolerance of its masses, friction
        opposes the motion with any size, and a constant is small in comparison. The weight of
        bodies that balance each other may be any, of either sign: each has its own error. The
        inertia of a model without weight is often a guess: any beyond a factor of 4 is as likely.
        """
        root = self.roots[drive, column]
        count, total, swing = (float(sums[drive, column]) / (1.0 if k == 0 else scale ** 2)
                               for k, sums in enumerate((self.count, self.total, self.swing)))
        matrix = np.column_stack([root[:, :EFFORT], -root[:, CONSTANT],
                                  root[:, GRAVITY], -root[:, GRAVITY]])
        target = root[:, EFFORT] / scale
        # Coefficients in units of the model's forces: mean and standard deviation of each.
        mean = np.array([1.0, 1.0, *[0.0] * 7])
        constant = table.CONSTANT * np.sqrt(total / count)
        apart = max(table.SAME_BALANCE, masses * float(np.sqrt(self.balance[drive] ** 2 - 1)))
        rigid = matrix[:, :2]
        moves = np.linalg.norm(rigid, axis=0) > table.WEAK * np.linalg.norm(rigid)
        of_rigid = np.where(moves & (not self.has_weight), np.inf, masses)
        width = np.array([*of_rigid, *[np.inf] * 3, *[constant] * 2, *[apart] * 2])
        variance = total / count
        for _ in range(3):
            weight = np.sqrt(variance * count / table.SAMPLES) / width
            found, _ = nnls(np.vstack([matrix, np.diag(weight)]),
                            np.concatenate([target, weight * mean]))
            rest = target - matrix @ found
            variance = max(float(rest @ rest), table.CLOSEST * swing) / count
        misfit = 0.5 * ((found - mean) / width) ** 2
        # Masses are off by factors.
        misfit[:2] = 0.5 * (np.log(np.maximum(found[:2], CONDITION)) / masses) ** 2
        cost = float(np.sum(np.minimum(misfit[:2], table.MASSES_MOST)[moves]) + np.sum(misfit[2:]))
        # Friction beyond some times the rigid body's forces is unlikely.
        friction, weight_of = (np.linalg.norm(force) + 1e-300 for force in (
            matrix[:, OTHERS:CONSTANT] @ found[OTHERS:CONSTANT], rigid.sum(axis=1)))
        excess = float(np.log(friction / weight_of / table.FRICTION))
        cost += min(0.5 * max(excess, 0.0) ** 2, table.FRICTION_MOST)
        score = -0.5 * table.SAMPLES * float(np.log(variance * count / swing)) - cost
        # A residual that is larger than the effort is no worse than one that is as large.
        return Likelihood(max(score, -table.MASSES_MOST), cost,
                          variance * count / float(np.sqrt(swing * total)))

    def factor(self, drive: int, column: int) -> float:
        """Return the factor of inertia and gravity in efforts; NaN where it is not certain."""
        if not self.is_measured(drive, column):
            return np.nan
        root = self.roots[drive, column]
        rigid = root[:, INERTIA] + root[:, GRAVITY]
        columns = [rigid, root[:, VELOCITY], root[:, DIRECTION]]
        if not _is_steady(root, rigid):
            columns.append(root[:, CONSTANT])
        factors, doubts, _ = fitted(root[:, EFFORT], columns)
        return factors[0] if abs(factors[0]) > table.CERTAIN * doubts[0] else np.nan


def _root(columns: Array, followed: NDArray[np.bool_], effort: Array) -> Array:
    """Return the triangle of the QR decomposition of columns and an effort where both are known."""
    known = followed & np.isfinite(effort)
    matrix = np.column_stack([columns[known], effort[known]])
    return np.asarray(np.linalg.qr(np.vstack([matrix, np.zeros((7, 7))]), mode='r'))


def _balance(model: DriveModel, position: Array) -> Array:
    """Return the weights of bodies on each drive, (D,), over their sum; at least 1."""
    robot = model.robot
    if not len(position):
        return np.ones(len(model.drives))
    some = position[::max(1, len(position) // table.LEAST_MEANS)]
    try:
        columns = robot.regressor(some, np.zeros_like(some), np.zeros_like(some))
    except PprsError:
        return np.ones(len(model.drives))
    weights = np.sum(columns.reshape(*some.shape, *robot.inertial.shape) * robot.inertial, axis=3)
    all_of_them = np.sum(np.sum(weights, axis=2) ** 2, axis=0)
    balance: Array = np.sqrt(np.maximum(np.sum(weights ** 2, axis=(0, 2)) / np.where(
        all_of_them > 0, all_of_them, np.inf), 1.0))
    return balance


def _is_steady(root: Array, force: Array) -> bool:
    """Return whether a force of the regression hardly changes: it is a constant."""
    ones = root[:, CONSTANT]
    size, mean = float(force @ force), float(force @ ones) / max(float(ones @ ones), 1e-300)
    return size - mean ** 2 * float(ones @ ones) < table.STEADY ** 2 * size


def gravity_key(model: DriveModel) -> str:
    """Return the key of a model's gravity."""
    return 'robot.gravity' if 'robot.gravity' in model.values else 'gravity'


def in_reading(model: DriveModel, reading: Reading) -> DriveModel:
    """Return a model under the gravity, and with the load, of a reading."""
    changes: dict[str, Any] = {}
    if reading.gravity is not None:
        changes = {gravity_key(model): tuple((reading.gravity + 0.0).tolist())}
    if reading.load:
        changes |= {'effects.active': (*model.values.get('effects.active', ()), PayloadMass.name),
                    f'effects.{PayloadMass.name}.mass': reading.load}
    return DriveModel.from_parameters({**model.values, **changes}, model.source) if (
        changes) else model


def read_motion(motion: DriveMotion, reading: Reading) -> DriveMotion:
    """Return a recorded motion in a reading."""
    position, velocity, acceleration = (values[:, reading.positions] * reading.scale for values in (
        motion.position, motion.velocity, motion.acceleration))
    return replace(motion, position=position + reading.offset, velocity=velocity,
                   acceleration=acceleration)


def _taken(motion: DriveMotion, part: slice) -> DriveMotion:
    if part.stop - part.start == len(motion.position):
        return motion
    return replace(motion, position=motion.position[part], velocity=motion.velocity[part],
                   acceleration=motion.acceleration[part], index=motion.index[part],
                   segments=(slice(0, part.stop - part.start),))


def forces_of(model: DriveModel, motion: DriveMotion, time: Array) -> Array:
    """Return forces by inertia, by gravity and by all else, (3, N, D)."""
    bodies = {RIGID_BODY, DriveInertia.name, *(
        effect.name for effect in model.effects if isinstance(effect, BodyEffect))}
    still = np.zeros_like(motion.velocity)
    rigid, others = [], np.zeros_like(still)
    with np.errstate(all='ignore'):
        for moved in (motion, replace(motion, velocity=still, acceleration=still)):
            forces = model.drive_forces(JointMotion(
                moved.position, moved.velocity, moved.acceleration, time))
            rigid.append(np.sum([forces.parts[name] for name in forces.parts if name in bodies],
                                axis=0))
            if not len(rigid) > 1:
                others = forces.total - rigid[0]
    return np.stack([rigid[0] - rigid[1], rigid[1], others])


def mounting_in(model: DriveModel, excerpt: Excerpt, reading: Reading) -> Reading | None:
    """Return the row of the table with the gravity that explains the efforts of a reading.

    Efforts, in any unit, are fitted with a free gravity vector, and each drive's inertia, friction
    and offset. None where the direction is the model's, or explains the efforts of some drive not
    much better.
    """
    given = np.asarray(model.values[gravity_key(model)], dtype=float)
    size = float(np.linalg.norm(given))
    if size == 0:
        return None
    motion = read_motion(excerpt.motion, reading)
    try:
        (_, nothing, _), *weights = (forces_of(in_reading(model, replace(
            reading, gravity=gravity)), motion, excerpt.time)
            for gravity in (np.zeros(3), *size * np.eye(3)))
    except (PprsError, np.linalg.LinAlgError):  # what the mechanism cannot follow
        return None
    columns = np.stack([weight - nothing for _, weight, _ in weights], axis=2)
    v, a, inertia = motion.velocity, motion.acceleration, weights[0][0]
    own = np.stack((v, np.sign(v), a, np.ones_like(v), inertia), axis=2)
    rows, targets = [], []
    for d, effort in enumerate(excerpt.effort[:, reading.efforts].T):
        at = np.isfinite(effort)
        y = np.column_stack((effort[at], columns[at, d]))
        # What the drive's inertia, friction and offset do not explain.
        rest = y - own[at, d] @ np.linalg.lstsq(own[at, d], y, rcond=None)[0]
        if np.any(rest[:, 0]) and np.any(rest[:, 1:]):
            rest /= root_mean_square(rest[:, 0])
            rows.append(rest[:, 1:])
            targets.append(rest[:, 0])
    if not rows:
        return None
    G, target = np.concatenate(rows), np.concatenate(targets)
    share = np.linalg.lstsq(G, target, rcond=1e-3)[0]
    along = G @ given
    same = given * max(float(along @ target), 0.0) / max(float(along @ along), 1e-300)
    is_explained = all(
        np.sum((target - G @ share) ** 2) < table.MOST_LEFT * np.sum((target - G @ same) ** 2)
        for G, target in zip(rows, targets, strict=True))
    norm = float(np.linalg.norm(share))
    if not is_explained or _angle(share, given) < table.LEAST_TILT:
        return None
    largest = np.argmax(np.abs(share))
    axis = np.sign(share[largest]) * np.eye(3)[largest]
    gravity = size * axis if _angle(share, axis) < table.ALONG else (size / norm * share).round(1)
    found, known = (', '.join(f'{value + 0.0:g}' for value in vector)
                    for vector in (gravity, given))
    return replace(
        Reading.plain(len(model.drives)), kind='mounting', gravity=gravity,
        drives=tuple(range(len(model.drives))), cost=table.COST['mounting'],
        what=f'gravity in the base is ({found}) m/s² in this recording and ({known}) m/s² in the '
        'model: the robot is mounted in another direction')


def _angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors, (3,) [rad]."""
    sizes = max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300)
    return float(np.arccos(np.clip(a @ b / sizes, -1.0, 1.0)))


@dataclass(frozen=True)
class Shares:
    """What an effort consists of, by least squares on a model's parts.

    Parameters
    ----------
    inertia, gravity : float
        Shares of the model's in the effort.
    inertia_doubt, gravity_doubt : float
        By how much each changes if the whole residual but its noise is attributed to it; infinite
        where the motion does not show it.
    viscous, dry : float
        Friction, over the swing of the effort; the former with its sign.
    friction, friction_by_chance : float
        Both together, and the friction that the residual alone would show.
    residual, noise : float
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
    residual: float
    noise: float

    @classmethod
    def of(cls, evidence: Evidence, drive: int, column: int, noise: float = np.inf) -> Shares:
        """Return the shares of efforts of a drive, with their fast noise [N, N m]."""
        root, count = evidence.roots[drive, column], float(evidence.count[drive, column])
        effort, ones = root[:, EFFORT], root[:, CONSTANT]
        swing = float(np.sqrt(max(effort @ effort - (effort @ ones) ** 2 / count, 1e-300)))
        parts = [root[:, k] for k in (INERTIA, GRAVITY, VELOCITY, DIRECTION)]
        found, doubts, residual = fitted(effort, [*parts, ones])
        share, doubt = found[1], doubts[1]
        if _is_steady(root, parts[1]):
            # A weight that hardly changes cannot be separated from constants, and is one with the
            # model's own: a fit writes either.
            constant = fitted(root[:, OTHERS], [*parts[2:], ones])[0][2]
            parts[1] = parts[1] + constant * ones
            alone, alone_doubts, _ = fitted(effort, parts)
            share, doubt = alone[1], alone_doubts[1]
        # Fast noise averages out.
        fast = noise * float(np.sqrt(count)) / max(residual, 1e-300) if noise < np.inf else 0.0
        slow = float(np.sqrt(np.clip(1 - fast ** 2, table.CERTAIN ** 2 / count, 1.0)))
        viscous, dry = found[2] * parts[2], found[3] * parts[3]
        return cls(found[0], slow * doubts[0], share, slow * doubt,
                   float(np.sign(found[2]) * np.linalg.norm(viscous)) / swing,
                   float(np.linalg.norm(dry)) / swing, float(np.linalg.norm(viscous + dry)) / swing,
                   residual * float(np.sqrt(2 / count)) / swing, residual / swing,
                   noise * float(np.sqrt(count)) / swing)

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
        return self.friction > max(table.LEAST_FRICTION, table.CERTAIN * self.friction_by_chance)

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
        is_exact = self.noise < table.LEAST_NOISE or self.residual < table.LEAST_LEFT
        return table.NOISE_FREE if is_exact else ''


def effort_contents(model: DriveModel, recording: Recording, evidence: Evidence | None = None,
                    ) -> dict[str, Shares]:
    """Return the shares of the efforts of drives that move and have enough samples."""
    if evidence is None:
        excerpt = excerpt_of(recording, table.STRETCHES)
        evidence = None if excerpt is None else Evidence.of(model, excerpt)
    if evidence is None:
        return {}
    moves = evidence.moves(model)
    return {drive: Shares.of(evidence, d, d, _fast_noise(recording, d))
            for d, drive in enumerate(model.drives)
            if evidence.count[d, d] >= table.LEAST_MEANS and moves[d]
            and np.ptp(recording.effort[np.isfinite(recording.effort[:, d]), d]) > 0}


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


def fitted(effort: Array, columns: Sequence[Array]) -> tuple[list[float], list[float], float]:
    """Return coefficients, their doubts and the norm of the residual.

    Columns that are combinations of others, or 0, have the coefficient 0 and infinite doubt.
    """
    matrix = np.column_stack(columns)
    sizes = np.linalg.norm(matrix, axis=0)
    used = np.flatnonzero(sizes > 0)
    unit = matrix[:, used] / sizes[used]
    solution = np.linalg.lstsq(unit, effort, rcond=CONDITION)[0]
    residual = float(np.linalg.norm(effort - unit @ solution))
    values, doubts = [0.0] * len(columns), [np.inf] * len(columns)
    for k, column in enumerate(used):
        others = np.delete(unit, k, axis=1)
        beyond = unit[:, k] - others @ np.linalg.lstsq(others, unit[:, k], rcond=CONDITION)[0]
        alone = float(np.linalg.norm(beyond))
        if alone > 10 * CONDITION:
            values[column] = float(solution[k] / sizes[column])
            doubts[column] = residual / (alone * float(sizes[column]))
    return values, doubts, residual
