# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The first moment of what an arm's tool carries: where its centre of mass is.

References
----------
J. Swevers, W. Verdonck, J. De Schutter, Dynamic model identification for industrial robots,
IEEE Control Systems Magazine 27 (2007), on payload identification.
"""

from __future__ import annotations

from typing import ClassVar

from pprs_dynamics.physics.effects.effect import ARM, Card, Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.mechanism import Mechanism


class PayloadMoment(BodyEffect):
    """Mass times distance from the tool's origin, beyond the model's; it adds no mass."""

    name: ClassVar[str] = 'payload_moment'
    acts_in = frozenset({ARM})
    idealised: ClassVar[bool] = False
    linear = tuple(
        Parameter(axis, f'm c_{axis}', 'kg m', f'mass times its place along {axis} of the tool',
                  -1e3, 1e3, scale=0.05)
        for axis in 'xyz')
    card = Card(
        'm c -> m c + (m c_x, m c_y, m c_z), in the axes of the tool',
        'errors of the last joints that follow the weight of the tool as it turns; with '
        'payload_mass it says where the load is: at moment / mass from the origin of the tool',
        'a load clamped off the axis of the tool, a long gripper, a camera or a hose on one side',
        'turn the last joint by 180 degrees while it is level: the error must change its sign',
        'Swevers, Verdonck, De Schutter, IEEE Control Systems Magazine 27, 2007')

    def changed(self, robot: Mechanism) -> Mechanism:
        """Return the arm with the other first moment."""
        x, y, z = (self.values[axis] for axis in 'xyz')
        return robot.with_payload(moment=(x, y, z))
