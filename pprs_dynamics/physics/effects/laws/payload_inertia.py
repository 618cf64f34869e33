# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The inertia of what an arm's tool carries, about the tool's origin.

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

MOMENTS, PRODUCTS = ('xx', 'yy', 'zz'), ('xy', 'xz', 'yz')


class PayloadInertia(BodyEffect):
    """Inertia about the tool's origin, beyond the model's; it adds no mass."""

    name: ClassVar[str] = 'payload_inertia'
    acts_in = frozenset({ARM})
    idealised: ClassVar[bool] = False
    linear = (
        *(Parameter(axes, f'I_{axes}', 'kg m^2', f'moment of inertia beyond {axes} of the model',
                    -1e4, 1e4, scale=0.05) for axes in MOMENTS),
        *(Parameter(axes, f'I_{axes}', 'kg m^2', f'tensor element beyond {axes} of the model',
                    -1e4, 1e4, 0.0, scale=0.05) for axes in PRODUCTS))
    variants = (MOMENTS, MOMENTS + PRODUCTS)
    card = Card(
        '[I] -> [I] + [I_xx I_xy I_xz; I_xy I_yy I_yz; I_xz I_yz I_zz], in the axes of the tool',
        'errors that follow the accelerations of the last joints, and nothing at rest or at '
        'steady speed',
        'a wide or long load taken as a point, an inertia from a drawing without the gripper',
        'swing the last joints fast, with and without the load: the error must grow with the '
        'square of the frequency',
        'Swevers, Verdonck, De Schutter, IEEE Control Systems Magazine 27, 2007')

    def changed(self, robot: Mechanism) -> Mechanism:
        """Return the arm with the other inertia."""
        return robot.with_payload(inertia=tuple(self.values[p.name] for p in self.parameters))
