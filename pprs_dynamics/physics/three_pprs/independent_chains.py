# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The paper's second approach to friction in the passive joints, Eq. (13).

References
----------
T. Itul, D. Pisla, 2007. `ModelJointFriction` is the first approach, Eq. (12).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import SingularityError
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.mechanism.state import MechanismState


class IndependentChainsFriction(ModelJointFriction):
    """Friction in passive joints, every chain for itself, Eq. (13).

    Parameters
    ----------
    blocks : mapping of str to mapping
        See `ModelJointFriction`.
    minimum_cosine : float
        Smallest allowed abs(cos u_i).

    Notes
    -----
    An approximation in either form: it is unbounded where cos u_i = 0, where it refuses, and
    even with the signs corrected its friction power can be negative. Use it to reproduce the
    paper, not to drive a robot.
    """

    def __init__(self, blocks: Mapping[str, Mapping[str, float]], minimum_cosine: float) -> None:
        super().__init__(blocks)
        self.minimum_cosine = minimum_cosine

    def singular(self, state: MechanismState) -> np.ndarray:
        """Return the samples at which this approach is not defined, (N,) bool."""
        mask: np.ndarray = np.any(np.abs(state.links.cos_u) < self.minimum_cosine, axis=1)
        return mask

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N].

        Raises
        ------
        SingularityError
            Where abs(cos u_i) is below `minimum_cosine`.
        """
        singular = self.singular(state)
        if np.any(singular):
            sample = int(np.argmax(singular))
            smallest = np.abs(state.links.cos_u[sample])
            raise SingularityError(
                sample, f'|cos u| of chain {int(np.argmin(smallest)) + 1} is '
                f'{smallest.min():.3g}, where friction.approach independent_chains is unbounded',
                f'limits.rod_cosine is {self.minimum_cosine:g}')
        found, robot = state.reactions, state.reactions.robot
        k_r, k_s = found.resistances(self.table(robot, state.reversal))
        omega, delta = state.motion.angular_velocity, np.asarray(robot.geometry.chain_angles)
        along_axis = omega[:, 1:2] * np.cos(delta) - omega[:, :1] * np.sin(delta)
        lever = robot.geometry.rod_length * found.cos_u
        sign = -1.0 if robot.printed else 1.0
        M_s_up, M_s_n = k_s * omega[:, 2:], -k_s * (found.u_dot - along_axis)  # Eq. (9)
        M_r_n = -k_r * found.u_dot                                             # Eq. (9)
        slides = sign * M_s_up / lever                                         # Eq. (13)
        lifts = sign * (M_s_n + M_r_n) / lever                                 # Eq. (13)
        return np.concatenate((slides, lifts), axis=1)
