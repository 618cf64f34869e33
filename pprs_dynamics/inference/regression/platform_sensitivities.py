# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How the forces of a 3-PPRS change with its numbers and with wrong zeros of its drives.

The geometry changes the motion of the platform, and so do zeros.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.sensitivities import Number, Sensitivities
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.three_pprs.active_friction import ActiveFriction
from pprs_dynamics.physics.three_pprs.forward_motion import platform_rates, solve_forward_motion
from pprs_dynamics.physics.three_pprs.state import MechanismState

HOMING_STEP = 3e-5  # of a rod's length
PER_DRIVE = ('friction.drives.viscous', 'friction.drives.coulomb')
PER_CHAIN = ('masses.slides', 'masses.lifts')


class PlatformSensitivities(Sensitivities):
    """Columns of a 3-PPRS.

    Parameters
    ----------
    model : DriveModel
    given : ForceModel
    """

    model: DriveModel

    def dry(self, state: MechanismState) -> Array:
        """Return the size of the drives' dry friction in full motion, (N, 6) [N]."""
        friction = next(e for e in self.model.effects if isinstance(e, ActiveFriction))
        return friction.dry(state.guide_load)

    def drives_of(self, number: Number) -> list[int] | None:
        """Return the drive that a coefficient is of, or the two of a mass's chain."""
        if number.element is None:
            return None
        return ([number.element] if number.key in PER_DRIVE else
                [number.element, number.element + 3] if number.key in PER_CHAIN else None)

    def _change(self, number: Number, forces: Any, reference: Array) -> Array:
        model: Any = self._moved[number]
        s = forces.mechanism
        if number.key.startswith('friction.'):
            friction: Array = self._efforts(model, s.turning_over(model.reversal)) - reference
            return friction
        if not number.key.startswith('geometry.'):
            return super()._change(number, forces, reference)
        found = solve_forward_motion(model.robot.geometry, s.position, s.velocity, s.acceleration,
                                     s.motion[:1])
        motion = found.motion if s.time is None else found.motion.with_time(s.time)
        change: Array = model.forces_at(model.mechanism(motion)).total - self.model.forces_at(
            self.model.mechanism(s.motion)).total
        return change

    def of_homing(self, state: MechanismState, reference: Array) -> Array:
        """Return the change per metre that each drive's position is too large, (6, N, 6) [N/m]."""
        from scipy.spatial.transform import Rotation

        every = np.arange(len(state.velocity))
        samples = every[min(self.homing_stride // 2, len(every) - 1)::self.homing_stride]
        motion, time = state.motion[samples], None if state.time is None else state.time[samples]
        velocity, acceleration = state.velocity[samples], state.acceleration[samples]
        geometry = self.model.robot.geometry
        step = HOMING_STEP * geometry.rod_length
        bare = replace(self.model, effects=tuple(
            effect for effect in self.model.effects if effect.initial_memory() is None))
        turned = Rotation.from_quat(motion.orientation)

        def forces(pose: PlatformMotion) -> Array:
            rates = platform_rates(geometry, pose, velocity, acceleration)
            rates = rates if time is None else rates.with_time(time)
            return bare.forces_at(bare.mechanism(rates)).total

        def column(drive: int) -> Array:
            move = -step * state.jacobians.J[samples][:, :, drive]
            pose = PlatformMotion.at_rest(
                motion.position + move[:, :3],
                (Rotation.from_rotvec(move[:, 3:]) * turned).as_quat())
            return np.stack([np.interp(every, samples, one)
                             for one in (forces(pose) - before).T / step], axis=1)

        before = forces(motion)
        return np.stack([column(drive) for drive in range(len(self.model.drives))])
