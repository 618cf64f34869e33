"""Presliding: a friction force that builds up over a distance after each reversal (Dahl).

With the drive moving by dq, the Dahl state z in [-1, 1] follows dz = (s - z) / x_d |dq|,
s = sgn(dq), whose solution over a step is exact: z+ = s + (z - s) exp(-|dq| / x_d).
The effect adds F (z - sgn q_dot): what presliding takes away from the Coulomb friction F that
the model already has.

References
----------
P. R. Dahl, A solid friction model, The Aerospace Corporation TOR-0158(3107-18)-1 (1968).
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.effects.effect import DriveEffect, DriveSamples, Parameter
from pprs_dynamics.mechanism.robot import Array


class Hysteresis(DriveEffect):
    """Elastic give of the contacts before they slide: preloaded ball guides, seals, belts."""

    name: ClassVar[str] = 'hysteresis'
    linear = (Parameter('force', 'F', 'N', 'friction force that builds up', -1e6, 1e6),)
    shape = (Parameter('distance', 'x_d', 'm', 'distance over which it builds up', 1e-7, 0.1),)

    def initial_memory(self) -> Any:
        """Return, per drive, the last position (None before the first) and the Dahl state."""
        return {drive: {'position': None, 'z': 0.0} for drive in self.drives}

    def columns(self, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (z - sgn q_dot,), and advance the memory to the last sample."""
        memory: dict[str, Any] = drive.memory or {'position': None, 'z': 0.0}
        first = drive.position[0] if memory['position'] is None else memory['position']
        moved = np.diff(drive.position, prepend=first)
        decay, side = np.exp(-np.abs(moved) / shape['distance']), np.sign(moved)
        z = np.empty_like(moved)
        last = memory['z']
        for sample in range(len(moved)):
            last = side[sample] + (last - side[sample]) * decay[sample]
            z[sample] = last
        memory['position'], memory['z'] = float(drive.position[-1]), float(last)
        return (z - drive.direction,)
