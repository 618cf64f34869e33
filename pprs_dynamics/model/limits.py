"""What the robot is allowed to do, checked for motions and for forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.errors import LimitError, WorkspaceError
from pprs_dynamics.mechanism.robot import DRIVES, Array


@dataclass(frozen=True)
class Limits:
    """Strokes, efforts and distances from singularities.

    Parameters
    ----------
    slide_stroke, lift_stroke : (lower, upper)
        Positions that the drives can take [m].
    effort : 6 floats
        Largest absolute force of each drive [N].
    condition_number : float
        Largest condition number of the drive Jacobian, rotations times r.
    rod_sine : float
        Smallest abs(sin u_i); 0 is a horizontal rod, where the inverse kinematics is singular.
    rod_cosine : float
        Smallest abs(cos u_i), for the approach of independent chains only.
    """

    slide_stroke: tuple[float, float]
    lift_stroke: tuple[float, float]
    effort: tuple[float, float, float, float, float, float]
    condition_number: float
    rod_sine: float
    rod_cosine: float

    def check_strokes(self, positions: Array) -> None:
        """Raise WorkspaceError for the first drive position, (N, 6), outside its stroke."""
        lower = np.repeat((self.slide_stroke[0], self.lift_stroke[0]), 3)
        upper = np.repeat((self.slide_stroke[1], self.lift_stroke[1]), 3)
        outside = ~((positions >= lower) & (positions <= upper))
        if np.any(outside):
            sample, drive = (int(i) for i in np.argwhere(outside)[0])
            stroke = 'slide_stroke' if drive < 3 else 'lift_stroke'
            raise WorkspaceError(
                sample, f'{DRIVES[drive]} would have to be at {positions[sample, drive]:.6g} m',
                f'limits.{stroke} is [{lower[drive]:g}, {upper[drive]:g}] m')

    def check_efforts(self, forces: Array) -> None:
        """Raise LimitError for the first force, (N, 6), over its limit."""
        over = ~(np.abs(forces) <= np.asarray(self.effort))
        if np.any(over):
            sample, drive = (int(i) for i in np.argwhere(over)[0])
            raise LimitError(sample, DRIVES[drive], float(forces[sample, drive]),
                             self.effort[drive])
