# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether gravity has another direction in recordings than in the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.evidence import (
    forces_of,
    gravity_key,
    in_reading,
    read_motion,
)
from pprs_dynamics.inference.readings.findings import NoMeasurement, gravity_line
from pprs_dynamics.inference.readings.table import Reading
from pprs_dynamics.inference.residuals.excerpt import Excerpt, excerpt_of
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.base_tilt import BaseTilt
from pprs_dynamics.physics.model.drive_model import DriveModel

MOUNTING = 'mounting'  # kind of the finding
ALONG = 0.1  # [rad] from an axis of the base, up to which gravity is along it
SAME_SIZE = 0.05  # relative error of gravity's size, up to which a vector is gravity
LEAST_TILT = BaseTilt.linear[0].upper  # [rad]; a smaller one is the effect base_tilt
MOST_LEFT = 0.25  # of the squared error of each drive with the model's direction


def other_mounting(model: DriveModel, recordings: Sequence[Recording]) -> dict[str, NoMeasurement]:
    """Return the finding that gravity has another direction than in the model, by drive."""
    plain = Reading.plain(len(model.drives))
    for recording in recordings:
        excerpt = excerpt_of(recording, table.STRETCHES)
        row = None if excerpt is None else mounting_in(model, excerpt, plain, SAME_SIZE)
        if row is not None and row.gravity is not None:
            finding = NoMeasurement.of(MOUNTING, model.drives, row.drives, row.what,
                                       gravity_line(model, row.gravity))
            return dict.fromkeys(model.drives, finding)
    return {}


def mounting_in(model: DriveModel, excerpt: Excerpt, reading: Reading, same_size: float = np.inf,
                ) -> Reading | None:
    """Return the row of the table with the gravity that explains the efforts of a reading.

    Efforts, in any unit, are fitted with a free gravity vector, and each drive's inertia, friction
    and offset. None where the direction is the model's, explains the efforts of some drive not
    much better, or the size is off by more than a relative error.
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
        np.sum((target - G @ share) ** 2) < MOST_LEFT * np.sum((target - G @ same) ** 2)
        for G, target in zip(rows, targets, strict=True))
    norm = float(np.linalg.norm(share))
    if not is_explained or abs(norm - 1) > same_size or _angle(share, given) < LEAST_TILT:
        return None
    largest = np.argmax(np.abs(share))
    axis = np.sign(share[largest]) * np.eye(3)[largest]
    gravity = size * axis if _angle(share, axis) < ALONG else (size / norm * share).round(1)
    found, known = (', '.join(f'{value + 0.0:g}' for value in vector)
                    for vector in (gravity, given))
    return replace(
        Reading.plain(len(model.drives)), kind=MOUNTING, gravity=gravity,
        drives=tuple(range(len(model.drives))), cost=table.COST[MOUNTING],
        what=f'gravity in the base is ({found}) m/s² in this recording and ({known}) m/s² in the '
        'model: the robot is mounted in another direction')


def _angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors, (3,) [rad]."""
    sizes = max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300)
    return float(np.arccos(np.clip(a @ b / sizes, -1.0, 1.0)))
