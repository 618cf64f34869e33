# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Drag on the platform: a force in proportion to its velocity.

References
----------
F. M. White, Fluid Mechanics, on creeping flow.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pprs_dynamics.physics.effects.effect import Card, Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.structure_load import StructureLoad
from pprs_dynamics.physics.three_pprs.state import MechanismState


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
        return StructureLoad(wrench)
