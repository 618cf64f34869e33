"""Viscous friction of a drive beyond the model's: c q_dot."""

from __future__ import annotations

from typing import ClassVar

from pprs_dynamics.effects.effect import DriveEffect, DriveSamples, Parameter
from pprs_dynamics.mechanism.robot import Array


class ViscousFriction(DriveEffect):
    """Force in proportion to velocity: lubricant, motor damping, a current loop's back-EMF."""

    name: ClassVar[str] = 'viscous_friction'
    linear = (Parameter('coefficient', 'c', 'N s/m', 'force per velocity', -1e6, 1e6),)

    def columns(self, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q_dot,)."""
        return (drive.velocity,)
