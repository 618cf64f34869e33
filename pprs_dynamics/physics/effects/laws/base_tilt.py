# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A base that does not stand level: gravity is not along -z of `base`.

References
----------
W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, 2002, on gravity as the
acceleration of the base.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin
from typing import Any

from pprs_dynamics.physics.effects.effect import Card, Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.places import MECHANISM, PLATFORM


class BaseTilt(BodyEffect):
    """Gravity turned by x about the x axis of `base`, then by y about its y axis."""

    name = 'base_tilt'
    acts_in = frozenset({PLATFORM, MECHANISM})
    idealised = False
    nonlinear = True
    # A base is levelled to a degree; what leans by more than 20 stands so on purpose: gravity in
    # the model says how.
    linear = tuple(
        Parameter(axis, f'alpha_{axis}', 'rad', f'turn of gravity about {axis} of base', -0.35,
                  0.35, scale=0.01, expected=(0.1, 0.1))
        for axis in 'xy')
    card = Card(
        'g -> R_y(alpha_y) R_x(alpha_x) g, in base',
        'nearly constant errors of the slides, of which the three sum to nothing, and smaller '
        'ones of the lifts that change with the pose',
        'feet of the frame out of level, a robot on a slope or on a moving carriage, gravity in '
        'the model with a wrong direction',
        'put a spirit level on the base; shim one foot by 5 mm and repeat: the error must change',
        'Khalil, Dombre, Modeling, Identification and Control of Robots, 2002')
    mechanism_card = Card(
        'g -> R_y(alpha_y) R_x(alpha_x) g, in base',
        'errors of all joints that depend on the pose alone: the first joint, which carries no '
        'weight on a level base, shows it best where its axis should be upright',
        'an arm mounted on a slope, a wall or a moving carriage, gravity in the model with a wrong '
        'direction',
        'put a spirit level on the base; let the arm stretch out and turn the first joint: its '
        'effort at rest must change with the angle',
        'Khalil, Dombre, Modeling, Identification and Control of Robots, 2002')

    def changed(self, robot: Any) -> Any:
        """Return the robot under the turned gravity."""
        g_x, g_y, g_z = robot.gravity
        x, y = self.values['x'], self.values['y']
        g_y, g_z = cos(x) * g_y - sin(x) * g_z, sin(x) * g_y + cos(x) * g_z
        g_x, g_z = cos(y) * g_x + sin(y) * g_z, cos(y) * g_z - sin(y) * g_x
        return replace(robot, gravity=(g_x, g_y, g_z))
