# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Efforts of an arm at one sample, as a control loop asks for them: little beside Pinocchio's.

Friction is added in place by a compiled loop: every call of NumPy would cost as much as a third of
the rigid body.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.urdf import pinocchio
from pprs_dynamics.physics.model.arm_model import ArmModel


class ArmSample:
    """Returns the efforts (n,) at one position, velocity and acceleration, (n,) each.

    Parameters
    ----------
    model : ArmModel
        Effects with memory begin anew at every call; `ArmModel.drive_forces` carries them on.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model = model
        arm, count = model.arm, len(model.drives)
        self._order = arm.tree.order
        self._in_order = bool(np.all(self._order == np.arange(count)))
        self._is_plain = all(isinstance(effect, (AxisFriction, AxisOffset))
                             for effect in model.effects)
        values = model.values
        self._friction = np.ascontiguousarray(np.array([
            values['friction.viscous'], values['friction.coulomb'], values['friction.offset'],
            np.broadcast_to(model.reversal.velocity, count)]))
        self._rigid = arm.model
        self._data = self._rigid.createData()
        self._rnea = pinocchio().rnea
        self._add = _friction_loop()

    def __call__(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Return what the joints need [N m, N]."""
        if not (self._is_plain and self._in_order):
            return self._by_model(position, velocity, acceleration)
        efforts: Array = self._rnea(self._rigid, self._data, position, velocity, acceleration)
        self._add(efforts, velocity, self._friction)
        return efforts

    def _by_model(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        motion = JointMotion(position[None], velocity[None], acceleration[None], np.zeros(1))
        efforts: Array = self.model.drive_forces(motion).total[0]
        return efforts


def _add_friction(efforts: Any, velocity: Any, friction: Any) -> None:
    for j in range(len(efforts)):
        v = velocity[j]
        efforts[j] += (friction[0, j] * v + friction[1, j] * np.tanh(v / friction[3, j])
                       + friction[2, j])


def _add_friction_by_numpy(efforts: Array, velocity: Array, friction: Array) -> None:
    viscous, coulomb, offset, width = friction
    efforts += viscous * velocity + coulomb * np.tanh(velocity / width) + offset


@cache
def _friction_loop() -> Callable[[Array, Array, Array], None]:
    """Return what adds friction and offset to efforts, compiled where Numba is installed."""
    try:
        import numba
    except ImportError:
        return _add_friction_by_numpy
    try:
        compiled: Callable[[Array, Array, Array], None] = numba.njit(
            cache=True, error_model='numpy')(_add_friction)
    except RuntimeError:  # nowhere to keep what was compiled
        return _add_friction_by_numpy
    return compiled
