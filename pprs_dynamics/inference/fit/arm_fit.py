# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The base model of an arm from recordings of free motion.

Inertia of links and rotors, friction and offsets are fitted together, each joint weighted by its
error and by how many independent samples that error is worth. Links are held to what bodies can
be, and weakly to their description: what the motion does not excite stays as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import rounded
from pprs_dynamics.inference.regression.design import LEAST_MOVING, TURNED
from pprs_dynamics.inference.residuals.reconstruction import (
    Reconstruction,
    reconstruct,
    treated_forces,
)
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.joint_friction import JointFrictionEffect
from pprs_dynamics.physics.mechanism.description import (
    PARAMETERS,
    from_pseudo_inertia,
    pseudo_inertia,
)
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.reversal import smooth_sign
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.robot_block import inertial_values

LEAST_MASS = 1e-3  # [kg]; links without mass are given this, and
LEAST_RADIUS = 0.02  # [m] this radius: thin rods of a drawing have none across
ROWS, COLUMNS = np.tril_indices(4)
# Numbers of a joint beside those of its link, in this order.
ARMATURE, OFFSET = 0, 3
OWN = ('robot.armature', 'friction.viscous', 'friction.coulomb', 'friction.offset')
OF_JOINT = len(OWN)
REVERSAL_VELOCITIES = 'friction.reversal_velocities'
# A link's pseudo-inertia is known to as much as itself: drawings often have bodies as points or
# rods, yet not of ten times the mass.
SPREAD = 1.0
# Standard deviations of what nothing is known of, in units of the joint's largest effort over the
# size of its column: friction and offsets may be as large as all there is.
OWN_SPREAD = 1.0
WIDTHS = np.geomspace(0.1, 10.0, 13)  # times the model's width of reversal, tried
ROUNDS = 3  # of weights and widths
DETERMINED = 0.5  # of what was known before, that a determined number may still be uncertain by
STANDS = 0.05  # share of the samples in which a joint must move for its friction to be fitted


class Bodies:
    """Links as points of a flat space, n times 10 numbers, 0 for the description.

    Parameters
    ----------
    described : (n, 10) array
        Inertial parameters of the description; see `Mechanism`.
    """

    def __init__(self, described: Array) -> None:
        self.roots = np.stack([np.linalg.cholesky(_thick(pseudo_inertia(body)))
                               for body in described])

    def __len__(self) -> int:
        return PARAMETERS * len(self.roots)

    def inertial(self, point: Array) -> Array:
        """Return the inertial parameters (n, 10) at a point (10 n,)."""
        P = self.roots @ self._relative(point) @ self.roots.transpose(0, 2, 1)
        return np.array([from_pseudo_inertia(body) for body in P])

    def distance(self, point: Array) -> Array:
        """Return the distance from the description, element by element, (16 n,)."""
        return (self._relative(point) - np.eye(4)).ravel()

    def _relative(self, point: Array) -> Array:
        M = np.tile(np.eye(4), (len(self.roots), 1, 1))
        M[:, ROWS, COLUMNS] += point.reshape(-1, PARAMETERS)
        return M @ M.transpose(0, 2, 1)


def _thick(P: Array) -> Array:
    """Return a pseudo-inertia of a body with mass and extent."""
    mass = max(float(P[3, 3]), LEAST_MASS)
    centre = P[:3, 3] / mass
    about = P[:3, :3] - mass * np.outer(centre, centre)
    values, axes = np.linalg.eigh((about + about.T) / 2)
    values = np.maximum(values, mass * LEAST_RADIUS ** 2)
    thick = np.empty((4, 4))
    thick[:3, :3] = axes @ np.diag(values) @ axes.T + mass * np.outer(centre, centre)
    thick[:3, 3] = thick[3, :3] = mass * centre
    thick[3, 3] = mass
    return thick


