# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A constant force on a drive, whatever it does: F_0."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter


class EffortOffset(DriveEffect):
    """Constant force: a counterbalance, a hanging cable, a biased amplifier.

    Equation
    --------
    F_0

    Symptom
    -------
    The same error at every position, speed and direction, at rest as well.

    Causes
    ------
    Zero of the force or current sensor, bias of the amplifier, a counterbalance or a hanging
    cable, a slide that is not level (then all drives show it: base_tilt).

    Confirmation
    ------------
    Read the effort with the drive uncoupled or the amplifier disabled: the remaining effort is
    the sensor's. Else hang the cable or counterbalance off and repeat.

    References
    ----------
    Khalil and Dombre, Modeling, Identification and Control of Robots, Hermes Penton, 2002, on
    the offset of motor currents.
    """

    name = 'effort_offset'
    may_be_measurement = True
    idealised = False
    linear = (Parameter('force', 'F_0', 'N', 'constant force', -1e6, 1e6, scale=0.5),)

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (1,)."""
        return (np.ones_like(drive.velocity),)
