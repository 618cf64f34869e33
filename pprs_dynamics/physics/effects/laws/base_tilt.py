# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A base that does not stand level: gravity is not along -z of `base`."""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin
from typing import Any

from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect


class BaseTilt(BodyEffect):
    """Gravity turned by x about the x axis of `base`, then by y about its y axis.

    Equation
    --------
    g -> R_y(alpha_y) R_x(alpha_x) g, in base

    Symptom
    -------
    Errors of all drives that depend on the pose alone. A drive that carries no weight on a
    level base shows it best, as the slides of a 3-PPRS, whose errors sum to zero, or the
    upright first joint of an arm.

    Causes
    ------
    Feet of the frame out of level, a robot on a slope, a wall or a moving carriage, gravity in
    the model with a wrong direction.

    Confirmation
    ------------
    Put a spirit level on the base. Shim one foot by 5 mm and repeat: the error must change.
    Let an arm stretch out and turn its first joint: the effort at rest must change with the
    angle.

    References
    ----------
    Khalil, Dombre, Modeling, Identification and Control of Robots, 2002.
    """

    name = 'base_tilt'
    idealised = False
    nonlinear = True
    # A base is levelled to a degree; what leans by more than 20 stands so on purpose: gravity in
    # the model says how.
    linear = tuple(
        Parameter(axis, f'alpha_{axis}', 'rad', f'rotation of gravity about {axis} of base', -0.35,
                  0.35, scale=0.01, expected=(0.1, 0.1))
        for axis in 'xy')

    def changed(self, robot: Any) -> Any:
        """Return the robot under the turned gravity."""
        g_x, g_y, g_z = robot.gravity
        x, y = self.values['x'], self.values['y']
        g_y, g_z = cos(x) * g_y - sin(x) * g_z, sin(x) * g_y + cos(x) * g_z
        g_x, g_z = cos(y) * g_x + sin(y) * g_z, cos(y) * g_z - sin(y) * g_x
        return replace(robot, gravity=(g_x, g_y, g_z))
