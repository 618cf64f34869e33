# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Guiding rods heavier or lighter than the model's, all three alike.

References
----------
T. Itul, D. Pisla, 2007, on the rods of this mechanism; W. Khalil, E. Dombre, Modeling,
Identification and Control of Robots, 2002, on base inertial parameters.
"""

from __future__ import annotations

from typing import ClassVar

from pprs_dynamics.physics.effects.altered_masses import with_masses
from pprs_dynamics.physics.effects.effect import Card, Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.three_pprs.robot import Robot


class RodMass(BodyEffect):
    """Mass more in every rod, spread evenly over its length."""

    name: ClassVar[str] = 'rod_mass'
    idealised: ClassVar[bool] = False
    linear = (Parameter('mass', 'm_b+', 'kg', 'mass beyond masses.rods, of each rod', -1e3, 1e3,
                        scale=0.05),)
    card = Card(
        'm_b -> m_b + m_b+, uniform along the rod',
        'an offset of the lifts by the weight of one rod each, errors of the slides that follow '
        'their own accelerations, and a share that changes with the angle of each rod',
        'joints, bolts or sensors on the rods that were not counted, tubes taken as solid or '
        'the other way round',
        'weigh a rod with all that swings with it',
        'Khalil, Dombre, Modeling, Identification and Control of Robots, 2002')

    def changed(self, robot: Robot) -> Robot:
        """Return the robot with the other rods."""
        rods = tuple(m_b + self.values['mass'] for m_b in robot.masses.rods)
        return with_masses(robot, rods=rods)