@dataclass(frozen=True)
class ArmColumns:
    """Efforts of one recording, treated, and what they are linear in.

    Parameters
    ----------
    measured : (M, n) array
        NaN where it was not measured.
    rest : (M, n) array
        The model's efforts by added effects, which no column describes.
    inertial : (M, n, 10 n) array
        Per inertial parameter of the links.
    motion : (M, n, 2) array
        Acceleration and velocity, for armature and viscous friction.
    reconstruction : Reconstruction
    """

    measured: Array
    rest: Array
    inertial: Array
    motion: Array
    reconstruction: Reconstruction

    @classmethod
    def of_motion(cls, model: DriveModel, found: Reconstruction) -> ArmColumns:
        """Return the columns of a recording whose motion is known."""
        treat = found.treat
        inertial = _treated(found, lambda s: model.robot.regressor(
            s.position, s.velocity, s.acceleration))
        motion = np.stack((treat(found.acceleration), treat(found.velocity)), axis=-1)
        total = treated_forces(model, found)['total']
        columns = cls(treat(found.effort), total, inertial, motion, found)
        return replace(columns, rest=total - inertial @ model.robot.inertial.ravel() - np.einsum(
            'mjk,jk->mj', columns.of_joints(np.asarray(model.reversal.velocity)),
            own_numbers(model)))

    def turning(self, width: Array) -> Array:
        """Return sgn of the velocities, treated, turning over within widths (n,), (M, n)."""
        found = self.reconstruction
        return found.treat(np.asarray(smooth_sign(found.velocity, width)))

    def of_joints(self, width: Array) -> Array:
        """Return the columns of each joint's own numbers, (M, n, 4)."""
        turning = self.turning(width)
        return np.concatenate((self.motion, turning[..., None],
                               np.ones_like(turning)[..., None]), axis=-1)

    def numbers(self, model: DriveModel) -> Array:
        """Return the columns of all numbers, (M, n, P): of links, passive joints, each drive."""
        passive = _treated(self.reconstruction, lambda motion: of_passive(model, motion))
        numbers: Array = np.concatenate((self.inertial, passive, _of_each(self.of_joints(
            model.reversal.widths(len(model.drives))))), axis=2)
        return numbers


def _treated(found: Reconstruction, columns: Callable[[Any], Array]) -> Array:
    """Return columns of a motion, treated, (M, ...)."""
    return np.concatenate([chunk.treat(columns(chunk.motion)) for chunk in found.chunks()])


def own_numbers(model: DriveModel) -> Array:
    """Return armature, viscous and dry friction, and offset of each joint, (n, 4)."""
    return np.column_stack([model.values[key] for key in OWN])


@dataclass(frozen=True)
class FittedNumber:
    """A number of the model, before and after, with its standard deviation."""

    key: str
    drive: str
    before: float
    after: float
    std: float
    unit: str


Fitted = tuple[DriveModel, tuple[FittedNumber, ...], tuple[str, ...]]
"""The fitted model, its numbers, and what the motion does not determine, as sentences."""


def fit_arm(model: DriveModel, recordings: Sequence[Recording]) -> Fitted:
    """Return the model fitted to recordings; its added effects are unchanged.

    Of the numbers those of each joint; infinite deviations where the motion does not determine
    them, and for widths of reversal.
    """
    count = len(model.drives)
    columns = [ArmColumns.of_motion(model, reconstruct(model, recording))
               for recording in recordings]
    bodies = Bodies(model.robot.inertial)
    known = np.isfinite(np.concatenate([part.measured for part in columns]))
    inertial = np.concatenate([part.inertial for part in columns])
    rest = np.concatenate([part.measured - part.rest for part in columns])
    width = model.reversal.widths(count).copy()
    start = own_numbers(model)
    own, point = start.copy(), np.zeros(len(bodies))
    moving = known.mean(axis=0) >= STANDS
    for number in range(ROUNDS + 1):
        if number > 0:
            width = _widths(columns, rest - inertial @ bodies.inertial(point).ravel(), known, own,
                            width, moving)
        joints = np.concatenate([part.of_joints(width) for part in columns])
        point, own, spread = _solved(bodies, inertial, joints, np.where(
            known & moving, rest, np.nan), start, point, own)
    links = len(bodies)
    std = np.sqrt(np.diag(spread)[links:]).reshape(count, OF_JOINT).T
    std[:, ~moving] = np.inf
    fitted = _with(model, bodies.inertial(point), own, width)
    return fitted, _numbers(model, fitted, dict(zip(OWN, std, strict=True))), _notes(
        model, fitted, spread[:links, :links] / SPREAD ** 2, ~moving)


def _numbers(model: DriveModel, fitted: DriveModel, std: Mapping[str, Array],
             ) -> tuple[FittedNumber, ...]:
    """Return the fitted numbers of each joint; `std`: their standard deviations, by key."""
    found = []
    for key in (*OWN, REVERSAL_VELOCITIES):
        units = [unit.strip() for unit in model.keys[key].unit.split(',')]
        for k, drive in enumerate(model.drives):
            before = model.values[key][k]
            if key == REVERSAL_VELOCITIES:
                before = before or model.values['friction.reversal_velocity']
            found.append(FittedNumber(
                key, drive, float(before), float(fitted.values[key][k]),
                float(std[key][k]) if key in std else np.inf,
                units[0] if model.units[k].turns else units[-1]))
    return tuple(found)


