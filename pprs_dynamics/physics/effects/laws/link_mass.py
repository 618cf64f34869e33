# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A body on a link that the model does not have, or a link heavier or lighter than its model's.

References
----------
W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, 2002, on base inertial
parameters.
"""

from __future__ import annotations

from typing import Any

from pprs_dynamics.physics.effects.added_body import AddedBody, Place
from pprs_dynamics.physics.effects.effect import Card
from pprs_dynamics.physics.mechanism.alike import alike_links
from pprs_dynamics.physics.mechanism.places import MECHANISM, PLATFORM


class LinkMass(AddedBody):
    """A body more on a link, by default where the link's centre of mass is.

    On the rods of a 3-PPRS, all three alike, it is mass spread evenly over their length. The link
    that carries the tool is left to the payload.
    """

    name = 'link_mass'
    acts_in = frozenset({PLATFORM, MECHANISM})
    is_of_one_place = True
    linear = ()
    card = Card(
        'm_b -> m_b + m_+, uniform along each rod',
        'an offset of the lifts by the weight of one rod each, errors of the slides that follow '
        'their own accelerations, and a share that changes with the angle of each rod',
        'joints, bolts or sensors on the rods that were not counted, tubes taken as solid or '
        'the other way round',
        'weigh a rod with all that swings with it',
        'Khalil, Dombre, Modeling, Identification and Control of Robots, 2002')
    mechanism_card = Card(
        'tau -> tau + what moves a body on the link: m_+ at c, with [I] about c, in its axes',
        'errors of this joint and of those that carry it, as large as the weight of the link '
        'times its distance from each axis, and in the same proportion to their accelerations; '
        'none of the joints behind it',
        'a URDF whose masses are guesses, or of another variant of the arm; a motor, cover, hose '
        'or sensor on the link that the file does not have',
        'hang a known weight on the link, at its middle: the error must change by as much; '
        'compare with the data sheet, or weigh the link when it is taken apart',
        'Khalil, Dombre, Modeling, Identification and Control of Robots, 2002')

    @classmethod
    def bound(cls, robot: Any) -> Any:
        """Return the effect on the links of a robot that have mass."""
        return cls if robot is None else cls.on(
            tuple(Place.of(one, f'{one.link}.') for one in robot.link_places),
            alike_links(robot), robot.moved_mass)
