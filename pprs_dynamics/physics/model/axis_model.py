# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model of a single axis: one prismatic drive on a test bench.

F = M (q_ddot - g) + F_v q_dot + F_c sgn(q_dot) + offset + effects, positive along the drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MISSING, ModelError
from pprs_dynamics.physics.effects.effect import SINGLE_AXIS
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.reversal import Reversal, smooth_sign
from pprs_dynamics.physics.model.effects_block import added_effects
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.keys import AXIS_KEYS, is_axis, is_mechanism
from pprs_dynamics.physics.model.parameter_values import checked_values, source_of_errors
from pprs_dynamics.physics.model.recorded_names import gravity_in_efforts
from pprs_dynamics.physics.three_pprs.robot import AXIS

# The motion of an axis is that of its only drive.
AxisMotion = JointMotion


@dataclass(frozen=True, kw_only=True)
class AxisState(JointMotion):
    """A motion with the quantities that effects on drives take.

    Parameters
    ----------
    position, velocity, acceleration, time
        See `JointMotion`.
    mass, gravity, reversal
        See `AxisModel`.
    """

    mass: float
    gravity: float
    reversal: Reversal

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return (AXIS,)

    @property
    def rigid_force(self) -> Array:
        """Force without friction [N], (N, 1)."""
        return self.mass * (self.acceleration - self.gravity)

    @cached_property
    def direction(self) -> Array:
        """Sign of the velocity, sgn, turning over within the reversal velocity, (N, 1)."""
        direction: Array = smooth_sign(self.velocity, np.asarray(self.reversal.velocity))
        return direction

    @property
    def guide_load(self) -> Array:
        """What gear or screw carry where weight acts along the axis, else 0, (N, 1) [N].

        Without weight what rubs is preload and the weight on the guide, constant and unknown.
        """
        return np.abs(self.transmitted) if self.gravity else np.zeros_like(self.velocity)

    @property
    def transmitted(self) -> Array:
        """Force that gear or screw pass on, without friction, (N, 1) [N]."""
        return self.rigid_force


@dataclass(frozen=True, kw_only=True)
class AxisModel(ForceModel):
    """The inverse dynamic model of one prismatic drive.

    Parameters
    ----------
    mass : float
        M, all that moves [kg].
    gravity : float
        g along the positive direction [m/s^2].
    effects, reversal, values, source
        See `ForceModel`; friction and offset are the first effects.
    """

    kind: ClassVar[str] = SINGLE_AXIS
    motions: ClassVar[tuple[type, ...]] = (JointMotion,)
    default_file: ClassVar[str] = 'config/single_axis.yaml'
    drives: ClassVar[tuple[str, ...]] = (AXIS,)
    keys = AXIS_KEYS

    mass: float
    gravity: float = 0.0

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any], source: str = '') -> AxisModel:
        """Build the model from flat keys and values; see `ForceModel.from_parameters`."""
        with source_of_errors(source):
            if not is_axis(parameters) or is_mechanism(parameters):
                raise ModelError('axis.mass', MISSING, 'be given: this needs a single axis')
            values = checked_values(parameters)
            friction = AxisFriction(values['axis.viscous'], values['axis.coulomb'])
            effects = (friction, AxisOffset(values['axis.offset']),
                       *added_effects(parameters, cls, cls.drives))
            return cls(mass=values['axis.mass'], gravity=gravity_in_efforts(values, 'axis.gravity'),
                       effects=effects,
                       reversal=Reversal(values['friction.reversal_velocity']), values=values,
                       source=source)

    def mechanism(self, motion: AxisMotion) -> AxisState:
        """Return what effects take of a motion; see `drive_forces`."""
        return AxisState(motion.position, motion.velocity, motion.acceleration, motion.time,
                         channels=motion.channels, mass=self.mass, gravity=self.gravity,
                         reversal=self.reversal)

    def variables(self, state: AxisState) -> dict[str, Array]:
        """Return nothing: an axis has its own motion alone."""
        return {}
