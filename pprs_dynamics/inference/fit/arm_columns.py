# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Regressor of an arm's efforts: inertia of links and rotors, friction, offsets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.reconstruction import (
    Reconstruction,
    reconstruct,
    treated_forces,
)
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.reversal import smooth_sign
from pprs_dynamics.physics.model.arm_model import ArmModel

# Numbers of a joint beside those of its link, in this order.
ARMATURE, VISCOUS, COULOMB, OFFSET = range(4)
OF_JOINT = 4


@dataclass(frozen=True)
class ArmColumns:
    """Efforts of one recording, treated, and what they are linear in.

    Parameters
    ----------
    measured : (M, n) array
        NaN where it was not measured.
    rest : (M, n) array
        The model's efforts without what the columns stand for: added effects.
    inertial : (M, n, 10 n) array
        Per inertial parameter of the links.
    motion : (M, n, 2) array
        Acceleration and velocity, for armature and viscous friction.
    reconstruction : Reconstruction
    """

    measured: Array
    rest: Array
    inertial: Array
    motion: Array
    reconstruction: Reconstruction

    @classmethod
    def of(cls, model: ArmModel, recording: Recording) -> ArmColumns:
        """Return the columns of a recording; errors as `reconstruct`."""
        found = reconstruct(model, recording)
        treat = found.treat
        total = treated_forces(model, found)['total']
        count = len(model.drives)
        inertial = np.empty((len(treat), count, model.robot.inertial.size))
        for chunk in found.chunks():
            s: Any = chunk.motion
            rows = model.robot.regressor(s.position, s.velocity, s.acceleration)
            inertial[chunk.blocks] = chunk.treat(rows)
        motion = np.stack((treat(found.acceleration), treat(found.velocity)), axis=-1)
        columns = cls(treat(found.effort), np.zeros_like(total), inertial, motion, found)
        own = columns.efforts(own_numbers(model), model.robot.inertial,
                              np.asarray(model.reversal.velocity))
        return cls(columns.measured, total - own, inertial, motion, found)

    def turning(self, width: Array) -> Array:
        """Return sgn of the velocities, treated, turning over within widths (n,), (M, n)."""
        found = self.reconstruction
        return found.treat(np.asarray(smooth_sign(found.velocity, width)))

    def of_joints(self, width: Array) -> Array:
        """Return the columns of each joint's own numbers, (M, n, 4)."""
        turning = self.turning(width)
        return np.concatenate((self.motion, turning[..., None],
                               np.ones_like(turning)[..., None]), axis=-1)

    def efforts(self, own: Array, inertial: Array, width: Array) -> Array:
        """Return the efforts of a model, (M, n).

        Parameters
        ----------
        own : (n, 4) array
            Armature, viscous and dry friction, and offset of each joint.
        inertial : (n, 10) array
        width : (n,) array
        """
        efforts: Array = (self.rest + self.inertial @ inertial.ravel()
                          + np.einsum('mjk,jk->mj', self.of_joints(width), own))
        return efforts


def own_numbers(model: ArmModel) -> Array:
    """Return armature, viscous and dry friction, and offset of each joint, (n, 4)."""
    values = model.values
    return np.column_stack([values[key] for key in (
        f'{model.block}.armature', 'friction.viscous', 'friction.coulomb', 'friction.offset')])


def columns_of(model: ArmModel, recordings: Sequence[Recording]) -> list[ArmColumns]:
    """Return the columns of recordings."""
    return [ArmColumns.of(model, recording) for recording in recordings]
