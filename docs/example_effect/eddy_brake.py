# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Eddy current brake on a drive: c q_dot / (1 + (q_dot / v_c)^2).

An effect of one's own, complete: this file, and one line in pyproject.toml. After `pip install .`
it may stand in model files, and `pprs diagnose` looks for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from pprs_dynamics import Array, DriveEffect, DriveRange, DriveSamples, Parameter


class EddyBrake(DriveEffect):
    """A magnet over a conducting rail: it brakes most at the critical velocity, less beyond.

    Equation
    --------
    c q_dot / (1 + (q_dot / v_c)^2)

    Symptom
    -------
    Grows with velocity, then falls again. Never a step at a reversal.

    Causes
    ------
    A magnet near a conducting part that moves.

    Confirmation
    ------------
    Take the magnet away and repeat.

    References
    ----------
    Wouterse, IEE Proceedings B 138, 1991.
    """

    name: ClassVar[str] = 'eddy_brake'
    # The force is linear in these: one column each ...
    linear = (Parameter('coefficient', 'c', 'N s/m', 'force per velocity near rest', 0.0, 1e6,
                        scale=1.0),)
    # ... and these shape the columns: they are searched for, starting from `trials`.
    shape = (Parameter('critical_velocity', 'v_c', 'm/s', 'velocity of the largest force', 1e-4,
                       100.0, scale=0.05),)

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q_dot / (1 + (q_dot / v_c)^2),)."""
        return (drive.velocity / (1 + (drive.velocity / shape['critical_velocity']) ** 2),)

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return critical velocities from a tenth of the top speed to twice it."""
        top = np.clip(covered.top_speed, 1e-3, 50.0)
        return [{'critical_velocity': float(v)} for v in np.geomspace(0.1 * top, 2 * top, 6)]
