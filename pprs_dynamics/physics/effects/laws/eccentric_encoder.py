# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""An encoder whose disc or ring is off its axis: it reads q + A sin(2 pi q / p + phi).

Once a turn of what it sits on: of the joint, or of the motor before its gear. Linear in
A cos(phi) and A sin(phi); velocities and accelerations have the wave's own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveRange, MeasurementEffect
from pprs_dynamics.physics.effects.effect import Parameter, Wave
from pprs_dynamics.physics.mechanism.state import MECHANISM

TURN = 2 * math.pi


class EccentricEncoder(MeasurementEffect):
    """Positions that are wrong by a wave once a turn of the encoder.

    Equation
    --------
    measured position = q + A sin(2 pi q / p + phi)

    Symptom
    -------
    A wave over the position, always at the same places, whose height grows with the square of
    the speed. The drive seems to hurry and to linger once in every turn of its encoder, and
    inertia is seen where nothing accelerates.

    Causes
    ------
    A disc or ring that is not centred on its shaft, a bent shaft, a coupling with an offset, a
    resolver whose channels differ.

    Confirmation
    ------------
    Turn at a steady low speed under the motor alone and compare with a second encoder or a
    polygon. The difference repeats once a turn. Two reading heads opposite to each other
    cancel it. A ripple of the force keeps its height at any speed.

    References
    ----------
    Lu and Trumper, Self-calibration of on-axis rotary encoders, CIRP Annals 56, 2007.
    """

    name = 'eccentric_encoder'
    # Of a joint that turns, or of a drive whose motor is known to turn so often.
    acts_in = frozenset({MECHANISM})
    idealised = False
    nonlinear = True
    is_of_position = True
    linear = (
        Parameter('amplitude', 'A', 'm', 'of the wave', 0.0, 0.1, scale=1e-4, turning=(0.0, 0.5)),
        Parameter('phase', 'phi', 'rad', 'phase at position 0', -TURN, TURN))
    shape = (Parameter('pitch', 'p', 'm', 'travel of the drive in a turn of the encoder', 1e-6,
                       10.0, scale=1e-3),)
    waves = (Wave('amplitude', 'phase'),)

    @classmethod
    def may_show(cls, covered: DriveRange) -> bool:
        """Return whether it is known after which travel an encoder has turned once."""
        return covered.turns or covered.gear_ratio > 1

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return the travels in a turn of the joint and in one of the motor."""
        turns = ([1.0] if covered.turns else []) + (
            [covered.gear_ratio] if covered.gear_ratio > 1 else [])
        return [{'pitch': TURN / ratio} for ratio in turns]

    def position_error(self, drives: Sequence[str], position: Array) -> Array:
        """Return how far encoders are ahead, (N, D) [m, rad]."""
        return self.by_drive(drives, position, lambda q, own: own['amplitude'] * np.sin(
            TURN * q / own['pitch'] + own['phase']))
