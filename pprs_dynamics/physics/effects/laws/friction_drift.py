# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction that changes as the drive works: by the clock, or by the heat of its own work.

By the clock F exp(-t / tau) sgn(q_dot), t from the start. By its work (F_w w + c_w |q_dot| w)
sgn(q_dot), tau w_dot = |q_dot| - w: friction makes heat in proportion to the speed, which flows
off in tau. Where work is even both are one but for a constant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.laws.effort_filter import first_order


class FrictionDrift(DriveEffect):
    """Friction that changes while the robot works: cold grease, seals that warm up.

    Equation
    --------
    (F exp(-t / tau) + F_w w) sgn(q_dot) + c_w w q_dot, t since the start, tau w_dot = |q_dot|
    - w

    Symptom
    -------
    The step at each reversal shrinks from the beginning of a recording to its end (or grows,
    where F is negative), whatever the motion. By work it shrinks, or the slope over velocity,
    while the drive is fast, and grows again while it is slow.

    Causes
    ------
    Grease that warms by the friction itself or after a cold start, seals that settle, a
    preload that changes as screw or guide expand.

    Confirmation
    ------------
    Repeat the same motion for an hour from cold, and after a night's rest. The friction must
    fade alike both times. Measure the temperature of nut and guide as well.

    References
    ----------
    Bittencourt and Gunnarsson, Static friction in a robot joint: modeling and identification
    of load and temperature effects, ASME J. Dynamic Systems, Measurement, and Control 134,
    2012.
    """

    name = 'friction_drift'
    assumed_at_start = 'the drive is cold, the time of fading begins'
    is_friction = True
    linear = (Parameter('force', 'F', 'N', 'friction at the start beyond the later one', -1e6, 1e6,
                        0.0, scale=0.5),
              Parameter('worked', 'F_w', 'N s/m', 'dry friction that comes with work, per mean '
                        'speed of the last tau; less than 0 where the drive runs itself loose',
                        -1e6, 1e6, 0.0, scale=5.0),
              Parameter('thinned', 'c_w', 'N s^2/m^2', 'viscous friction that comes with work, '
                        'the same', -1e6, 1e6, 0.0, scale=50.0))
    shape = (Parameter('time', 'tau', 's', 'time in which it fades, and heat flows off', 1e-3, 1e7,
                       scale=10.0),)
    variants = (('force',), ('worked',), ('thinned',), ('force', 'worked', 'thinned'))
    unphysical_below: ClassVar[Mapping[str, float]] = {'force': 0.0}

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (exp(-t / tau) sgn q_dot, w sgn q_dot, w q_dot).

        t and w are 0 where time is unknown.
        """
        if drive.time is None:
            none = np.zeros_like(drive.velocity)
            return (drive.direction, none, none)
        memory = cls.drive_memory() if drive.memory is None else drive.memory
        if memory['start'] is None:
            memory['start'] = float(drive.time[0])
        faded = np.exp(-np.maximum(drive.time - memory['start'], 0.0) / shape['time'])
        work = _worked(drive.time, np.abs(drive.velocity), shape['time'], memory)
        return (faded * drive.direction, work * drive.direction, work * drive.velocity)

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return times from a twentieth of the recording to all of it."""
        longest = np.clip(covered.duration, 0.02, 1e7)
        return [{'time': float(tau)} for tau in np.geomspace(longest / 20, longest, 6)]

    @classmethod
    def drive_memory(cls, start: float | None = None) -> Any:
        """Return the time of the start, None before it is known, and of no work since."""
        return {'start': start, 'last': None, 'work': 0.0}


def _worked(time: Array, speed: Array, tau: float, memory: Any) -> Array:
    """Return w of tau w_dot = speed - w, (N,), and remember where it ends.

    Speeds are those of the intervals that end at the samples.
    """
    last = memory['start'] if memory['last'] is None else memory['last']
    elapsed = np.diff(time, prepend=min(last, time[0])) / tau
    kept, gained = np.exp(-elapsed), -np.expm1(-elapsed) * speed
    work = first_order(kept, gained, memory['work'])
    memory['last'], memory['work'] = float(time[-1]), float(work[-1])
    return work
