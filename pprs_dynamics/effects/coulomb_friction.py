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

"""Dry friction of a drive that does not depend on its guide's load: F sgn(q_dot)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pprs_dynamics.arrays import Array
from pprs_dynamics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.effects.effect import Card, Parameter


class CoulombFriction(DriveEffect):
    """Force of constant size against the motion: seals, preloaded nuts and bearings."""

    name: ClassVar[str] = 'coulomb_friction'
    is_friction: ClassVar[bool] = True
    linear = (Parameter('force', 'F', 'N', 'size of the friction force', -1e6, 1e6, scale=0.5),)
    unphysical_below: ClassVar[Mapping[str, float]] = {'force': 0.0}
    card = Card(
        'F sgn(q_dot)',
        'a square wave: one level while the drive moves forwards, its negative backwards, a '
        'step at each reversal; the same at every speed and load',
        'preload of guides, nut or bearings, wipers and seals, a brake that drags',
        'run the drive slowly to and fro, with and without payload: half the step at reversal is '
        'F, and the payload must not change it (if it does: load_friction); loosen preload or '
        'wiper and repeat',
        'Armstrong-Helouvry, Dupont, Canudas de Wit, A survey of models, analysis tools and '
        'compensation methods for the control of machines with friction, Automatica 30, 1994')

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (sgn q_dot,)."""
        return (drive.direction,)
