# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

r"""The base model of an arm from recordings of free motion, by the regression of a diagnosis.

Inertia of links and rotors, friction, offsets and the noise of every joint are fitted together. The
pseudo-inertia of a link is

.. math::

    P = R (1 + S) R^T, \qquad P_0 = R R^T,

with P_0 that of the description. S is Gaussian about 0, of a Frobenius norm of the order of 1: what
the motion does not excite stays as it was. 1 + S has no negative eigenvalue: the link is a body.

References
----------
P. M. Wensing, S. Kim, J.-J. E. Slotine, Linear matrix inequalities for physically consistent
inertial parameter identification, IEEE Robotics and Automation Letters 3 (2018).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import BaseColumn, rounded
from pprs_dynamics.inference.regression.constrained import Inequalities, nearest
from pprs_dynamics.inference.regression.design import LEAST_MOVING, TURNED
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.residuals.measuring import join_tables, treated_table
from pprs_dynamics.inference.residuals.reconstruction import Reconstruction, reconstruct
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.estimates import FittedNumber
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.joint_friction import JointFrictionEffect
from pprs_dynamics.physics.mechanism.description import (
    PARAMETERS,
    from_pseudo_inertia,
    pseudo_inertia,
)
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.state import smooth_sign
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.robot_block import inertial_values

LEAST_MASS = 1e-3  # [kg]; links without mass are given this, and
LEAST_RADIUS = 0.02  # [m] this radius: thin rods of a drawing have none across
# Of 1 + S: half as much is taken for enough, and rounded as in a file it is still not negative.
LEAST_EIGENVALUE = 1e-4
# Symmetric matrices of unit norm, in which S has independent coefficients of unit variance.
UNITS = np.array([(np.outer(a, b) + np.outer(b, a)) / (2.0 if j == k else np.sqrt(2.0))
                  for k, a in enumerate(np.eye(4)) for j, b in enumerate(np.eye(4)[:k + 1])])
# Numbers of a joint beside those of its link, in this order: all but dry friction are columns of
# every fit, and dry friction is one for each width in which it may reverse.
OWN = ('robot.armature', 'friction.viscous', 'friction.offset', 'friction.coulomb')
POSITIVE, DRY, OF_JOINT = (0, 1, 3), 3, len(OWN)
REVERSAL_VELOCITIES = 'friction.reversal_velocities'
WIDTHS = np.geomspace(0.1, 10.0, 13)  # times the model's width of reversal, tried
DETERMINED = 0.5  # of what was known before, that a determined number may still be uncertain by
ROUNDS = 3  # of widths and noise
STANDS = 0.05  # share of the samples in which a joint must move for its friction to be fitted


Fitted = tuple[DriveModel, tuple[FittedNumber, ...], tuple[str, ...]]
"""The fitted model, its numbers, and what the motion does not determine, as sentences."""


def fit_mechanism(model: DriveModel, recordings: Sequence[Recording]) -> Fitted:
    """Return the model fitted to recordings; its added effects are unchanged.

    Of the numbers those of each joint; infinite deviations where the motion does not determine
    them, and for widths of reversal.
    """
    found, residuals = reconstructed(model, recordings)
    moving = np.isfinite(residuals.measured).mean(axis=0) >= STANDS
    residuals = replace(residuals, measured=np.where(moving, residuals.measured, np.nan))
    numbers, count = base_numbers(model, found), len(model.drives)
    directions, links = base_prior(model, residuals.measured, numbers), model.robot.inertial.size
    places = np.arange(-OF_JOINT * count, 0).reshape(count, OF_JOINT)  # of joints' own numbers
    spread, own = np.diag(directions)[places], own_numbers(model)
    # Coefficients of 0: links as described, but with extent, and no dry friction.
    bodies = np.array([from_pseudo_inertia(root @ root.T) for root in _roots(model)])
    start = own * [1.0, 1.0, 1.0, 0.0]
    without = residuals.model - numbers[..., :links] @ (
        model.robot.inertial - bodies).ravel() - numbers[..., places.ravel()] @ (
            own - start).ravel()
    columns = numbers @ directions[:, [*range(links), *places[:, :DRY].ravel()]]
    regression = Regression(replace(residuals, model=without), [
        BaseColumn({d: column[:, d] for d in range(count) if np.any(column[:, d])}, 1.0)
        for column in np.moveaxis(columns, 2, 0)])

    def dry_friction(j: int, width: float) -> Block:
        return regression.block({j: spread[j, DRY] * turning(found, width)[:, j]}, np.eye(1),
                                own[j, DRY:] / spread[j, DRY])

    fit, width = _with_widths(regression, model.reversal.widths(count), dry_friction)
    places = np.column_stack((links + np.arange(DRY * count).reshape(count, DRY),
                              links + DRY * count + np.arange(count)))  # among the coefficients
    possible = nearest(fit.coefficients, fit.covariance, Inequalities(
        np.eye(len(fit.coefficients))[places[:, POSITIVE].ravel()],
        -(start / spread)[:, POSITIVE].ravel()), lambda c: beyond_bodies(c, links))
    assert possible is not None  # the description is
    c, std = possible.coefficients, spread * np.sqrt(np.diag(fit.covariance))[places]
    std[~moving] = np.inf
    fitted = _with(model, bodies + (directions[:links, :links] @ c[:links]).reshape(bodies.shape),
                   np.maximum(start + spread * c[places], [0.0, 0.0, -np.inf, 0.0]), width)
    return fitted, _numbers(model, fitted, dict(zip(OWN, std.T, strict=True))), _notes(
        model, fitted, possible.covariance[:links, :links], directions[:links:PARAMETERS, :links],
        ~moving)


def _with_widths(regression: Regression, width: Array,
                 dry_friction: Callable[[int, float], Block]) -> tuple[JointFit, Array]:
    """Return the fit with dry friction, and the width in which that of each drive reverses.

    Parameters
    ----------
    regression : Regression
        Of all other columns.
    width : (n,) array
        From which the search starts.
    dry_friction : callable
        Returns the column of a drive for a width.
    """
    width, speeds = width.copy(), np.abs(regression.residuals.variables['velocity'])
    blocks = [dry_friction(j, width[j]) for j in range(len(width))]
    fit = regression.fit(blocks)
    for _ in range(ROUNDS):
        fit = regression.at(blocks, _white(regression, fit))
        for j in regression.drives:
            # What reverses over all of the joint's speeds would be a curve through them.
            speed = speeds[regression.series[j].index, j]
            tried = {dry_friction(j, v): v for v in np.maximum(width[j] * WIDTHS, 1e-6)
                     if np.mean(speed > TURNED * v) >= LEAST_MOVING}
            cost = {block: regression.at([*blocks[:j], block, *blocks[j + 1:]], fit).deviance
                    for block in tried}
            blocks[j] = min(cost, key=cost.__getitem__, default=blocks[j])
            width[j] = tried.get(blocks[j], width[j])
    return regression.at(blocks, _white(regression, fit)), width


def _white(regression: Regression, fit: JointFit) -> Array:
    """Return amplitudes of white noise, by which a joint counts as its independent samples.

    What a model of a real machine lacks is slow. Weighted down, slow forces would be predicted
    worse: held-out errors of a UR10e rise by up to 5 %.
    """
    amplitudes = np.zeros_like(fit.amplitudes)
    for k, d in enumerate(regression.drives):
        error = regression.series[d].inverse(regression.remaining(fit, d))
        amplitudes[k, 0] = max(float(np.mean(error ** 2)), 1e-12) / independent_share(error)
    return amplitudes


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


def beyond_bodies(coefficients: Array, links: int) -> Inequalities:
    """Return tangent planes of possible bodies that coefficients violate, the first of links."""
    rows, bounds = [], []
    for first in range(0, links, PARAMETERS):
        place = slice(first, first + PARAMETERS)
        values, axes = np.linalg.eigh(np.eye(4) + np.tensordot(coefficients[place], UNITS, 1))
        for axis in axes.T[values < LEAST_EIGENVALUE / 2]:
            row = np.zeros(len(coefficients))
            row[place] = UNITS @ axis @ axis
            rows.append(row)
            bounds.append(LEAST_EIGENVALUE - 1.0)
    return Inequalities(np.reshape(rows, (-1, len(coefficients))), np.array(bounds))


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


def _notes(model: DriveModel, fitted: DriveModel, links: Array, masses: Array, still: Array,
           ) -> tuple[str, ...]:
    """Return notes on the parameters that the motion determines.

    Parameters
    ----------
    model, fitted : DriveModel
    links : (10 n, 10 n) array
        Covariance of the links' coefficients, 1 before the fit.
    masses : (n, 10 n) array
        Of the links by these coefficients.
    still : (n,) array
        Joints that hardly move.
    """
    before, after = (float(np.sum(robot.masses)) for robot in (model.robot, fitted.robot))
    determined = int(np.sum(np.linalg.eigvalsh(links) < DETERMINED ** 2))
    weak = np.einsum('kp,pq,kq->k', masses, links, masses) > (
        DETERMINED ** 2 * np.sum(masses ** 2, axis=1))
    notes = [f'the mass of all links together is {after:.3g} kg, and {before:.3g} kg in the '
             'description',
             f'the motion determines {determined} of the {len(links)} inertial parameters of the '
             'links, or combinations of them; the others stay near those of the description']
    if weak.any():
        notes.append('the motion does not determine the single masses of the links at '
                     f'{", ".join(np.array(model.robot.body_joints)[weak])}')
    if still.any():
        notes.append(f'friction stays as it was on joints that hardly move: '
                     f'{", ".join(np.array(model.drives)[still])}')
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


def own_numbers(model: DriveModel) -> Array:
    """Return armature, viscous friction, offset and dry friction of each joint, (n, 4)."""
    return np.column_stack([model.values[key] for key in OWN])


# Columns and their prior, which a reference run takes as well


def reconstructed(model: DriveModel, recordings: Sequence[Recording],
                  ) -> tuple[list[Reconstruction], Residuals]:
    """Return the motion of recordings, and measured and modelled efforts."""
    found = [reconstruct(model, recording) for recording in recordings]
    return found, join_tables(model, [treated_table(model, motion) for motion in found])


def base_numbers(model: DriveModel, found: Sequence[Reconstruction]) -> Array:
    """Return the columns of a base's numbers, (M, n, P): of links, passive joints, each drive."""
    count = len(model.drives)
    inertial = _treated(found, lambda s: model.robot.regressor(
        s.position, s.velocity, s.acceleration))
    turns = turning(found, model.reversal.widths(count))
    own = np.zeros((len(turns), count, count, OF_JOINT))
    every = np.arange(count)
    own[:, every, every] = np.stack((
        *(np.concatenate([part.treat(getattr(part, name)) for part in found])
          for name in ('acceleration', 'velocity')), np.ones_like(turns), turns), axis=2)
    return np.concatenate((inertial, _treated(found, lambda motion: of_passive(model, motion)),
                           own.reshape(len(turns), count, -1)), axis=2)


