"""Dry friction of a drive that does not depend on its guide's load: F sgn(q_dot)."""

from __future__ import annotations

from typing import ClassVar

from pprs_dynamics.effects.effect import DriveEffect, DriveSamples, Parameter
from pprs_dynamics.mechanism.robot import Array


class CoulombFriction(DriveEffect):
    """Force of constant size against the motion: seals, preloaded nuts and bearings."""

    name: ClassVar[str] = 'coulomb_friction'
    linear = (Parameter('force', 'F', 'N', 'size of the friction force', -1e6, 1e6),)

    def columns(self, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (sgn q_dot,)."""
        return (drive.direction,)
