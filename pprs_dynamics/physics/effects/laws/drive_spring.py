# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A spring between a drive and the base: k (q - q_0).

It is linear in the stiffness k and the force at q = 0, -k q_0, so that is what is fitted.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter, Product

FARTHEST = 1000.0  # [m, rad], of the relaxed position: from there a spring is a constant force


class DriveSpring(DriveEffect):
    """Force in proportion to position: cable chain, counterbalance, bellows.

    Equation
    --------
    k (q - q_0)

    Symptom
    -------
    A straight line over position, the same on the way there and back, at any speed.

    Causes
    ------
    A cable chain or hose that is bent, a spring or gas counterbalance, a bellows. A negative k
    is a cable that hangs more the farther the drive goes.

    Confirmation
    ------------
    Stop the drive at some positions and read the effort (from both sides, for the friction).
    Uncouple the cable chain or counterbalance and repeat.

    References
    ----------
    Jubien and Gautier, Global identification of spring balancer, dynamic parameters and drive
    gains of heavy industrial robots, IROS, 2013.
    """

    name = 'drive_spring'
    linear = (
        Parameter('stiffness', 'k', 'N/m', 'force per position', -1e6, 1e6, scale=10.0),
        Parameter('position', 'q_0', 'm', 'position at which it is relaxed', -FARTHEST, FARTHEST,
                  scale=0.05, product=Product(
                      Parameter('force', '-k q_0', 'N', 'force at position 0', -1e9, 1e9,
                                scale=0.5), 'stiffness', sign=-1.0, farthest=FARTHEST)))

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q, 1)."""
        return (drive.position, np.ones_like(drive.position))
