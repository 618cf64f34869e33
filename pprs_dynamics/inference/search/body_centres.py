# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Centres of added bodies, about which their columns contain their inertia.

The inertia of a body about a joint grows with the square of its distance, which no column that is
linear in its mass and first moment says. Columns are taken about the centre of the point mass that
explains the error best, and moved with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.terms import Term
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.structure_effect import AXES, MOMENTS, PRODUCTS, AddedBody

if TYPE_CHECKING:
    from pprs_dynamics.physics.mechanism.mechanism import Mechanism
    from pprs_dynamics.physics.model.drive_model import DriveModel

REACH = 4.0  # of the mechanism's size, the mean distance of its joints: what hangs on it is within
# Centres that are tried: first within the reach, then around the best within this share of it,
# until they are within 1e-4 of it. Columns move with the body afterwards.
GRID = np.stack(np.meshgrid(*[np.linspace(-1, 1, 7)] * 3), axis=-1).reshape(-1, 3)
NARROWER, ROUNDS = 0.6, 18
PULL = 1e-3  # of the error, by which a body at that reach is pulled to its place


def has_centre(effect: type[CatalogueEffect], names: tuple[str, ...]) -> bool:
    """Return whether coefficients are of a body with a first moment."""
    return issubclass(effect, AddedBody) and len(names) > 1


def about_centre(term: Term, mass: str, centre: tuple[float, ...]) -> Term:
    """Return the term with columns for a body at a centre; `mass` names its mass."""
    assert issubclass(term.effect, AddedBody)
    kind, prefix, away = term.effect, mass.removesuffix('mass'), np.array(centre)
    return replace(term, rows={
        d: kind.rows_about(prefix, rows, away) for d, rows in term.rows.items()})


def centre_of(effect: type[CatalogueEffect], names: tuple[str, ...], c: Array,
              model: DriveModel) -> tuple[float, ...]:
    """Return where a body of these coefficients is, within the reach."""
    size = reach_of(model.robot)
    known = dict(zip(names, c.tolist(), strict=True))
    prefix = names[0].removesuffix('mass')
    mass = known[names[0]]
    away = np.array([known[f'{prefix}moment_{axis}'] for axis in AXES])
    return tuple(np.clip(away / mass if mass else 0 * away, -size, size).tolist())


def find_centre(term: Term, mass: str, error: Array, scale: Mapping[int, float],
                model: DriveModel) -> tuple[float, ...]:
    """Return the centre of the point mass that explains an error best, from its place [m].

    Parameters
    ----------
    term : Term
        Of an `AddedBody`.
    mass : str
        Coefficient of its mass at the place.
    error : (M, D) array
    scale : mapping of drive to float
        Of each drive's error.
    model : DriveModel
    """
    size = reach_of(model.robot)
    prefix = mass.removesuffix('mass')
    at = [term.names.index(prefix + name) for name in (
        'mass', *(f'moment_{axis}' for axis in AXES), *MOMENTS, *PRODUCTS)]
    stacked = np.concatenate([np.vstack((term.rows[d][at], error[:, d]))[:, known] / max(std, 1e-12)
                              for d, std in scale.items() if d in term.rows
                              for known in [np.isfinite(error[:, d])]], axis=1)
    reduced: Array = np.asarray(np.linalg.qr(stacked.T, mode='r'), dtype=float)
    weight = PULL * float(np.linalg.norm(reduced[:, -1]))

    R, y = reduced[:, :-1], reduced[:, -1]
    place, span = np.zeros(3), size
    for _ in range(ROUNDS):
        tried = np.clip(place + span * GRID, -size, size)
        forces = R @ _point_masses(tried)
        gains = (y @ forces) ** 2 / np.maximum(np.sum(forces ** 2, axis=0), 1e-300) - (
            weight / size) ** 2 * np.sum(tried ** 2, axis=1)
        place, span = tried[int(np.argmax(gains))], NARROWER * span
    return tuple(place.tolist())


def _point_masses(places: Array) -> Array:
    """Return mass, first moments and inertia of 1 kg at places (n, 3), (10, n).

    In the order of `MOMENTS` and `PRODUCTS`.
    """
    x, y, z = places.T
    return np.stack((np.ones(len(places)), x, y, z, y * y + z * z, x * x + z * z, x * x + y * y,
                     -x * y, -x * z, -y * z))


def reach_of(robot: Mechanism) -> float:
    """Return how far from its place a body may be [m].

    By the mean distance of the joints, or where that is less, as of an arm with a single joint,
    by the mean distance of what it moves from the joints that move it.
    """
    mass = float(np.abs(robot.inertial[:, 0]).sum())
    first = float(np.linalg.norm(robot.inertial[:, 1:4], axis=1).sum())
    return REACH * max(robot.structure.size, first / mass if mass > 0 else 0.0)
