# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A payload heavier or lighter than the model's, in the same place."""

from __future__ import annotations

from math import inf
from typing import Any

from pprs_dynamics.physics.effects.structure_effect import AddedBody, body_parameters
from pprs_dynamics.physics.mechanism.state import BodyPlace


class PayloadMass(AddedBody):
    """A body more at the tool: at the centre of mass of a 3-PPRS' platform, as a point.

    Equation
    --------
    m -> m + m_+, at the tool; of a 3-PPRS at the centre of mass

    Symptom
    -------
    An error of the drives that carry the tool, in the proportions of its weight. With it go
    errors that follow the accelerations of the tool. On a 3-PPRS each lift carries about a
    third of the weight.

    Causes
    ------
    Another tool or workpiece than in the model, a gripper that was not counted, or a hose or
    cable that hangs on the tool.

    Confirmation
    ------------
    Weigh the payload. Repeat without it, or with a known weight more: the error must change by
    just that weight. Only accelerations distinguish it from a constant downward force, so move
    fast. A gain of the drives that is wrong by 5 % makes this mass wrong by 5 %.

    References
    ----------
    Swevers, Verdonck, De Schutter, IEEE Control Systems Magazine 27, 2007.
    """

    name = 'payload_mass'
    places = (BodyPlace('the tool', (0.0, 0.0, 0.0), inf, is_spread=True),)
    linear = body_parameters('', 'the tool', (0.0, 0.0, 0.0), inf)[:1]

    @classmethod
    def bound(cls, robot: Any) -> Any:
        """Return the body at the tool of a robot."""
        return cls.at_places((robot.tool_place,), (), robot.moved_mass)
