# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A body on a link that the model does not have, or a link heavier or lighter than its model's."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.physics.effects.structure_effect import AddedBody


class LinkMass(AddedBody):
    """A body more on a link, by default where the link's centre of mass is.

    On the rods of a 3-PPRS, all three alike, it is mass spread evenly over their length. The link
    that carries the tool is left to the payload.

    Equation
    --------
    m_b -> m_b + m_+, of one link; of a 3-PPRS along all rods

    Symptom
    -------
    Errors of the drives that carry the link, in the proportions of its weight and of its
    accelerations, and none of the joints behind it. On a 3-PPRS the lifts have an offset by
    the weight of one rod each, and a share changes with the angle of each rod.

    Causes
    ------
    A description whose masses are guesses, or of another variant of the robot. A motor, cover,
    hose, bolt or sensor on the link that the model does not have. Tubes taken as solid, or the
    other way round.

    Confirmation
    ------------
    Hang a known weight on the link, at its middle: the error must change by as much. Compare
    with the data sheet, or weigh the link with all that swings with it.

    References
    ----------
    Khalil, Dombre, Modeling, Identification and Control of Robots, 2002.
    """

    name = 'link_mass'
    is_of_one_place = True
    linear = ()

    @classmethod
    def bound(cls, robot: Any) -> Any:
        """Return the effect on the links of a robot that have mass."""
        return cls.at_places(robot.link_places, robot.alike_links, robot.moved_mass)
