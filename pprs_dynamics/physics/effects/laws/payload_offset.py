# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The centre of mass of what carries the tool lies elsewhere than the model says."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.description import about_centre, body_at, inertial_in


class PayloadOffset(BodyEffect):
    """The centre moved in the tool's axes, with the inertia about it as it was.

    The forces are quadratic in the offset, by its square in the moment of inertia about o.

    Equation
    --------
    centre of mass -> centre of mass + (d_x, d_y, d_z), in the tool's axes

    Symptom
    -------
    Offsets of the lifts that sum to zero: one carries more and the others less. A height
    d_z shows only when the platform tilts or accelerates sideways.

    Causes
    ------
    A payload clamped off the middle, a tool that reaches out to one side, a mass that was
    measured right and placed wrong.

    Confirmation
    ------------
    Turn the payload by 180 degrees about the vertical and repeat: the offsets must change
    their sign.

    References
    ----------
    Swevers, Verdonck, De Schutter, IEEE Control Systems Magazine 27, 2007.
    """

    name = 'payload_offset'
    is_in_payload = True
    idealised = False
    nonlinear = True
    linear = tuple(
        Parameter(axis, f'd_{axis}', 'm', f'offset of the centre of mass along {axis} of the tool',
                  -1.0, 1.0, scale=0.003)
        for axis in 'xyz')
    variants = (('x', 'y'), ('x', 'y', 'z'))

    def changed(self, robot: Any) -> Any:
        """Return the robot with the other centre of mass."""
        row, frame = robot.structure.links[robot.structure.tool]
        before = inertial_in(frame.inverse, robot.by_joint[row])
        mass, centre, inertia = about_centre(before)
        moved = body_at(mass, centre + [self.values[axis] for axis in 'xyz'], inertia)
        return robot.with_body(robot.structure.tool, moved - before)
