# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A body on a link that the model does not have, or a link heavier or lighter than its model's.

References
----------
W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, 2002, on base inertial
parameters.
"""

from __future__ import annotations

from typing import Any, ClassVar

from pprs_dynamics.physics.effects.added_body import AddedBody, Place
from pprs_dynamics.physics.effects.effect import ARM, Card
from pprs_dynamics.physics.mechanism.alike import alike_bodies
from pprs_dynamics.physics.mechanism.mechanism import Mechanism


class LinkMass(AddedBody):
    """A body more on a link, by default where the link's centre of mass is.

    The link that carries the tool is left to the payload.
    """

    name: ClassVar[str] = 'link_mass'
    acts_in = frozenset({ARM})
    is_of_one_place: ClassVar[bool] = True
    linear = ()
    card = Card(
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
        """Return the effect on the links of a mechanism that have mass."""
        if not isinstance(robot, Mechanism):
            return cls
        places: list[Place] = []
        for k, name in enumerate(robot.body_names):
            if k == robot.carrier:
                continue
            _, frame = robot.structure.links[name]
            centre = frame.inverse.of_point(robot.inertial[k, 1:4] / robot.inertial[k, 0])
            x, y, z = (round(float(each), 6) for each in centre)
            places.append((f'{name}.', name, (x, y, z), float(robot.masses[k])))
        # What the link that carries the tool does as well is a payload.
        groups = tuple(tuple(robot.body_names[k] for k in sorted(
            group, key=lambda k: k != robot.carrier)) for group in alike_bodies(robot))
        return cls.on(tuple(places), groups, float(robot.masses.sum()))
