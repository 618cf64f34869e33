# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How likely a reading is: the regression of efforts on a model's inertia, gravity and friction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.table import Reading
from pprs_dynamics.inference.residuals.excerpt import Excerpt
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
PRIORS = np.arange(9)  # places of coefficients, of which constants and weights have two signs


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
    balance : (D,) array
        Weights of the bodies on a drive, as the root of their sum of squares, over their sum.
    """

    roots: Array
    count: Array
    total: Array
    swing: Array
    size: Array
    speed: Array
    balance: Array

    @classmethod
    def of(cls, model: DriveModel, excerpt: Excerpt, reading: Reading) -> Evidence | None:
        """Return the evidence of a reading of an excerpt; None where its motion is impossible."""
        motion = read_motion(excerpt.motion, reading)
        position = motion.position
        try:
            forces = forces_of(model, replace(
                motion, position=position - model.position_error(position)), excerpt.time)
        except (PprsError, np.linalg.LinAlgError):
            return None
        followed = np.asarray(np.isfinite(forces).all(axis=0))
        if not np.any(followed):
            return None
        # A width of its own would be evidence for a unit of velocities.
        speed = np.sqrt(np.mean(motion.velocity ** 2, axis=0))
        direction = smooth_sign(motion.velocity, table.REVERSAL * speed + 1e-300)
        columns = np.stack([*forces, motion.velocity, direction, np.ones_like(position)], axis=2)
        force = forces.sum(axis=0)
        signs = np.sign(force) if reading.are_unsigned else np.ones_like(force)
        roots = np.array([_roots(columns[:, d], followed[:, d], signs[:, d, None] * excerpt.effort)
                          for d in range(position.shape[1])])
        samples, squares = (np.sum(roots[..., k] ** 2, axis=2) for k in (CONSTANT, EFFORT))
        swing = squares - np.sum(roots[..., CONSTANT] * roots[..., EFFORT], axis=2) ** 2 / (
            np.maximum(samples, 1))
        return cls(roots, samples, squares, np.maximum(swing, 0.0) + table.WEAK ** 2 * squares,
                   np.sqrt(np.nanmean(force ** 2, axis=0)), speed,
                   _balance(model, position[followed.all(axis=1)]))

    @cached_property
    def has_weight(self) -> bool:
        """Whether the model has any."""
        size = np.linalg.norm(self.roots[..., GRAVITY], axis=-1)
        rest = np.linalg.norm(self.roots[..., INERTIA], axis=-1)
        return bool(np.any(size > table.WEAK * rest))

    @property
    def unexplained(self) -> float:
        """Residual of a regression with any coefficients, over the squared effort."""
        total, swing, rest = (np.diag(sums) for sums in (
            self.total, self.swing, self.roots[..., EFFORT, EFFORT] ** 2))
        known = total > 0
        shares = np.maximum(rest, 1e-300)[known] / np.sqrt(swing * total)[known]
        return float(np.exp(np.mean(np.log(shares)))) if len(shares) else 1.0

    def moves(self, model: DriveModel) -> NDArray[np.bool_]:
        """Return which drives are faster than friction holds them, (D,) bool.

        A wide reversal may be that of cables or gears, which move within it.
        """
        return np.asarray(self.speed > np.minimum(model.reversal.velocity, table.RESTING))

    def is_measured(self, drive: int, column: int) -> bool:
        """Whether there are enough efforts for a regression."""
        return bool(round(self.count[drive, column]) >= EFFORT and self.total[drive, column] > 0)

    def most(self, drive: int, column: int) -> float:
        """Return a bound of the score and prior cost of efforts: with any coefficients [nats]."""
        rest, swing = self.roots[drive, column, EFFORT, EFFORT] ** 2, self.swing[drive, column]
        return max(-0.5 * table.SAMPLES * float(np.log(max(rest / swing, table.CLOSEST))),
                   -table.MASSES_MOST)

    def likelihood(self, drive: int, column: int, scale: float, masses: float,
                   contains: tuple[int, ...] = (1, 1, 1, 1, 1)) -> Likelihood:
        """Return the log-likelihood that efforts are `scale` times those of a drive.

        Inertia and gravity are the model's within a relative tolerance of its masses, friction
        opposes the motion with any size, and a constant is small in comparison. The weight of
        bodies that balance each other may be any, of either sign: each has its own error. The
        inertia of a model without weight is often a guess: any beyond a factor of 4 is as likely.
        """
        root = self.roots[drive, column]
        count, total, swing = (float(sums[drive, column]) / (1.0 if k == 0 else scale ** 2)
                               for k, sums in enumerate((self.count, self.total, self.swing)))
        lacks = np.array(contains[:2]) == 0
        known = root[:, :CONSTANT] * (1, 1, *contains[2:])
        matrix = np.column_stack([known, root[:, CONSTANT], -root[:, CONSTANT],
                                  known[:, GRAVITY], -known[:, GRAVITY]])
        # Coefficients in units of the model's forces: mean and standard deviation of each.
        mean = np.array([*contains[:2], *[0.0] * 7])
        constant = table.CONSTANT * np.sqrt(total / count)
        apart = max(table.SAME_BALANCE, masses * float(np.sqrt(self.balance[drive] ** 2 - 1)))
        rigid = root[:, :2]
        sizes = np.sqrt(np.sum(rigid ** 2, axis=0))
        moves = sizes > table.WEAK * np.sqrt(np.sum(sizes ** 2))
        of_rigid = np.where(lacks, table.LARGEST_COMPLIANCE, np.where(
            moves & (not self.has_weight), np.inf, masses))
        width = np.array([*of_rigid, *[np.inf] * 3, *[constant] * 2, *[apart] * 2])
        with_priors = np.vstack([matrix, np.zeros((len(width), len(width)))])
        target = np.concatenate([root[:, EFFORT] / scale, mean])
        size = len(root)
        variance = total / count
        for _ in range(3):
            weight = np.sqrt(variance * count / table.SAMPLES) / width
            with_priors[size + PRIORS, PRIORS] = weight
            target[size:] = weight * mean
            found, _ = nnls(with_priors, target)
            rest = target[:size] - matrix @ found
            before, variance = variance, max(float(rest @ rest), table.CLOSEST * swing) / count
            if variance == before:
                break
        misfit = 0.5 * ((found - mean) / width) ** 2
        # Masses are off by factors.
        factors = 0.5 * (np.log(np.maximum(found[:2], CONDITION)) / masses) ** 2
        misfit[:2] = np.where(lacks, misfit[:2], np.minimum(factors, table.MASSES_MOST) * moves)
        cost = float(np.sum(misfit))
        # Friction beyond some times the rigid body's forces is unlikely.
        friction, weight_of = (np.sqrt(force @ force) + 1e-300 for force in (
            matrix[:, OTHERS:CONSTANT] @ found[OTHERS:CONSTANT], rigid.sum(axis=1)))
        excess = float(np.log(friction / weight_of / table.FRICTION))
        cost += min(0.5 * max(excess, 0.0) ** 2, table.FRICTION_MOST)
        # A residual that is larger than the effort is no worse than one that is as large.
        fit, least = -0.5 * table.SAMPLES * float(np.log(variance * count / swing)), (
            -table.MASSES_MOST)
        score = max(fit - cost, least)
        return Likelihood(score, max(fit, least) - score,
                          variance * count / float(np.sqrt(swing * total)))

    def factor(self, drive: int, column: int, errors: float = table.CERTAIN) -> float:
        """Return the factor of inertia and gravity in efforts; NaN within some standard errors."""
        if not self.is_measured(drive, column):
            return np.nan
        root = self.roots[drive, column]
        rigid = root[:, INERTIA] + root[:, GRAVITY]
        others = root[:, [VELOCITY, DIRECTION, CONSTANT]]
        pair = np.column_stack([rigid, root[:, EFFORT]])
        beyond, effort = (pair - others @ np.linalg.lstsq(others, pair, rcond=CONDITION)[0]).T
        size = float(np.linalg.norm(beyond))
        if size <= 10 * CONDITION * np.linalg.norm(rigid):
            return np.nan
        factor = float(beyond @ effort) / size ** 2
        doubt = float(np.linalg.norm(effort - factor * beyond)) / size
        return factor if abs(factor) > errors * doubt else np.nan

    def factor_of_means(self, drive: int, column: int) -> float:
        """Return the mean effort over the mean of a weight that hardly varies; NaN of another."""
        root = self.roots[drive, column]
        rigid, one = root[:, INERTIA] + root[:, GRAVITY], root[:, CONSTANT]
        mean, size = float(one @ rigid), float(np.linalg.norm(one) * np.linalg.norm(rigid))
        return float(one @ root[:, EFFORT]) / mean if abs(mean) > table.NEARLY * size else np.nan


def _roots(columns: Array, followed: NDArray[np.bool_], efforts: Array) -> Array:
    """Return triangles of the QR decomposition of columns and each effort where both are known."""
    roots = np.zeros((efforts.shape[1], EFFORT + 1, EFFORT + 1))
    groups: dict[bytes, list[int]] = {}
    for k, known in enumerate((followed[:, None] & np.isfinite(efforts)).T):
        groups.setdefault(known.tobytes(), []).append(k)
    for pattern, places in groups.items():
        rows, alike = np.frombuffer(pattern, dtype=bool), np.array(places)
        matrix = np.column_stack([columns[rows], efforts[rows][:, alike]])
        size = matrix.shape[1]
        whole = np.asarray(np.linalg.qr(np.vstack([matrix, np.zeros((size, size))]), mode='r'))
        roots[alike, :EFFORT, :EFFORT] = whole[:EFFORT, :EFFORT]
        roots[alike, :EFFORT, EFFORT] = whole[:EFFORT, EFFORT:].T
        roots[alike, EFFORT, EFFORT] = np.linalg.norm(whole[EFFORT:, EFFORT:], axis=0)
    return roots


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


def mountings_in(model: DriveModel, excerpt: Excerpt, reading: Reading) -> Iterator[Reading]:
    """Yield the row of the table with the gravity that explains the efforts of a reading.

    Efforts, in any unit, are fitted with a free gravity vector, and each drive's inertia, friction
    and offset. Nothing where the direction is the model's, or explains the efforts of some drive
    not much better.
    """
    given = np.asarray(model.values[gravity_key(model)], dtype=float)
    size = float(np.linalg.norm(given))
    if size == 0:
        return
    motion = read_motion(excerpt.motion, reading)
    try:
        (_, nothing, _), *weights = (forces_of(in_reading(model, replace(
            reading, gravity=gravity)), motion, excerpt.time)
            for gravity in (np.zeros(3), *size * np.eye(3)))
    except (PprsError, np.linalg.LinAlgError):  # what the mechanism cannot follow
        return
    columns = np.stack([weight - nothing for _, weight, _ in weights], axis=2)
    v, a, inertia = motion.velocity, motion.acceleration, weights[0][0]
    own = np.stack((v, np.sign(v), a, np.ones_like(v), inertia), axis=2)
    parts = []
    for d, effort in enumerate(excerpt.effort[:, reading.efforts].T):
        at = np.isfinite(effort)
        y = np.column_stack((columns[at, d], effort[at]))
        # What the drive's inertia, friction and offset do not explain.
        rest = y - own[at, d] @ np.linalg.lstsq(own[at, d], y, rcond=None)[0]
        if np.any(rest[:, :3]) and np.any(rest[:, 3]):
            parts.append(rest / root_mean_square(rest[:, 3]))
    if not parts:
        return
    found = np.concatenate(parts)
    share = np.linalg.lstsq(found[:, :3], found[:, 3], rcond=1e-3)[0]
    along = found[:, :3] @ given
    same = given * max(float(along @ found[:, 3]), 0.0) / max(float(along @ along), 1e-300)
    is_explained = all(
        np.sum((part @ [*-share, 1]) ** 2) < table.MOST_LEFT * np.sum((part @ [*-same, 1]) ** 2)
        for part in parts)
    norm = float(np.linalg.norm(share))
    if not is_explained or _angle(share, given) < table.LEAST_TILT:
        return
    largest = np.argmax(np.abs(share))
    axis = np.sign(share[largest]) * np.eye(3)[largest]
    gravity = size * axis if _angle(share, axis) < table.ALONG else (size / norm * share).round(1)
    shown, known = (', '.join(f'{value + 0.0:g}' for value in vector)
                    for vector in (gravity, given))
    yield replace(
        Reading.plain(len(model.drives)), kind='mounting', gravity=gravity,
        drives=tuple(range(len(model.drives))), cost=table.COST['mounting'],
        what=f'gravity in the base is ({shown}) m/s² in this recording and ({known}) m/s² in the '
        'model: the robot is mounted in another direction')


def _angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors, (3,) [rad]."""
    sizes = max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300)
    return float(np.arccos(np.clip(a @ b / sizes, -1.0, 1.0)))


def fast_noise(recording: Recording, drive: int) -> float:
    """Return the standard deviation of changes that are faster than a motion.

    By the median of differences of samples 10 ms apart, so that reversals have no part in it; at
    least that of rounding.
    """
    step = max(1, round(table.NOISE_STEP / float(np.median(np.diff(recording.time)))))
    effort = recording.effort[:, drive]
    differences = np.abs(np.diff(effort[::step], table.NOISE_ORDER))
    differences = differences[np.isfinite(differences)]
    if not len(differences):
        return float('inf')
    # White noise has its differences multiplied by the root of the sum of squared binomials.
    gain = np.sqrt(comb(2 * table.NOISE_ORDER, table.NOISE_ORDER))
    counts = np.diff(np.unique(effort[np.isfinite(effort)]))
    return float(max(table.NORMAL * np.median(differences) / gain,
                     np.min(counts, initial=np.inf) / np.sqrt(12)))
