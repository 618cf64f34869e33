# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A constant force and moment on the platform that the drives must overcome."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.state import MechanismState, StructureLoad

FORCES = tuple(f'force_{axis}' for axis in 'xyz')
MOMENTS = tuple(f'moment_{axis}' for axis in 'xyz')


class ExternalWrench(BodyEffect):
    """The wrench that the drives apply to the world at o, or at an arm's tool.

    Pulled down, force_z is positive.

    Equation
    --------
    Q = [J]^T (F, M), F and M in base at o

    Symptom
    -------
    Errors that depend on the pose alone, whatever the speed, on several drives in the
    proportions of the Jacobian of the tool. On a small motion they are nearly constant.

    Causes
    ------
    A counterweight or balancer, a hose or cable that pulls at the tool, contact with a
    workpiece, wind or suction.

    Confirmation
    ------------
    Take away whatever touches the tool and repeat. Hang a known weight over a pulley and look
    whether the same force is reported. Only accelerations and turns of the tool distinguish a
    downward force from a payload.

    References
    ----------
    Tsai, Robot Analysis, 1999.
    """

    name = 'external_wrench'
    nonlinear = True
    linear = (
        *(Parameter(name, f'F_{name[-1]}', 'N', f'force to overcome along {name[-1]} of base',
                    -1e6, 1e6, scale=1.0) for name in FORCES),
        *(Parameter(name, f'M_{name[-1]}', 'N m', f'moment to overcome about {name[-1]} of base',
                    -1e6, 1e6, 0.0, scale=0.1) for name in MOMENTS))
    variants = (('force_z',), FORCES, MOMENTS, FORCES + MOMENTS)

    def load(self, state: MechanismState) -> StructureLoad:
        """Return the wrench, the same for every sample."""
        wrench = np.array([self.values[p.name] for p in self.parameters])
        return StructureLoad(np.tile(wrench, (len(state.velocity), 1)))
