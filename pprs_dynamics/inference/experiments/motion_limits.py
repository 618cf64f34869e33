# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a designed motion may do: the limits of the model file and of the user, with margins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.three_pprs.independent_chains import IndependentChainsFriction
from pprs_dynamics.physics.three_pprs.robot import condition_number

REACH = np.repeat((0.08, 0.25), 3)  # [m, rad], excursions of the platform to start from
WIDEST = np.pi  # [rad, m], excursion of a joint, whatever its range


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

    def middle(self, model: DriveModel) -> Array:
        """Return the coordinates about which the platform moves: the middle of its strokes."""
        geometry = model.robot.geometry
        lean = (geometry.base_radius - geometry.platform_radius * float(np.mean(np.cos(
            np.subtract(geometry.platform_angles, geometry.chain_angles))))) / geometry.rod_length
        rise = geometry.rod_length * float(np.sqrt(max(1 - lean ** 2, 0.0)))
        middle = float(sum(end[-1] for end in model.limits.strokes)) / 2
        height = middle + geometry.elbow_sign * rise
        return np.array((0.0, 0.0, height, 0.0, 0.0, 0.0))

    def excursions(self, model: DriveModel, position: Array, velocity: Array,
                   acceleration: Array) -> Array:
        """Return the largest excursion of each coordinate over what it starts from."""
        found: Array = np.abs(position - self.middle(model)).max(axis=0) / REACH
        return found

    def uses(self, model: DriveModel, forces: Any) -> dict[str, float]:
        """Return how much of each limit, its margin taken off, a motion uses: 1 is all of it."""
        state, bounds, left = forces.mechanism, model.robot.bounds, 1 - self.margin
        limits, chains = model.limits, state.links
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
    """Limits of a motion in addition to those of the URDF. Collisions of links are not checked.

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

    def middle(self, model: DriveModel) -> Array:
        """Return the positions about which the joints move."""
        middle: Array = model.robot.structure.room(WIDEST)[0]
        return middle

    def efforts(self, model: DriveModel) -> Array:
        """Return the largest efforts, (D,)."""
        left: Array = (1 - self.margin) * model.robot.structure.effort - self.effort_reserve
        return np.maximum(left, 1e-12)

    def excursions(self, model: DriveModel, position: Array, velocity: Array,
                   acceleration: Array) -> Array:
        """Return the largest use of range, speed and acceleration of each joint."""
        found: Array = np.max([*self._motion_uses(
            model, position, velocity, acceleration).values()], axis=0)
        return found

    def uses(self, model: DriveModel, forces: Any) -> dict[str, float]:
        """Return how much of each limit, its margin taken off, a motion uses: 1 is all of it."""
        state = forces.mechanism
        shares = {**self._motion_uses(model, state.position, state.velocity, state.acceleration),
                  'effort': np.abs(forces.total).max(axis=0) / self.efforts(model)}
        return {name: float(share.max()) for name, share in shares.items()}

    def _motion_uses(self, model: DriveModel, position: Array, velocity: Array,
                     acceleration: Array) -> dict[str, Array]:
        tree, left = model.robot.structure, 1 - self.margin
        middle, reach = tree.room(WIDEST)
        return {name: np.abs(values).max(axis=0) / (left * bound) for name, values, bound in (
            ('range', position - middle, np.maximum(reach, 1e-12)),
            ('speed', velocity, np.minimum(tree.speed, self.velocity)),
            ('acceleration', acceleration, self.acceleration))}
