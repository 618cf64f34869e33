# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effort that is measured late, or early: F(t - d)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveRange, DriveSamples, MeasurementEffect
from pprs_dynamics.physics.effects.effect import Parameter

# [s], always tried: filters and buses of drives delay by less. Longer delays (a logger of another
# topic) are tried within `AROUND` of that with which the efforts are most alike.
LONGEST, STEP, AROUND = 0.03, 0.002, 0.02
# Where the effort changes fast a delay of twice the true one fits worse than none.
SHORT = (STEP / 8, STEP / 4, STEP / 2)


class TimeDelay(MeasurementEffect):
    """The recorder's effort is not of the recorder's positions' time.

    Equation
    --------
    measured effort(t) = F(t - d)

    Symptom
    -------
    An error in proportion to how fast the effort changes: largest where the drive reverses or
    accelerates, with both signs, none while the effort is steady.

    Causes
    ------
    A filter on the effort or current signal, a bus cycle between position and effort, stamps
    taken on receipt instead of on measurement.

    Confirmation
    ------------
    Command a step of force against a stop and look which of effort and position moves first.
    Switch the effort filter off and repeat.

    References
    ----------
    Franklin, Powell, Workman, Digital Control of Dynamic Systems, 1998.
    """

    name = 'time_delay'
    late_by = 'delay'
    assumed_at_start = 'the effort changed before the first sample as after it'
    nonlinear = True
    idealised = False
    shows_at_reversals = True
    linear = ()
    shape = (Parameter('delay', 'd', 's', 'delay of the measured effort; negative: early', -1.0,
                       1.0, scale=0.001),)

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return delays from -30 to 30 ms in steps of 2 ms, shorter ones in fractions of it.

        And those around a longer one that the recording shows at once.
        """
        late = [*SHORT, *np.arange(STEP, LONGEST + 1e-9, STEP)]
        delays = {round(float(d), 9) for d in (*(-delay for delay in late), *late)}
        if abs(covered.delay) > LONGEST - AROUND:
            near = STEP * np.round(covered.delay / STEP) + np.arange(-AROUND, AROUND + 1e-9, STEP)
            delays |= {round(float(d), 9) for d in near} - {0.0}
        return [{'delay': d} for d in sorted(delays)]

    @classmethod
    def drive_memory(cls, start: float | None = None) -> Any:
        """Return the past: times and efforts that are not yet measured."""
        return {'time': np.zeros(0), 'effort': np.zeros(0)}

    @classmethod
    def sense(cls, effort: Array, drive: DriveSamples, **parameters: float) -> Array:
        """Return F(t - d) by straight lines between samples and beyond them."""
        time = drive.time
        if time is None:
            return effort
        memory = cls.drive_memory() if drive.memory is None else drive.memory
        before = len(memory['time'])
        t = np.concatenate((memory['time'], time))
        F = np.concatenate((memory['effort'], effort))
        kept = t >= t[-1] - 1.1 * max(parameters['delay'], 0.0) - 0.01
        memory['time'], memory['effort'] = t[kept], F[kept]
        return shifted(t, F, parameters['delay'])[before:]


def shifted(time: Array, values: Array, delay: float) -> Array:
    """Return values(t - delay), (N,); beyond the ends the first and the last slope go on."""
    wanted = time - delay
    result: Array = np.interp(wanted, time, values)
    if len(time) > 1:
        for end, inner, beyond in ((0, 1, wanted < time[0]), (-1, -2, wanted > time[-1])):
            slope = (values[end] - values[inner]) / (time[end] - time[inner])
            result[beyond] = values[end] + slope * (wanted[beyond] - time[end])
    return result
