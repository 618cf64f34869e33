# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Margins of a motion to the limits, for warnings before a refusal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.model.drive_model import DriveModel


@dataclass(frozen=True)
class Margins:
    """Smallest distances from the limits over all samples: 0 at the limit, at most 1.

    Parameters
    ----------
    singularity : float or None
        See `Robot.singularity_margin`.
    workspace : float
        Distance of a drive from an end of its stroke, over half the stroke.
    drive : str
        The drive nearest to an end of its stroke.
    """

    singularity: float | None
    workspace: float
    drive: str


def margins(model: DriveModel, mechanism: Any) -> Margins:
    """Return the margins of a motion that the model has accepted.

    Parameters
    ----------
    model : DriveModel
    mechanism : MechanismState
        What `model.drive_forces` returned with the forces.
    """
    lower, upper = model.limits.strokes
    position = mechanism.position
    with np.errstate(invalid='ignore'):  # no limit of a joint: infinity over infinity
        room: Array = np.minimum(position - lower, upper - position).min(axis=0) / (
            upper - lower) * 2
    room = np.where(np.isnan(room), 1.0, room)
    nearest = int(room.argmin())
    return Margins(model.robot.singularity_margin(mechanism), float(room[nearest]),
                   model.drives[nearest])