def turning(found: Sequence[Reconstruction], width: Array | float) -> Array:
    """Return sgn of the velocities, treated, reversing within widths (n,), (M, n)."""
    return np.concatenate([part.treat(np.asarray(smooth_sign(part.velocity, width)))
                           for part in found])


def _treated(found: Sequence[Reconstruction], columns: Callable[[Any], Array]) -> Array:
    """Return columns of motions, treated, (M, ...)."""
    return np.concatenate([chunk.treat(columns(chunk.motion))
                           for part in found for chunk in part.chunks()])


def of_passive(model: DriveModel, motion: JointMotion) -> Array:
    """Return the columns of viscous and dry friction of passive joints in loops, (N, n, K)."""
    if not model.robot.structure.loops:
        return np.zeros((len(motion), len(model.drives), 0))
    effect: Any = model.bound(JointFrictionEffect)
    state = model.mechanism(motion)
    columns = [effect.at({name: 1.0}).force(state)
               for names in effect.variants if len(names) > 1 for name in names]
    return np.stack([np.zeros((len(motion), len(model.drives))), *columns], axis=-1)[..., 1:]


def base_prior(model: DriveModel, efforts: Array, numbers: Array) -> Array:
    """Return directions of unit variance of a base's numbers, (P, P).

    Of what is expected before any recording, about the input model. Friction and offsets may be as
    large as all there is; passive joints may rub as much as the drive that would feel it first
    allows.

    Parameters
    ----------
    model : DriveModel
    efforts : (M, n) array
        NaN where they were not measured.
    numbers : (M, n, P) array
        Columns; see `base_numbers`.
    """
    known, links = np.isfinite(efforts), model.robot.inertial.size
    size = np.max(np.abs(efforts), axis=0, initial=0.0, where=known)
    scale = np.sqrt(np.einsum('mnk,mn->nk', numbers[..., links:] ** 2, known)
                    / np.maximum(known.sum(axis=0), 1)[:, None])
    spread = np.maximum(size, 1e-3)[:, None] / np.maximum(scale, 1e-6)
    directions = np.zeros((numbers.shape[2],) * 2)
    for k, root in enumerate(_roots(model)):
        place = slice(PARAMETERS * k, PARAMETERS * (k + 1))
        directions[place, place] = np.transpose([
            from_pseudo_inertia(root @ unit @ root.T) for unit in UNITS])
    rest = np.arange(links, len(directions))
    directions[rest, rest] = spread.min(axis=0)
    return directions


def _roots(model: DriveModel) -> list[Array]:
    """Return roots R of the links' pseudo-inertias, of bodies with mass and extent."""
    found = []
    for body in model.robot.inertial:
        P = pseudo_inertia(body)
        mass = max(float(P[3, 3]), LEAST_MASS)
        centre = P[:3, 3] / mass
        values, axes = np.linalg.eigh(P[:3, :3] - mass * np.outer(centre, centre))
        root = np.zeros((4, 4))
        root[:3, :3] = axes * np.sqrt(np.maximum(values, mass * LEAST_RADIUS ** 2))
        root[:, 3] = np.sqrt(mass) * np.append(centre, 1.0)
        found.append(root)
    return found
