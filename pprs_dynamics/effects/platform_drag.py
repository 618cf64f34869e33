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

"""Drag on the platform: a force in proportion to its velocity.

References
----------
F. M. White, Fluid Mechanics, on creeping flow.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pprs_dynamics.effects.effect import Card, Parameter
from pprs_dynamics.effects.structure_effect import BodyEffect
from pprs_dynamics.mechanism.rigid_body import StructureLoad
from pprs_dynamics.mechanism.state import MechanismState


class PlatformDrag(BodyEffect):
    """Force c v against the velocity of o, and moment c_r omega against the turning."""

    name: ClassVar[str] = 'platform_drag'
    is_friction: ClassVar[bool] = True
    linear = (
        Parameter('coefficient', 'c', 'N s/m', 'force per velocity of the platform', -1e6, 1e6,
                  scale=1.0),
        Parameter('rotational', 'c_r', 'N m s/rad', 'moment per angular velocity of the platform',
                  -1e6, 1e6, 0.0, scale=0.01))
    variants = (('coefficient',), ('coefficient', 'rotational'))
    unphysical_below: ClassVar[dict[str, float]] = {'coefficient': 0.0, 'rotational': 0.0}
    card = Card(
        'Q = [J]^T (c v, c_r omega)',
        'errors on several drives that follow the velocity of the platform and not that of one '
        'drive: a drive may feel it while it stands still',
        'a tool that moves through a liquid, a curtain, brush or hose dragged along, an eddy '
        'current brake',
        'repeat with the tool out of the medium; repeat at half the speed: the error must halve, '
        'where dry friction would stay',
        'White, Fluid Mechanics')

    def load(self, state: MechanismState) -> StructureLoad:
        """Return (c v, c_r omega)."""
        motion = state.motion
        wrench = np.concatenate((self.values['coefficient'] * motion.linear_velocity,
                                 self.values['rotational'] * motion.angular_velocity), axis=1)
        return StructureLoad(wrench, np.zeros((len(wrench), 3)))
