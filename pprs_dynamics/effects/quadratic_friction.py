"""Friction that grows with the square of velocity: c q_dot abs(q_dot)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pprs_dynamics.effects.effect import DriveEffect, DriveSamples, Parameter
from pprs_dynamics.mechanism.robot import Array


class QuadraticFriction(DriveEffect):
    """Force in proportion to velocity squared: churning lubricant, air in a closed housing."""

    name: ClassVar[str] = 'quadratic_friction'
    linear = (Parameter('coefficient', 'c', 'N s^2/m^2', 'force per squared velocity', -1e6, 1e6),)

    def columns(self, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q_dot abs(q_dot),)."""
        return (drive.velocity * np.abs(drive.velocity),)