def _notes(model: DriveModel, fitted: DriveModel, links: Array, still: Array) -> tuple[str, ...]:
    """Return what the motion determines.

    Parameters
    ----------
    model, fitted : DriveModel
    links : (10 n, 10 n) array
        Covariance of the links' inertial parameters over that before the fit.
    still : (n,) array
        Joints that hardly move.
    """
    before, after = (float(np.sum(robot.masses)) for robot in (model.robot, fitted.robot))
    determined = int(np.sum(np.linalg.eigvalsh(links) < DETERMINED ** 2))
    weak = np.sqrt(np.diag(links)[9::PARAMETERS]) > DETERMINED
    notes = [f'all links together have {after:.4g} kg, {before:.4g} kg in the description',
             f'the motion determines {determined} combinations of the {len(links)} inertial '
             'parameters of the links; all others stay near those of the URDF']
    if weak.any():
        notes.append('it does not determine the masses of the links that '
                     f'{", ".join(np.array(model.robot.body_joints)[weak])} move one by one')
    if still.any():
        notes.append(f'{", ".join(np.array(model.drives)[still])} hardly moves: its friction stays '
                     'as it was')
    if model.efforts_in_amperes:
        notes.append('efforts are currents times robot.gain: a gain that is wrong by 1 % makes all '
                     'numbers wrong by 1 %')
    return tuple(notes)


def _with(model: DriveModel, inertial: Array, own: Array, width: Array) -> DriveModel:
    """Return the model with fitted numbers, rounded as files have them."""
    found = {**inertial_values(inertial), **dict(zip(OWN, own.T, strict=True)),
             REVERSAL_VELOCITIES: width}
    return DriveModel.from_parameters({**model.values, **{
        key: tuple(rounded(float(value)) for value in np.array(numbers))
        for key, numbers in found.items()}}, model.source)


def of_passive(model: DriveModel, motion: JointMotion) -> Array:
    """Return the columns of viscous and dry friction of passive joints in loops, (N, n, K)."""
    if not model.robot.structure.loops:
        return np.zeros((len(motion), len(model.drives), 0))
    effect: Any = model.bound(JointFrictionEffect)
    state = model.mechanism(motion)
    columns = [effect.at({name: 1.0}).force(state)
               for names in effect.variants if len(names) > 1 for name in names]
    return np.stack([np.zeros((len(motion), len(model.drives))), *columns], axis=-1)[..., 1:]


def _of_each(joints: Array) -> Array:
    """Return columns of each joint, (M, n, 4), as columns of all joints, (M, n, 4 n)."""
    samples, count = joints.shape[:2]
    own = np.zeros((samples, count, count, OF_JOINT))
    own[:, np.arange(count), np.arange(count)] = joints
    return own.reshape(samples, count, -1)


def own_spread(efforts: Array, columns: Array) -> Array:
    """Return by how much numbers may be otherwise for each joint, (n, k), standard deviations.

    Parameters
    ----------
    efforts : (M, n) array
        NaN where they were not measured.
    columns : (M, n, k) array
    """
    known = np.isfinite(efforts)
    size = np.max(np.abs(efforts), axis=0, initial=0.0, where=known)
    scale = np.sqrt(np.sum(columns ** 2 * known[..., None], axis=0)
                    / np.maximum(known.sum(axis=0), 1)[:, None])
    spread: Array = OWN_SPREAD * np.maximum(size, 1e-3)[:, None] / np.maximum(scale, 1e-6)
    return spread


def base_prior(model: DriveModel, efforts: Array, numbers: Array) -> Array:
    """Return directions of unit variance of a base's numbers, (P, P).

    Of what is expected before any recording, about the input model. Passive joints may rub as
    much as the drive that would feel it first allows.

    Parameters
    ----------
    model : DriveModel
    efforts : (M, n) array
        NaN where they were not measured.
    numbers : (M, n, P) array
        Columns; see `ArmColumns.numbers`.
    """
    count = len(model.drives)
    of_links, of_drives = model.robot.inertial.size, numbers.shape[2] - OF_JOINT * count
    drives = numbers[..., of_drives:].reshape(len(numbers), count, count, OF_JOINT)
    every = np.arange(count)
    spread = np.concatenate((
        own_spread(efforts, numbers[..., of_links:of_drives]).min(axis=0),
        own_spread(efforts, drives[:, every, every]).ravel()))
    bodies = Bodies(model.robot.inertial)
    at, step = np.zeros(len(bodies)), 1e-6
    moves, away = (np.column_stack([(of(at + step * unit) - of(at)).ravel() / step
                                    for unit in np.eye(len(at))])
                   for of in (bodies.inertial, bodies.distance))
    values, axes = np.linalg.eigh(away.T @ away / SPREAD ** 2)
    links = moves @ (axes / np.sqrt(values))
    directions = np.zeros((len(links) + len(spread),) * 2)
    directions[:len(links), :len(links)] = links
    directions[len(links):, len(links):] = np.diag(spread)
    return directions


