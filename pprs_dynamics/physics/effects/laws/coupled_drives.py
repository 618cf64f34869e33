# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction of motors that turn with several joints: A' (c m_dot + F sgn(m_dot)), m_dot = A q_dot.

Differentials, wrists with motors in the forearm, parallelogram drives: a motor turns with a sum of
joints, and what rubs at it is felt in all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.structure_effect import OfPlace, StructureEffect
from pprs_dynamics.physics.mechanism.state import MECHANISM, MechanismState, smooth_sign


class CoupledDrives(StructureEffect):
    """Friction of a motor that moves more than one joint, by the map of the model file.

    Equation
    --------
    tau -> tau + A' (c m_dot + F sgn(m_dot)), m_dot = A q_dot of one motor

    Symptom
    -------
    A step in the efforts of several joints at once, in the proportions of the map, where a sum
    of their velocities changes sign. As long as one joint stands it looks like friction of the
    other, and like masses where both move.

    Causes
    ------
    Differentials, wrists whose motors sit in the forearm, parallelogram drives: gear, bearings
    and seals of a motor rub with its own speed, not with that of a joint.

    Confirmation
    ------------
    Move both joints so that the motor stands (the sum of its map stays), then so that it turns
    twice as fast: the friction must vanish in the first case, and double in the second.

    References
    ----------
    Gautier, Janot, Vandanjon, A new closed-loop output error method for parameter
    identification of robot dynamics, IEEE Trans. Control Systems Technology 21, 2013.
    """

    name = 'coupled_drives'
    acts_in = frozenset({MECHANISM})
    is_friction = True
    is_of_one_place = True
    linear = ()

    @classmethod
    def bound(cls, robot: Any) -> Any:
        """Return the effect in the motors of a mechanism that move more than one joint.

        A place is a motor with its turns per turn of each drive.
        """
        return cls.at_places(tuple(robot.motors.items()))

    @classmethod
    def of_place(cls, place: Any, is_alike: bool, moved: float) -> OfPlace:
        """Return the parameters of a motor, and each of them and both."""
        motor, _ = place
        viscous, coulomb = names = f'{motor}.viscous', f'{motor}.coulomb'
        linear = (
            Parameter(viscous, 'c', 'N m s/rad', f'viscous friction of {motor}', -1e6, 1e6, 0.0,
                      scale=0.1),
            Parameter(coulomb, 'F', 'N m', f'dry friction of {motor}', -1e6, 1e6, 0.0, scale=0.1))
        return linear, ((viscous,), (coulomb,), names)

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the drives' efforts [N m, N], (N, D)."""
        force: Array = np.zeros_like(state.velocity)
        widths = state.reversal.widths(state.velocity.shape[1])
        for motor, ratios in self.places:
            row = np.array(ratios)
            speed = state.velocity @ row
            friction = (self.values[f'{motor}.viscous'] * speed + self.values[f'{motor}.coulomb']
                        * smooth_sign(speed, np.asarray(np.abs(row) @ widths)))
            force += np.outer(friction, row)
        return force
