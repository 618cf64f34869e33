# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A dead band of the effort sensor: y = F - b (F > b), F + b (F < -b), 0 between.

A sensor effect of one's own, complete. It changes how all other effects show in the measured
effort, and says so (`nonlinear`); the diagnosis needs nothing more. The package's own
`effort_filter` is a sensor effect with a memory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from pprs_dynamics import Array, DriveRange, DriveSamples, MeasurementEffect, Parameter


class SensorDeadBand(MeasurementEffect):
    """A force sensor with play in its mount: small efforts do not reach it.

    Equation
    --------
    y = F - b (F > b), F + b (F < -b), 0 between

    Symptom
    -------
    The measured effort stands at 0 while it changes sign, and is too small elsewhere.

    Causes
    ------
    Play or friction in the mount of a force sensor.

    Confirmation
    ------------
    Hang growing weights on the sensor, and look from which on it says something.

    References
    ----------
    Fraden, Handbook of Modern Sensors, 2016.
    """

    name: ClassVar[str] = 'sensor_dead_band'
    idealised: ClassVar[bool] = False
    nonlinear: ClassVar[bool] = True
    # No linear parameter: the shape says it all.
    linear = ()
    shape = (Parameter('width', 'b', 'N', 'effort that does not reach the sensor', 1e-4, 1e4,
                       scale=0.5),)

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return widths from 0.05 to 20 N."""
        return [{'width': float(b)} for b in np.geomspace(0.05, 20.0, 12)]

    @classmethod
    def sense(cls, effort: Array, drive: DriveSamples, **parameters: float) -> Array:
        """Return the effort that the sensor shows, (N,)."""
        beyond = np.maximum(np.abs(effort) - parameters['width'], 0.0)
        return np.sign(effort) * beyond
