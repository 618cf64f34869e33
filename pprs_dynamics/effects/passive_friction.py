"""Friction in the passive joints: Eq. (9), and its way to the drives by Eq. (12) or (13)."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pprs_dynamics.effects.effect import Effect
from pprs_dynamics.errors import SingularityError
from pprs_dynamics.mechanism.reversal import sign_over_speed
from pprs_dynamics.mechanism.robot import Array, ChainVector
from pprs_dynamics.mechanism.state import MechanismState


@dataclass(frozen=True)
class JointFriction:
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

    def resistance(self, load: Array, speed: Array, reversal_rate: float) -> Array:
        """Return k = c + mu d/2 N sgn(s)/s [N m s/rad], so that the moment is -k s."""
        dry = self.coulomb * self.diameter / 2 * load                          # Eq. (1)
        return resistance(self.viscous, dry, speed, reversal_rate)


class Resistances(NamedTuple):
    """k_ri and k_si of Eq. (9) [N m s/rad], (N, 3) each."""

    revolute: Array
    spherical: Array


def resistance(viscous: float, dry: Array | float, speed: Array, reversal_rate: float) -> Array:
    """Return k = c + M sgn(s)/s [N m s/rad] for dry friction M [N m]: the moment is -k s."""
    k: Array = viscous + dry * sign_over_speed(speed, reversal_rate)           # Eq. (2), (9)
    return k


def relative_rate(state: MechanismState) -> ChainVector:
    """Return omega_n = u_dot_i n_i - omega, of the rod relative to the platform [rad/s]."""
    omega = state.chains.angular_velocity
    return ChainVector(-omega.e, state.chains.u_dot - omega.n, -omega.k)       # Eq. (9)


def spherical_speed(state: MechanismState) -> Array:
    """Return |omega_n| in A_i [rad/s], (N, 3)."""
    omega_n = relative_rate(state)
    speed: Array = np.sqrt(omega_n.e ** 2 + omega_n.n ** 2 + omega_n.k ** 2)
    return speed


def overcome(state: MechanismState, resistances: Resistances, printed: bool = False) -> Array:
    """Return the drive forces that overcome resistances in the joints, (N, 6) [N].

    By virtual power: a virtual motion of a drive moves every passive joint, Eq. (12).

    Notes
    -----
    The corrected form is exact: k_si acts on u_dot_i n_i - omega of its own chain. The printed
    form gives the same total power and another share per drive.
    """
    k_r, k_s = resistances
    u_dot, omega = state.chains.u_dot, state.motion.angular_velocity
    omega_n = state.chains.angular_velocity.n
    if printed:
        about_u = (k_r + k_s) * u_dot - 2 * k_s * omega_n                      # Eq. (12)
        about_platform = k_s.sum(axis=1, keepdims=True) * omega                # Eq. (12)
    else:
        relative = state.robot.geometry.frames.base(relative_rate(state))
        about_u = (k_r + k_s) * u_dot - k_s * omega_n                          # Eq. (12)
        about_platform = -np.einsum('ni,nij->nj', k_s, relative)               # Eq. (12)
    jacobians = state.jacobians
    force: Array = (np.einsum('nij,ni->nj', jacobians.J_u, about_u)
                    + np.einsum('nij,ni->nj', jacobians.J_omega, about_platform))
    return force


@dataclass(frozen=True)
class PassiveFriction(Effect):
    """Viscous and load-dependent Coulomb friction of the passive joints.

    Parameters
    ----------
    revolute, spherical : JointFriction
        In C_i and A_i.
    printed : bool
        Take the equations to the letter, misprints included.
    """

    name: ClassVar[str] = 'passive_friction'
    approach: ClassVar[str]
    revolute: JointFriction
    spherical: JointFriction
    printed: bool = False

    def resistances(self, state: MechanismState) -> Resistances:
        """Return k_ri and k_si at the frictionless reactions, Eq. (9)."""
        r, chains, rate = state.rigid_body.reactions, state.chains, state.reversal.rate
        k_r = self.revolute.resistance(
            np.sqrt(r.V_star ** 2 + r.W_star ** 2), np.abs(chains.u_dot), rate)
        k_s = self.spherical.resistance(
            np.sqrt(r.H ** 2 + r.V ** 2 + r.W ** 2), spherical_speed(state), rate)
        return Resistances(k_r, k_s)

    @abstractmethod
    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N]."""


@dataclass(frozen=True)
class WholeMechanismFriction(PassiveFriction):
    """The first approach: a virtual motion of a drive moves every passive joint, Eq. (12)."""

    approach: ClassVar[str] = 'whole_mechanism'

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N], by virtual power."""
        return overcome(state, self.resistances(state), self.printed)


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
    even with the signs mended its friction power can be negative. Use it to reproduce the
    paper, not to drive a robot.
    """

    approach: ClassVar[str] = 'independent_chains'
    minimum_cosine: float = 0.05

    def singular(self, state: MechanismState) -> np.ndarray:
        """Return the samples at which this approach is not defined, (N,) bool."""
        mask: np.ndarray = np.any(np.abs(state.chains.cos_u) < self.minimum_cosine, axis=1)
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
            smallest = np.abs(state.chains.cos_u[sample])
            raise SingularityError(
                sample, f'|cos u| of chain {int(np.argmin(smallest)) + 1} is '
                f'{smallest.min():.3g}, where friction.approach independent_chains is unbounded',
                f'limits.rod_cosine is {self.minimum_cosine:g}')
        k_r, k_s = self.resistances(state)
        omega_n = relative_rate(state)
        lever = state.robot.geometry.rod_length * state.chains.cos_u
        sign = -1.0 if self.printed else 1.0
        M_s_up, M_s_n = -k_s * omega_n.k, -k_s * omega_n.n                     # Eq. (9)
        M_r_n = -k_r * state.chains.u_dot                                      # Eq. (9)
        slides = sign * M_s_up / lever                                         # Eq. (13)
        lifts = sign * (M_s_n + M_r_n) / lever                                 # Eq. (13)
        return np.concatenate((slides, lifts), axis=1)