def _solved(bodies: Bodies, inertial: Array, joints: Array, rest: Array, start: Array,
            point: Array, own: Array) -> tuple[Array, Array, Array]:
    """Return the best point of `Bodies` and own numbers, and the covariance of both.

    Each joint is weighted by one over the variance of its error, by independent samples. Armature
    and friction are not negative.

    Parameters
    ----------
    bodies : Bodies
    inertial : (M, n, 10 n) array
    joints : (M, n, 4) array
    rest : (M, n) array
        Measured efforts without added effects; NaN where they do not count.
    start : (n, 4) array
        What own numbers are pulled to, as weakly as can be.
    point, own : (10 n,) and (n, 4) arrays
        To start from.
    """
    from scipy.optimize import least_squares  # here: commands start without it

    error = rest - inertial @ bodies.inertial(point).ravel() - np.einsum(
        'mjk,jk->mj', joints, own)
    # All that depends on the samples, once: weighted R and Q' y of each joint.
    reduced, links, spread = [], len(bodies), own_spread(rest, joints).ravel()
    for j, at in enumerate(np.isfinite(rest).T):
        if not at.any():
            continue
        rows = np.zeros((int(at.sum()), links + own.size + 1))
        rows[:, :links], rows[:, -1] = inertial[at, j], rest[at, j]
        rows[:, links + j * OF_JOINT:links + (j + 1) * OF_JOINT] = joints[at, j]
        weight = independent_share(error[at, j]) / max(float(np.mean(error[at, j] ** 2)), 1e-12)
        reduced.append(np.sqrt(weight) * np.linalg.qr(rows, mode='r'))
    weighted = np.concatenate(reduced)

    def residuals(unknown: Array) -> Array:
        numbers = np.concatenate((bodies.inertial(unknown[:links]).ravel(), unknown[links:], [-1]))
        return np.concatenate((weighted @ numbers, bodies.distance(unknown[:links]) / SPREAD,
                               (unknown[links:] - start.ravel()) / spread))

    lowest = np.zeros(own.shape)
    lowest[:, OFFSET] = -np.inf
    # Dogbox puts a number that would be negative at 0, the other methods only near it.
    found = least_squares(
        residuals, np.concatenate((point, np.maximum(own, lowest).ravel())),
        bounds=(np.concatenate((np.full(links, -np.inf), lowest.ravel())), np.inf),
        method='dogbox', x_scale='jac', max_nfev=60)
    J: Array = np.asarray(found.jac)
    covariance: Array = np.asarray(np.linalg.inv(J.T @ J), dtype=float)
    return found.x[:links], found.x[links:].reshape(own.shape), covariance


def independent_share(error: Array) -> float:
    """Return how many independent samples one of a correlated error is worth, 0 to 1.

    By the lag at which the autocorrelation is first below 1/e.
    """
    centred = error - error.mean()
    spectrum = np.abs(np.fft.rfft(centred, 2 * len(centred))) ** 2
    correlation = np.fft.irfft(spectrum)[:len(centred)]
    if not correlation[0] > 0:
        return 1.0
    below = np.flatnonzero(correlation < correlation[0] / np.e)
    return 1 / (1 + 2 * float(below[0] if len(below) else len(centred)))


def _widths(columns: Sequence[ArmColumns], rest: Array, known: Array, own: Array, width: Array,
            moving: Array) -> Array:
    """Return the width of reversal of each joint with which its friction fits best.

    Friction is not negative, and turns over well below the joint's speeds: what does not would be
    a curve through all of them.
    """
    from scipy.optimize import lsq_linear  # here: commands start without it

    tried = [np.clip(width * factor, 1e-6, None) for factor in WIDTHS]
    turning = [np.concatenate([part.turning(widths) for part in columns]) for widths in tried]
    found = width.copy()
    motion = np.concatenate([part.motion for part in columns])
    for j in np.flatnonzero(moving):
        at = known[:, j]
        y = rest[at, j] - motion[at, j, 0] * own[j, ARMATURE]
        speed = motion[at, j, 1]
        least = np.inf
        for each, direction in zip(tried, turning, strict=True):
            if np.mean(np.abs(speed) > TURNED * each[j]) < LEAST_MOVING:
                continue
            rows = np.column_stack((speed, direction[at, j], np.ones(at.sum())))
            left = lsq_linear(rows, y, ([0.0, 0.0, -np.inf], np.inf)).cost
            if left < least:
                least, found[j] = left, each[j]
    return found
