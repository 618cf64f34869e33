# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Viscous friction of a drive beyond the model's: c q_dot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.effects.effect import Card, Parameter

# By how much real viscous friction differs by direction, as a share, and its exponent of the speed
# from 1: grease and oil of gears thin with speed.
DIRECTIONS, EXPONENTS = 0.1, 1 / 3
LEAST_SPEED = 1e-3  # of the usual one, below which the logarithm goes no further


class ViscousFriction(DriveEffect):
    """Force in proportion to velocity: lubricant, motor damping, a current loop's back-EMF."""

    name: ClassVar[str] = 'viscous_friction'
    is_friction: ClassVar[bool] = True
    linear = (Parameter('coefficient', 'c', 'N s/m', 'force per velocity', -1e6, 1e6, scale=5.0),)
    unphysical_below: ClassVar[Mapping[str, float]] = {'coefficient': 0.0}
    card = Card(
        'c q_dot',
        'a straight line through zero over velocity, the same forwards and backwards; nothing '
        'at low speed',
        'stiff or cold grease, too much grease, seals, eddy currents and back-EMF of the motor, '
        'a damper or cable chain that drags',
        'run the drive at several constant speeds, both ways: the force must rise in proportion; '
        'repeat warm, or with other grease: the slope must change',
        'Armstrong-Helouvry, Dupont, Canudas de Wit, A survey of models, analysis tools and '
        'compensation methods for the control of machines with friction, Automatica 30, 1994')

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (q_dot,)."""
        return (drive.velocity,)

    @classmethod
    def deviations(cls, drive: DriveSamples, **shape: float) -> tuple[tuple[Array, ...], ...]:
        """Return what a difference by direction adds, and another exponent, to first order."""
        return (DIRECTIONS * np.abs(drive.velocity),), (thinning(drive),)


def thinning(drive: DriveSamples) -> Array:
    """Return what an exponent of the speed by `EXPONENTS` above 1 adds to q_dot, to first order."""
    speed = np.abs(drive.velocity)
    usual = np.sqrt(np.mean(speed ** 2)) or 1.0
    added: Array = EXPONENTS * np.log(np.maximum(speed / usual, LEAST_SPEED)) * drive.velocity
    return added
