# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Links and joints of a mechanism whose bodies and friction no motion of the drives can separate.

Links that turn alike, as those of a parallelogram, may move any body in the same way: the columns
of their inertial parameters then span the same space. A passive joint whose rate is always the
same multiple of another's rubs as that one does.

References
----------
M. Gautier, W. Khalil, Direct calculation of minimum set of inertial parameters of serial robots,
IEEE Transactions on Robotics and Automation 6 (1990).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.mechanism.description import PARAMETERS
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.mechanism.structure import Structure

SAMPLES = 40  # random states: several times as many rows as a body has parameters
WIDEST = 1.0  # [rad, m] that a drive moves from home at most
HALVINGS = 6  # of that, until all states are within reach
KEPT = 16  # of mechanisms: a model is built many times with other numbers
SAME = 1e-7  # of a column's size that may lie outside the other's space: rounding


@lru_cache(KEPT)
def alike_bodies(structure: Structure, bodies: tuple[int, ...],
                 gravity: tuple[float, float, float]) -> tuple[tuple[int, ...], ...]:
    """Return groups of bodies, by number, on which an added body does the same."""
    count = len(bodies)
    if count < 2:
        return tuple((k,) for k in range(count))
    columns = _moving(structure).regressor(np.array(bodies), np.array(gravity)).reshape(
        -1, count, PARAMETERS)
    spaces = [_space(columns[:, k]) for k in range(count)]
    return _groups(len(spaces), lambda i, j: spaces[i].shape == spaces[j].shape and bool(
        np.abs(spaces[j] - spaces[i] @ (spaces[i].T @ spaces[j])).max(initial=0.0) < SAME))


@lru_cache(KEPT)
def proportional_joints(structure: Structure) -> tuple[tuple[str, ...], ...]:
    """Return groups of joints whose rates are in the same proportion whatever the drives do."""
    names = tuple(structure.rows)
    at = [int(structure.tables.coordinate[structure.rows[name]]) for name in names]
    rates = _moving(structure).motion.drive_to_joint
    rows = rates[:, at].transpose(1, 0, 2).reshape(len(names), -1)
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    unit = rows / np.where(size > 0, size, 1.0)
    return tuple(tuple(names[k] for k in group) for group in _groups(
        len(names), lambda i, j: bool(abs(abs(unit[i] @ unit[j]) - 1.0) < SAME)))


def _moving(structure: Structure) -> LinkMotion:
    """Return the links at random states of the drives about home, or amid their ranges."""
    rng = np.random.default_rng(0)
    middle, reach = structure.room(WIDEST)
    position, velocity, acceleration = rng.uniform(-1, 1, (3, SAMPLES, len(middle)))
    for halving in range(HALVINGS):
        with suppress(PprsError):
            return LinkMotion.of(structure, middle + 0.5 ** (1 + halving) * reach * position,
                                 velocity, acceleration)
    return LinkMotion.of(structure, np.tile(middle, (SAMPLES, 1)), velocity, acceleration)


def _space(columns: Array) -> Array:
    """Return an orthonormal basis of what columns of very different size span."""
    size = np.linalg.norm(columns, axis=0)
    felt = size > SAME * size.max(initial=0.0)
    scaled = columns[:, felt] / size[felt]
    if not scaled.size:
        return np.zeros((len(columns), 0))
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    return u[:, s > SAME * s[0]]


def _groups(count: int, is_same: Callable[[int, int], bool]) -> tuple[tuple[int, ...], ...]:
    """Return numbers in groups of the same as the first of each."""
    groups: list[list[int]] = []
    for k in range(count):
        for group in groups:
            if is_same(group[0], k):
                group.append(k)
                break
        else:
            groups.append([k])
    return tuple(map(tuple, groups))
