# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The paper's friction in the passive joints: the first approach, Eq. (12), and the second, (13).

References
----------
T. Itul, D. Pisla, 2007. Friction beyond it, and that of other robots, is in `joint_friction`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import SingularityError
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.mechanism.state import MechanismState
from pprs_dynamics.physics.mechanism.vectors import Vector, in_chain
from pprs_dynamics.physics.three_pprs.kernel_parameters import Joints
from pprs_dynamics.physics.three_pprs.passive_joints import relative_rate


@dataclass(frozen=True)
class JointCoefficients:
    """Friction coefficients of one kind of passive joint.

    Parameters
    ----------
    viscous : float
        c_r or c_s [N m s/rad].
    coulomb : float
        mu_r or mu_s [1].
    diameter : float
        d_r or d_s, of the spindle or the ball [m].
    """

    viscous: float
    coulomb: float
    diameter: float


@dataclass(frozen=True)
class PassiveFriction(Effect):
    """Viscous and load-dependent Coulomb friction of the passive joints.

    Parameters
    ----------
    revolute, spherical : JointCoefficients
        In C_i and A_i.
    printed : bool
        Take the equations to the letter, misprints included.
    """

    name: ClassVar[str] = 'passive_friction'
    approach: ClassVar[str]
    revolute: JointCoefficients
    spherical: JointCoefficients
    printed: bool = False

    def joints(self, reversal: Reversal) -> Joints:
        """Return the coefficients as kernels take them."""
        return Joints(reversal.rate, float(self.printed), *(
            value for joint in (self.revolute, self.spherical)
            for value in (joint.viscous, 0.0, joint.coulomb, joint.diameter)))

    @abstractmethod
    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N]."""


@dataclass(frozen=True)
class WholeMechanismFriction(PassiveFriction):
    """The first approach: a virtual motion of a drive moves every passive joint, Eq. (12)."""

    approach: ClassVar[str] = 'whole_mechanism'

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N], by virtual power."""
        return state.against_friction(self.joints(state.reversal))


@dataclass(frozen=True)
class IndependentChainsFriction(PassiveFriction):
    """The second approach: every chain for itself, Eq. (13).

    Parameters
    ----------
    minimum_cosine : float
        Smallest allowed abs(cos u_i).

    Notes
    -----
    An approximation in either form: it is unbounded where cos u_i = 0, where it refuses, and
    even with the signs corrected its friction power can be negative. Use it to reproduce the
    paper, not to drive a robot.
    """

    approach: ClassVar[str] = 'independent_chains'
    minimum_cosine: float = 0.05

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
        found, geometry = state.reactions, state.reactions.robot.geometry
        k_r, k_s = found.resistances(self.joints(state.reversal))
        omega_n = relative_rate(found.u_dot, in_chain(geometry, Vector(
            *state.motion.angular_velocity.T[..., None])))
        lever = geometry.rod_length * found.cos_u
        sign = -1.0 if self.printed else 1.0
        M_s_up, M_s_n = -k_s * omega_n.k, -k_s * omega_n.n                     # Eq. (9)
        M_r_n = -k_r * found.u_dot                                            # Eq. (9)
        slides = sign * M_s_up / lever                                         # Eq. (13)
        lifts = sign * (M_s_n + M_r_n) / lever                                 # Eq. (13)
        return np.concatenate((slides, lifts), axis=1)
