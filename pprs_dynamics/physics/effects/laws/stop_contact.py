# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A stop that a drive runs against: k (q - q_s) beyond q_s, nothing before it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.laws.drive_spring import FARTHEST

# Where stops are tried, in strokes from either end. Over more of the stroke than the last it is a
# spring that comes loose, which a spring with lack of fit explains as well.
REACHES = (0.03, 0.07, 0.13, 0.22)


class StopContact(DriveEffect):
    """One-sided stiffness from a position on: a bumper, a stop, a cable that gets taut.

    Equation
    --------
    k_u (q - q_s) for q > q_s, k_l (q - q_s) for q < q_s

    Symptom
    -------
    Nothing over most of the stroke, and beyond one position near an end a force that grows
    with every millimetre, on the way there and back, at any speed: at each visit a peak.

    Causes
    ------
    A bumper, a bellows or telescopic cover that is pressed together, a soft limit set beyond
    the stop, a cable or hose that gets taut, a foreign body in the guide.

    Confirmation
    ------------
    Creep towards that end with the effort on a plot and stop where it begins to rise: look
    what touches there. Take off bumper or cable and repeat.

    References
    ----------
    Hunt and Crossley, Coefficient of restitution interpreted as damping in vibroimpact, ASME
    J. Applied Mechanics 42, 1975.
    """

    name = 'stop_contact'
    linear = (Parameter('upper', 'k_u', 'N/m', 'stiffness above q_s', -1e9, 1e9, 0.0, scale=100.0),
              Parameter('lower', 'k_l', 'N/m', 'stiffness below q_s', -1e9, 1e9, 0.0, scale=100.0))
    shape = (Parameter('position', 'q_s', 'm', 'position at which it is touched', -FARTHEST,
                       FARTHEST, scale=0.01),)
    variants = (('upper',), ('lower',))
    is_positive = True
    is_smooth = True

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return how far the drive is above q_s, and below it with its sign."""
        beyond = drive.position - shape['position']
        return np.maximum(beyond, 0.0), np.minimum(beyond, 0.0)

    @classmethod
    def may_show(cls, covered: DriveRange) -> bool:
        """Return whether the drive moves."""
        return covered.stroke > 0

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return positions near either end of the stroke."""
        half = float(np.clip(covered.stroke, 1e-6, FARTHEST)) / 2
        return [{'position': float(covered.middle + side * (1 - 2 * reach) * half)}
                for side in (-1, 1) for reach in REACHES]
