# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Drag on the tool, as on a platform: a force in proportion to its velocity."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.state import MechanismState, StructureLoad


class ToolDrag(BodyEffect):
    """Force c v against the velocity of the tool's origin, moment c_r omega against its turning.

    Equation
    --------
    Q = [J]^T (c v, c_r omega)

    Symptom
    -------
    Errors of several drives that follow the velocity of the tool or platform, in the
    proportions of its Jacobian, and not that of one drive. A drive may feel it while it is at
    rest.

    Causes
    ------
    A tool that moves through a liquid, a curtain, brush or hose dragged along, an eddy current
    brake.

    Confirmation
    ------------
    Repeat with the tool out of the medium. Repeat at half the speed: the error must halve,
    where dry friction would stay.

    References
    ----------
    White, Fluid Mechanics.
    """

    name = 'tool_drag'
    is_friction = True
    needs_several_drives = True  # of a single one it is viscous friction
    linear = (
        Parameter('coefficient', 'c', 'N s/m', 'force per velocity of the tool', -1e6, 1e6,
                  scale=1.0),
        Parameter('rotational', 'c_r', 'N m s/rad', 'moment per angular velocity of the tool',
                  -1e6, 1e6, 0.0, scale=0.01))
    variants = (('coefficient',), ('coefficient', 'rotational'))

    def load(self, state: MechanismState) -> StructureLoad:
        """Return (c v, c_r omega)."""
        c = [self.values['coefficient']] * 3 + [self.values['rotational']] * 3
        return StructureLoad(np.array(c) * state.tool_velocity)
