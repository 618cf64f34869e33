# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a designed motion may do: the model file's limits and the drives', with margins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
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

    def uses(self, model: DriveModel, forces: Forces, samples: int) -> Array:
        """Return how much of each limit, its margin taken off, motions use: 1 is all of it.

        Parameters
        ----------
        model : DriveModel
        forces : Forces
            Of M motions one after the other.
        samples : int
            Of each motion.

        Returns
        -------
        (M, L) array
            In the order of `limit_names`.
        """
        state, bounds, left = forces.mechanism, model.robot.bounds, 1 - self.margin
        limits, chains = model.limits, state.links.chains
        lower, upper = limits.strokes
        sine = bounds.rod_sine + self.margin * (1 - bounds.rod_sine)
        columns = [
            np.abs(2 * state.position - lower - upper) / ((upper - lower) * left),
            np.abs(state.velocity) / (self.velocity * left),
            np.abs(state.acceleration) / (self.acceleration * left),
            (np.abs(forces.total) + self.effort_reserve) / (limits.efforts * left),
            ((1 - np.abs(chains.sin_u)) / (1 - sine)),
            (state.motion.tilt / (self.tilt * left))[:, None],
            (condition_number(model.robot.geometry, state.links.jacobians.J)
             / (min(bounds.condition_number, self.condition_number) * left))[:, None]]
        if _needs_cosine(model):
            cosine = bounds.rod_cosine + self.margin * (1 - bounds.rod_cosine)
            columns.append((1 - np.abs(chains.cos_u)) / (1 - cosine))
        every = np.concatenate(columns, axis=1)
        largest: Array = every.reshape(-1, samples, every.shape[1]).max(axis=1)
        return largest


def limit_names(model: DriveModel) -> tuple[str, ...]:
    """Return the names of the limits of a 3-PPRS, in order."""
    names = [f'{what} of {drive}' for what in ('stroke', 'velocity', 'acceleration', 'effort')
             for drive in DRIVES]
    names += [f'rod angle of chain {chain}' for chain in (1, 2, 3)]
    names += ['tilt of the platform', 'condition number']
    if _needs_cosine(model):
        names += [f'cosine of rod angle {chain}' for chain in (1, 2, 3)]
    return tuple(names)


def _needs_cosine(model: DriveModel) -> bool:
    return any(isinstance(effect, IndependentChainsFriction) for effect in model.effects)
