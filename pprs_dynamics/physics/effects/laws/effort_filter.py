# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effort behind a low-pass filter: (T/2 d/dt + 1)^2 y = F.

The form is two equal lags in series. Filters of amplifiers and recorders are of first order (an
RC), of second order (Butterworth, Bessel) or means over some samples. At 20 Hz the residual of this
form is an eighth of the change that each of them makes. The residual of a single lag is a quarter
for a Butterworth filter and a third for a pure delay. T is the filter's mean delay, whatever its
order. Every fit allows for another order: to the second order in T d/dt a Butterworth filter is as
far from two lags as these are from one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveRange, DriveSamples, MeasurementEffect
from pprs_dynamics.physics.effects.effect import Parameter

LAGS = 2
# [s], tried: from cut-offs of 160 Hz to one of 1.6 Hz, beyond which no motion of a robot is left.
SHORTEST, LONGEST, TRIALS = 0.002, 0.2, 14


def first_order(kept: Array | float, driven: Array, before: float) -> Array:
    """Return y_k = kept_k y_{k-1} + driven_k, (N,), from y_{-1} = before.

    Pieces of a stream give the same to the bit as all at once: every step is taken by the solver,
    whether that rounds a product or not.

    Parameters
    ----------
    kept : (N,) array or float
    driven : (N,) array
    before : float
    """
    # Here: few models have it. scipy.signal, which has a filter as well, takes 0.4 s to import.
    from scipy.linalg.blas import dtbsv

    # y_k - kept_k y_{k-1} = driven_k: a triangular system with one band below its diagonal.
    bands = np.zeros((2, len(driven) + 1), order='F')
    bands[1, :-1] = -np.asarray(kept)
    found: Array = dtbsv(1, bands, np.concatenate(([before], driven)), lower=1, diag=1)
    return found[1:]


class EffortFilter(MeasurementEffect):
    """The amplifier's or the recorder's effort signal is smoothed before it is recorded.

    Equation
    --------
    (T/2 d/dt + 1)^2 y = F, y measured

    Symptom
    -------
    Steps of the effort at reversals come rounded and late, peaks too low. No fast noise is
    left.

    Causes
    ------
    A filter on the current or torque signal, in the amplifier, the controller or the recorder.

    Confirmation
    ------------
    Switch the filter off, or read its cut-off f_c (T is about 1 / (2 pi f_c) times the order).
    Command a step of force against a stop, and look at its shape.

    References
    ----------
    Franklin, Powell, Workman, Digital Control of Dynamic Systems, 1998.
    """

    name = 'effort_filter'
    late_by = 'time_constant'
    nonlinear = True
    shows_at_reversals = True
    assumed_at_start = 'the filter has settled at the first sample'
    linear = ()
    shape = (Parameter('time_constant', 'T', 's', 'mean delay of the filter', 1e-4, 1.0,
                       scale=0.01),)

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return time constants from 2 to 200 ms."""
        return [{'time_constant': float(T)} for T in np.geomspace(SHORTEST, LONGEST, TRIALS)]

    @classmethod
    def sensor_deviations(cls, effort: Array, drive: DriveSamples, **shape: float,
                          ) -> tuple[Array, ...]:
        """Return the change by one lag instead of two, of which other orders do a share."""
        if drive.time is None or len(drive.time) < 2:
            return (np.zeros_like(effort),)
        step = float(np.median(np.diff(drive.time)))
        lagged = lag(effort, step, shape['time_constant'], effort[0], effort[0])
        return (lagged - cls.sense(effort, drive, **shape),)

    @classmethod
    def drive_memory(cls, start: float | None = None) -> Any:
        """Return the last time, and what goes into each lag and comes out of it last."""
        return {'time': None, 'states': None}

    @classmethod
    def sense(cls, effort: Array, drive: DriveSamples, **parameters: float) -> Array:
        """Return the filtered effort, (N,), of a filter that had settled at the first sample."""
        time = drive.time
        if time is None or not len(time):
            return effort
        memory = cls.drive_memory() if drive.memory is None else drive.memory
        is_first = memory['time'] is None
        times = time if is_first else np.concatenate(([memory['time']], time))
        step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        signal, states = effort, []
        for k in range(LAGS):
            entered, left = (signal[0], signal[0]) if is_first else memory['states'][k]
            smooth = lag(signal, step, parameters['time_constant'] / LAGS, entered, left)
            states.append((float(signal[-1]), float(smooth[-1])))
            signal = smooth
        memory.update(time=float(time[-1]), states=states)
        return signal


def lag(signal: Array, step: float, time_constant: float, entered: float, left: float) -> Array:
    """Return a signal (N,) behind a first-order lag, exact for straight lines.

    Parameters
    ----------
    signal : (N,) array
    step : float
        Between samples, and from the last one before them [s].
    time_constant : float
        [s]
    entered, left : float
        The last sample before them, and what came out of it.
    """
    if not step > 0:
        return np.full_like(signal, left)
    kept = np.exp(-step / time_constant)
    share = (1 - kept) * time_constant / step
    new, old = 1 - share, share - kept
    driven = new * signal + old * np.concatenate(([entered], signal[:-1]))
    return first_order(kept, driven, left)
