# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A low-pass filter on the effort signal: T dy/dt + y = F.

A sensor effect of one's own, complete. It changes how all other effects show in the measured
effort, and says so (`bends_columns`); the diagnosis needs nothing more.

References
----------
G. F. Franklin, J. D. Powell, M. Workman, Digital Control of Dynamic Systems, 3rd ed., 1998.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from scipy.signal import lfilter

from pprs_dynamics import Array, Card, DriveRange, MeasurementEffect, Parameter


class EffortFilter(MeasurementEffect):
    """The amplifier's current signal is smoothed before it is recorded."""

    name: ClassVar[str] = 'effort_filter'
    idealised: ClassVar[bool] = False
    bends_columns: ClassVar[bool] = True
    # No linear parameter: the shape says it all.
    linear = ()
    shape = (Parameter('time', 'T', 's', 'time constant of the filter', 1e-4, 1.0, scale=0.01),)
    card = Card(
        'T dy/dt + y = F, y measured',
        'steps of the effort at reversals come rounded and late, by an exponential',
        'a filter in the amplifier or in the recorder',
        'command a step of force against a stop, and look at its shape',
        'Franklin, Powell, Workman, Digital Control of Dynamic Systems, 1998')

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return time constants from 2 to 200 ms."""
        return [{'time': float(T)} for T in np.geomspace(0.002, 0.2, 12)]

    @classmethod
    def drive_memory(cls) -> Any:
        """Return the last effort and what the filter holds of the past, None before them."""
        return {'effort': None, 'held': 0.0}

    def sensed(self, effort: Array, time: Array | None, drives: Sequence[str],
               memory: Any = None) -> Array:
        """Return the filtered effort, (N, D): exact for straight lines between even samples."""
        if time is None or len(time) < 2:
            return effort
        step = float(np.median(np.diff(time)))
        filtered = effort.copy()
        for name, values in self.drives.items():
            index = list(drives).index(name)
            F = effort[:, index]
            past = self.drive_memory() if memory is None else memory[name]
            a = np.exp(-step / values['time'])
            share = (1 - a) * values['time'] / step
            b = np.array([1 - share, share - a])
            if past['effort'] is None:
                past['held'] = (1 - b[0]) * F[0]
            filtered[:, index], held = lfilter(b, [1.0, -a], F, zi=[past['held']])
            past.update(effort=float(F[-1]), held=float(held[0]))
        return filtered
