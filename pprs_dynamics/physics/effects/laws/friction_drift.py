# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Dry friction that fades as the drive warms up: F exp(-t / tau) sgn(q_dot), t from the start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples
from pprs_dynamics.physics.effects.effect import Card, Parameter


class FrictionDrift(DriveEffect):
    """Friction that changes while the robot works: cold grease, seals that warm up."""

    name: ClassVar[str] = 'friction_drift'
    assumed_at_start: ClassVar[str] = 'the drive is cold, the time of fading begins'
    is_friction: ClassVar[bool] = True
    linear = (Parameter('force', 'F', 'N', 'friction at the start beyond the later one', -1e6, 1e6,
                        scale=0.5),)
    shape = (Parameter('time', 'tau', 's', 'time in which it fades', 1e-3, 1e7, scale=10.0),)
    unphysical_below: ClassVar[Mapping[str, float]] = {'force': 0.0}
    card = Card(
        'F exp(-t / tau) sgn(q_dot), t since the start',
        'the step at each reversal shrinks from the beginning of a recording to its end (or '
        'grows, where F is negative), whatever the motion',
        'grease that warms by the friction itself or after a cold start, seals that settle, a '
        'preload that changes as screw or guide expand',
        "repeat the same motion for an hour from cold, and after a night's rest: the friction "
        'must fade alike both times; measure the temperature of nut and guide beside it',
        'Bittencourt and Gunnarsson, Static friction in a robot joint: modeling and '
        'identification of load and temperature effects, ASME J. Dynamic Systems, Measurement, '
        'and Control 134, 2012')

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (exp(-t / tau) sgn q_dot,); t is 0 where time is unknown."""
        if drive.time is None:
            return (drive.direction,)
        memory = cls.drive_memory() if drive.memory is None else drive.memory
        if memory['start'] is None:
            memory['start'] = float(drive.time[0])
        return (np.exp(-(drive.time - memory['start']) / shape['time']) * drive.direction,)

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return times from a twentieth of the recording to all of it."""
        longest = np.clip(covered.duration, 0.02, 1e7)
        return [{'time': float(tau)} for tau in np.geomspace(longest / 20, longest, 6)]

    @classmethod
    def drive_memory(cls) -> Any:
        """Return the time of the start, None before it is known."""
        return {'start': None}

    @classmethod
    def begin(cls, memory: Any, time: float) -> None:
        """Start the clock."""
        memory['start'] = time
