# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A constant force and moment on the platform that the drives must overcome.

References
----------
L.-W. Tsai, Robot Analysis, 1999, on statics by virtual work.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.physics.effects.effect import Card, Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.places import MECHANISM, PLATFORM
from pprs_dynamics.physics.mechanism.state import MechanismState
from pprs_dynamics.physics.mechanism.structure_load import StructureLoad

FORCES = tuple(f'force_{axis}' for axis in 'xyz')
MOMENTS = tuple(f'moment_{axis}' for axis in 'xyz')


class ExternalWrench(BodyEffect):
    """The wrench that the drives apply to the world at o, or at an arm's tool.

    Pulled down, force_z is positive.
    """

    name = 'external_wrench'
    acts_in = frozenset({PLATFORM, MECHANISM})
    nonlinear = True
    linear = (
        *(Parameter(name, f'F_{name[-1]}', 'N', f'force to overcome along {name[-1]} of base',
                    -1e6, 1e6, scale=1.0) for name in FORCES),
        *(Parameter(name, f'M_{name[-1]}', 'N m', f'moment to overcome about {name[-1]} of base',
                    -1e6, 1e6, 0.0, scale=0.1) for name in MOMENTS))
    variants = (('force_z',), FORCES, MOMENTS, FORCES + MOMENTS)
    card = Card(
        'Q = [J]^T (F, M), F and M in base at o',
        'errors that depend on the pose alone, whatever the speed: nearly constant on a small '
        'motion, on several drives in the proportions of the Jacobian',
        'a counterweight or balancer, a hose or cable that pulls, contact with a workpiece, a '
        'wind or suction',
        'take away whatever touches the platform and repeat; hang a known weight over a pulley '
        'and look whether the same force is found. Only accelerations tell a downward force '
        'from a payload',
        'Tsai, Robot Analysis, 1999')
    mechanism_card = Card(
        'tau = J^T (F, M), F and M in base at the origin of the tool',
        'errors that depend on the pose alone, whatever the speed, in the proportions of the '
        'Jacobian of the tool',
        'a hose or cable that pulls at the tool, a balancer, contact with a workpiece',
        'take away whatever touches the tool and repeat. Only accelerations and turns of the tool '
        'tell a downward force from a payload',
        'Tsai, Robot Analysis, 1999')

    def load(self, state: MechanismState) -> StructureLoad:
        """Return the wrench, the same for every sample."""
        wrench = np.array([self.values[p.name] for p in self.parameters])
        return StructureLoad(np.tile(wrench, (len(state.velocity), 1)))
