# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A payload heavier or lighter than the model's, in the same place.

References
----------
J. Swevers, W. Verdonck, J. De Schutter, Dynamic model identification for industrial robots,
IEEE Control Systems Magazine 27 (2007), on payload identification.
"""

from __future__ import annotations

from math import inf
from typing import Any

from pprs_dynamics.physics.effects.added_body import AddedBody, Place, body_parameters
from pprs_dynamics.physics.effects.effect import Card
from pprs_dynamics.physics.mechanism.places import MECHANISM, PLATFORM


class PayloadMass(AddedBody):
    """A body more at the tool: at the centre of mass of a 3-PPRS' platform, as a point."""

    name = 'payload_mass'
    acts_in = frozenset({PLATFORM, MECHANISM})
    places = (Place('', 'the tool', (0.0, 0.0, 0.0), inf, is_spread=True),)
    linear = body_parameters('', 'the tool', (0.0, 0.0, 0.0), inf)[:1]
    card = Card(
        'M + m -> M + m + m_+, at the centre of mass',
        'an offset of all three lifts with the sign of the mass, about a third of its weight '
        'each, and with it errors on all six drives that follow the acceleration of the platform',
        'another tool or workpiece than the model was told, a hose or cable that hangs on the '
        'platform, a gripper that was not counted',
        'weigh the payload; repeat without it, or with a known weight more: the offset must '
        'change by just that weight. Only accelerations tell it from a constant downward force, '
        'so move fast',
        'Swevers, Verdonck, De Schutter, IEEE Control Systems Magazine 27, 2007')
    mechanism_card = Card(
        'tau -> tau + what moves a body at the tool: m_+ at c, with [I] about c',
        'an error of the joints that carry the arm, as large as its weight times its distance from '
        'each axis, and with it one that follows the accelerations of the tool',
        'a tool or workpiece that the model was not told of, or one that was taken off; a hose or '
        'cable that hangs on the wrist',
        'weigh what hangs on the flange; repeat without it, or with a known weight more. A gain of '
        'the drives that is wrong by 5 % makes this mass wrong by 5 %',
        'Swevers, Verdonck, De Schutter, IEEE Control Systems Magazine 27, 2007')

    @classmethod
    def bound(cls, robot: Any) -> Any:
        """Return the body at the tool of a robot."""
        return cls if robot is None else cls.on((Place.of(robot.tool_place),), (), robot.moved_mass)
