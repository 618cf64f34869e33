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
from pprs_dynamics.effects.open_exponent import other_exponent

DIRECTIONS = 0.1  # share by which real viscous friction differs by direction


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
        """Return what a difference by direction adds, and thinning with speed."""
        return ((DIRECTIONS * np.abs(drive.velocity),),
                (other_exponent(drive.velocity, drive.velocity),))
