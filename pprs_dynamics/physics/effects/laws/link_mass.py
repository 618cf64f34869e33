# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A link of an arm heavier or lighter than its model's.

References
----------
W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, 2002, on base inertial
parameters.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from pprs_dynamics.physics.effects.effect import ARM, Card, Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.mechanism import Mechanism

MOST_LINKS = 7  # that are told apart; arms hardly have more


class LinkMass(BodyEffect):
    """Mass more in what a joint moves up to the next, spread as the model's mass is.

    The link that carries the tool is left to the payload's effects.
    """

    name: ClassVar[str] = 'link_mass'
    acts_in = frozenset({ARM})
    idealised: ClassVar[bool] = False
    linear = tuple(
        Parameter(f'link_{k}', f'm_{k}+', 'kg', f'mass beyond that of what joint {k} of arm.joints '
                  'moves up to the next', -1e3, 1e3, 0.0, scale=0.2)
        for k in range(1, MOST_LINKS + 1))
    variants = tuple((parameter.name,) for parameter in linear)
    card = Card(
        '(m_k, m_k c_k, I_k) -> (1 + m_k+ / m_k) (m_k, m_k c_k, I_k)',
        'errors of this joint and of those that carry it, as large as the weight of the link '
        'times its distance from each axis, and in the same proportion to their accelerations; '
        'none of the joints behind it',
        'a URDF whose masses are guesses, or of another variant of the arm; a motor, cover, hose '
        'or sensor on the link that the file does not have',
        'hang a known weight on the link, at its middle: the error must change by as much; '
        'compare with the data sheet, or weigh the link when it is taken apart',
        'Khalil, Dombre, Modeling, Identification and Control of Robots, 2002')

    def changed(self, robot: Mechanism) -> Mechanism:
        """Return the arm with the other links."""
        inertial = robot.inertial.copy()
        for k, parameter in enumerate(self.linear[:len(inertial)]):
            inertial[k] *= 1 + self.values[parameter.name] / inertial[k, 0]
        return replace(robot, inertial=inertial)

    @classmethod
    def absent(cls, robot: Mechanism) -> frozenset[str]:
        """Return the links that the arm does not have, and the one that carries the tool."""
        last = robot.carrier
        return frozenset(parameter.name for k, parameter in enumerate(cls.linear)
                         if k >= len(robot.inertial) or k == last)
