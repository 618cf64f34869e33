# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A drive whose zero is off: its encoder says q + z where the drive stands at q."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.mechanism.state import MECHANISM, PLATFORM


class HomingError(MeasurementEffect):
    """Error of the zero of a drive's positions.

    Equation
    --------
    measured position = q + z

    Symptom
    -------
    A slowly changing error of this drive and of others that depends on the pose: the weight
    pulls in another direction than in the model. On a parallel robot it is largest where the
    rods lean most.

    Causes
    ------
    A homing switch that moved, a lost encoder count, an index pulse one turn away, a drive
    mounted a little aside, a joint put together one tooth aside, zeros of another robot.

    Confirmation
    ------------
    Home the drive again and repeat. Move to the zero marks and check the zero with a gauge
    block or a level.

    References
    ----------
    Merlet, Parallel Robots, 2006.
    """

    name = 'homing_error'
    # No force of an axis depends on its zero.
    acts_in = frozenset({PLATFORM, MECHANISM})
    idealised = False
    nonlinear = True
    is_of_position = True
    # A homing switch or a mark is good for a millimetre or a degree; a joint that was put together
    # or counted wrongly may be off by any angle.
    linear = (Parameter('zero', 'z', 'm', 'error of the measured positions', -0.1, 0.1,
                        scale=0.001, expected=(0.001, math.radians(1.0)),
                        turning=(-math.pi, math.pi)),)

    def position_error(self, drives: Sequence[str], position: Array) -> Array:
        """Return z of each drive, the same at every sample, (N, D) [m, rad]."""
        return self.by_drive(drives, position, lambda q, own: np.full_like(q, own['zero']))
