# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Margins of a motion to the limits, for warnings before a refusal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.tree_equations import WORST_CONDITION
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.mechanism_model import MechanismModel
from pprs_dynamics.physics.three_pprs.jacobians import condition_number
from pprs_dynamics.physics.three_pprs.passive_friction import IndependentChainsFriction
from pprs_dynamics.physics.three_pprs.state import ThreePprsState

# Of a long trajectory that many samples are looked at for their condition number, evenly spread:
# neighbours hardly differ, and a singular value decomposition each would cost more than the model.
MOST_CONDITIONS = 64


@dataclass(frozen=True)
class Margins:
    """Smallest distances from the limits over all samples: 0 at the limit, at most 1.

    Parameters
    ----------
    singularity : float or None
        1 minus the largest of: condition number over its limit, of the 3-PPRS smallest sine of a
        rod angle over that of the rods, and, with independent chains, the ratio for the cosine.
        None without loops: what moves joints comes near none.
    workspace : float
        Distance of a drive from an end of its stroke, over half the stroke.
    drive : str
        The drive nearest to an end of its stroke.
    """

    singularity: float | None
    workspace: float
    drive: str


def margins(model: DriveModel | MechanismModel, mechanism: Any) -> Margins:
    """Return the margins of a motion that the model has accepted.

    Parameters
    ----------
    model : DriveModel or MechanismModel
    mechanism : ThreePprsState or MechanismState
        What `model.drive_forces` returned with the forces.
    """
    lower, upper = model.limits.strokes
    position = mechanism.position
    with np.errstate(invalid='ignore'):  # no limit of a joint: infinity over infinity
        room: Array = np.minimum(position - lower, upper - position).min(axis=0) / (
            upper - lower) * 2
    room = np.where(np.isnan(room), 1.0, room)
    nearest = int(room.argmin())
    singularity = None
    if isinstance(model, DriveModel):
        singularity = _singularity(model, mechanism)
    elif model.robot.structure.loops:
        singularity = float(1 - mechanism.links.condition.max() / WORST_CONDITION)
    return Margins(singularity, float(room[nearest]), model.drives[nearest])


def _singularity(model: DriveModel, mechanism: ThreePprsState) -> float:
    limits = model.limits
    J = mechanism.jacobians.J
    step = -(-len(J) // MOST_CONDITIONS)
    number = condition_number(model.robot.geometry, J[::step])
    used = [number.max() / limits.condition_number,
            limits.rod_sine / np.abs(mechanism.chains.sin_u).min()]
    if any(isinstance(effect, IndependentChainsFriction) for effect in model.effects):
        used.append(limits.rod_cosine / np.abs(mechanism.chains.cos_u).min())
    return float(1 - max(used))
