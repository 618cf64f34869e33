# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model of a single axis: one prismatic drive on a test bench.

F = M (q_ddot - g) + F_v q_dot + F_c sgn(q_dot) + offset + effects, positive along the drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MISSING, ModelError
from pprs_dynamics.physics.effects.effect import SINGLE_AXIS
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.reversal import Reversal, smooth_sign
from pprs_dynamics.physics.model.effects_block import added_effects
from pprs_dynamics.physics.model.force_model import (
    RIGID_BODY,
    ForceModel,
    Forces,
    ModelState,
    total_force,
)
from pprs_dynamics.physics.model.keys import AXIS_KEYS, is_axis, is_mechanism
from pprs_dynamics.physics.model.parameter_file import find_file, read_parameters
from pprs_dynamics.physics.model.parameter_values import checked_values, source_of_errors
from pprs_dynamics.physics.three_pprs.robot import AXIS

# The motion of an axis is that of its only drive.
AxisMotion = JointMotion


@dataclass(frozen=True)
class AxisState(JointMotion):
    """A motion with the quantities that effects on drives take."""

    reversal: Reversal = field(default_factory=Reversal)

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return (AXIS,)

    @cached_property
    def direction(self) -> Array:
        """Sign of the velocity, sgn, turning over within the reversal velocity, (N, 1)."""
        direction: Array = smooth_sign(self.velocity, np.asarray(self.reversal.velocity))
        return direction

    @property
    def guide_load(self) -> Array:
        """Unknown, and constant: dry friction is a force here, not a coefficient; (N, 1) [N]."""
        return np.zeros_like(self.velocity)


@dataclass(frozen=True)
class AxisForces(Forces):
    """Forces of N samples, (N, 1)."""

    mechanism: AxisState


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
    drives: ClassVar[tuple[str, ...]] = (AXIS,)
    keys = AXIS_KEYS

    mass: float
    gravity: float = 0.0

    @classmethod
    def load(cls, path: str | PathLike[str] = 'config/single_axis.yaml') -> AxisModel:
        """Read a model file, as `DriveModel.load`.

        Raises
        ------
        UnreadableFileError
            Where the file does not exist or is not YAML.
        ModelError
            For a key that is unknown, missing, of the wrong type or impossible, and for a 3-PPRS.
        """
        file = find_file(path)
        return cls.from_parameters(read_parameters(file), source=str(file))

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any], source: str = '') -> AxisModel:
        """Build the model from flat keys and values, each checked; see `build_model`.

        Raises
        ------
        ModelError
            For a key that is unknown, missing, of the wrong type or impossible, and for those of
            a 3-PPRS.
        """
        with source_of_errors(source):
            if not is_axis(parameters) or is_mechanism(parameters):
                raise ModelError('axis.mass', MISSING, 'be given: this needs a single axis')
            values = checked_values(parameters)
            friction = AxisFriction(values['axis.viscous'], values['axis.coulomb'])
            effects = (friction, AxisOffset(values['axis.offset']),
                       *added_effects(parameters, cls, cls.drives))
            return cls(mass=values['axis.mass'], gravity=values['axis.gravity'], effects=effects,
                       reversal=Reversal(values['friction.reversal_velocity']), values=values,
                       source=source)

    def drive_forces(self, motion: AxisMotion, state: ModelState | None = None) -> AxisForces:
        """Return the forces that the drive must apply for a motion.

        Parameters
        ----------
        motion : AxisMotion
        state : ModelState, optional
            Carries effects with memory from call to call; see `DriveModel.drive_forces`.
        """
        mechanism: Any = AxisState(motion.position, motion.velocity, motion.acceleration,
                                   motion.time, self.reversal)
        state = self.initial_state() if state is None else state
        parts = {RIGID_BODY: self.mass * (mechanism.acceleration - self.gravity)}
        for effect in self.effects:
            effect.check_memory(state.memories)
            if not effect.is_measurement:
                parts[effect.name] = effect.force(mechanism, state.memories[effect.name])
        return AxisForces(total_force(tuple(parts.values())), parts, mechanism)

    def variables(self, state: AxisState) -> dict[str, Array]:
        """Return nothing: an axis has its own motion alone."""
        return {}
