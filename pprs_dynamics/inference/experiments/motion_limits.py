# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a designed motion may do: the model file's limits and the drives', with margins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces
from pprs_dynamics.physics.three_pprs.jacobians import condition_number
from pprs_dynamics.physics.three_pprs.passive_friction import IndependentChainsFriction


@dataclass(frozen=True)
class MotionLimits:
    """Limits of a motion in addition to those of the model file.

    Parameters
    ----------
    velocity, acceleration : float
        Of every drive [m/s, m/s^2].
    tilt : float
        Of the platform against the horizontal [rad].
    condition_number : float
        Of the drive Jacobian. Towards a singularity small errors of the model grow large, and a
        few moments there would carry all the evidence.
    margin : float
        Share of every limit that is left unused, 0 to 0.9.
    effort_reserve : float
        Taken off the efforts for what the model does not know of [N].
    """

    velocity: float = 0.5
    acceleration: float = 5.0
    tilt: float = 0.35
    condition_number: float = 8.0
    margin: float = 0.1
    effort_reserve: float = 0.0

    def __post_init__(self) -> None:
        for name in ('velocity', 'acceleration', 'tilt', 'condition_number'):
            if not getattr(self, name) > 0:
                raise ModelError(name, getattr(self, name), 'be greater than 0')
        if not 0 <= self.margin <= 0.9:
            raise ModelError('margin', self.margin, 'lie between 0 and 0.9')

    def uses(self, model: DriveModel, forces: Forces) -> dict[str, float]:
        """Return how much of each limit, its margin taken off, a motion uses: 1 is all of it."""
        state, bounds, left = forces.mechanism, model.robot.bounds, 1 - self.margin
        limits, chains = model.limits, state.links.chains
        lower, upper = limits.strokes
        sine = bounds.rod_sine + self.margin * (1 - bounds.rod_sine)
        shares = {
            'stroke': np.abs(2 * state.position - lower - upper) / ((upper - lower) * left),
            'velocity': np.abs(state.velocity) / (self.velocity * left),
            'acceleration': np.abs(state.acceleration) / (self.acceleration * left),
            'effort': (np.abs(forces.total) + self.effort_reserve) / (limits.efforts * left)}
        found = {f'{name} of {drive}': share[:, d] for name, share in shares.items()
                 for d, drive in enumerate(DRIVES)}
        angles = {'rod angle of chain': (1 - np.abs(chains.sin_u)) / (1 - sine)}
        if any(isinstance(effect, IndependentChainsFriction) for effect in model.effects):
            cosine = bounds.rod_cosine + self.margin * (1 - bounds.rod_cosine)
            angles['cosine of rod angle'] = (1 - np.abs(chains.cos_u)) / (1 - cosine)
        found |= {f'{name} {k + 1}': share[:, k] for name, share in angles.items()
                  for k in range(3)}
        found['tilt of the platform'] = state.motion.tilt / (self.tilt * left)
        found['condition number'] = condition_number(
            model.robot.geometry, state.links.J) / (
                min(bounds.condition_number, self.condition_number) * left)
        return {name: float(share.max()) for name, share in found.items()}


@dataclass(frozen=True)
class ArmLimits:
    """Limits of a motion in addition to those of the URDF.

    Parameters
    ----------
    velocity, acceleration : float
        Of every joint [rad/s, rad/s^2, or m/s, m/s^2].
    margin : float
        Share of every limit that stays unused.
    effort_reserve : float
        Taken off the efforts for what the model does not know of [N m, N].
    """

    velocity: float = np.inf
    acceleration: float = 5.0
    margin: float = 0.1
    effort_reserve: float = 0.0
