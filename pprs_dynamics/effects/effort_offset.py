"""A constant force on a drive, whatever it does."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pprs_dynamics.effects.effect import DriveEffect, DriveSamples, Parameter
from pprs_dynamics.mechanism.robot import Array


class EffortOffset(DriveEffect):
    """Constant force: a counterbalance, a hanging cable, a biased amplifier."""

    name: ClassVar[str] = 'effort_offset'
    linear = (Parameter('force', 'F_0', 'N', 'constant force', -1e6, 1e6),)

    def columns(self, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (1,)."""
        return (np.ones_like(drive.velocity),)
