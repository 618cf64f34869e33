# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in the passive joints, Eq. (9), and its drive forces, Eq. (12) or (13)."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array, Sample, Value
from pprs_dynamics.errors import SingularityError
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.mechanism.arithmetic import sqrt
from pprs_dynamics.physics.mechanism.evaluation import KernelParameters, evaluate
from pprs_dynamics.physics.mechanism.reversal import sign_over_speed
from pprs_dynamics.physics.mechanism.vectors import in_base, plus, times
from pprs_dynamics.physics.three_pprs.chains import CHAINS, each_chain
from pprs_dynamics.physics.three_pprs.closure import (
    DriveValues,
    Inverse,
    Wrench,
    power,
    read_inverse,
    rod_row,
)
from pprs_dynamics.physics.three_pprs.inverse_kinematics import ThreeChains, read_chains
from pprs_dynamics.physics.three_pprs.joint_rates import Turnover, length, relative_rate
from pprs_dynamics.physics.three_pprs.kernel_parameters import GeometryParameters
from pprs_dynamics.physics.three_pprs.state import MechanismState


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


class Resistances(NamedTuple):
    """k_ri and k_si of Eq. (9) [N m s/rad], (N, 3) each."""

    revolute: Array
    spherical: Array


class Joints(NamedTuple):
    """Parameters of `resistance_kernel`: c, mu and d of C_i and of A_i."""

    c_r: Value
    mu_r: Value
    d_r: Value
    c_s: Value
    mu_s: Value
    d_s: Value


class JointResistance(NamedTuple):
    """k_ri and k_si of one chain at one sample [N m s/rad]."""

    revolute: Value
    spherical: Value


def resistance(viscous: float, dry: Array | float, speed: Array, reversal_rate: float) -> Array:
    """Return k = c + M sgn(s)/s [N m s/rad] for dry friction M [N m]: the moment is -k s."""
    k: Array = resist(viscous, dry, sign_over_speed(speed, reversal_rate))
    return k


def resist(c: Any, dry: Value, turnover: Any) -> Any:
    """Return k = c + M sgn(s)/s for dry friction M, from the turnover sgn(s)/s."""
    return c + dry * turnover                                                  # Eq. (2), (9)


def dry_moment(mu: Value, d: Value, load: Any) -> Any:
    """Return the dry friction moment of a joint of diameter d under a load [N m]."""
    return mu * d / 2.0 * load                                                 # Eq. (1)


def joint_resistances(
    joints: Joints, H: Any, V: Any, W: Any, V_star: Any, W_star: Any, turnover: Turnover,
) -> JointResistance:
    """Return k_ri and k_si of a chain under its reactions."""
    revolute = dry_moment(joints.mu_r, joints.d_r, sqrt(V_star * V_star + W_star * W_star))
    spherical = dry_moment(joints.mu_s, joints.d_s, sqrt(H * H + V * V + W * W))
    return JointResistance(resist(joints.c_r, revolute, turnover.revolute),
                           resist(joints.c_s, spherical, turnover.spherical))


def spherical_speed(state: MechanismState) -> Array:
    """Return |omega_n| in A_i [rad/s], (N, 3)."""
    speed: Array = length(relative_rate(state.chains.u_dot, state.chains.angular_velocity))
    return speed


@each_chain
def chain_resistances(
    i: int, geometry: GeometryParameters, rods: ThreeChains, k: Any, printed: Any,
) -> Wrench:
    """Return the wrench on the platform that overcomes the friction in the joints of chain i.

    What acts about u_i is brought there by the rod's row, which gives [J_u] with [J].

    Notes
    -----
    The corrected form is exact: k_si acts on u_dot_i n_i - omega of its own chain. The printed
    form gives the same total power and another share per drive.
    """
    c, chain = rods[i], geometry.chains[i]
    k_r, k_s = k[i]
    about_u = (k_r + k_s) * c.u_dot - (1.0 + printed) * k_s * c.omega.n        # Eq. (12)
    against = relative_rate((1.0 - printed) * c.u_dot, c.omega)
    about_platform = times(-k_s, in_base(chain, against))                      # Eq. (12)
    rod = rod_row(chain, geometry.l, c.arm, c.sin_u)
    return Wrench(times(about_u, rod.force), plus(times(about_u, rod.moment), about_platform))


def friction_forces(
    geometry: GeometryParameters, rods: ThreeChains, inverse: Inverse, k: Any, printed: Any,
) -> DriveValues:
    """Return the drive forces that overcome resistances k_ri, k_si of the chains: [J]^T w."""
    a, b, c = chain_resistances(geometry, rods, k, printed)
    w = Wrench(plus(a.force, plus(b.force, c.force)), plus(a.moment, plus(b.moment, c.moment)))
    return DriveValues(_slide_forces(w, inverse),
                       _lift_forces(w, inverse, rods))


@each_chain
def _slide_forces(i: int, w: Wrench, inverse: Inverse) -> Any:
    return power(w, inverse.columns.slides[i])                                 # Eq. (11)


@each_chain
def _lift_forces(i: int, w: Wrench, inverse: Inverse, rods: ThreeChains) -> Any:
    return rods[i].sin_u * power(w, inverse.columns.lifts[i])                  # Eq. (11)


def resistance_forces(state: MechanismState, resistances: Resistances) -> Array:
    """Return the drive forces that overcome resistances in the joints, (N, 6) [N].

    By virtual power: a virtual motion of a drive moves every passive joint, Eq. (12).
    """
    return _transferred(state, np.concatenate(resistances, axis=1), printed=False)


def _transferred(state: MechanismState, k: Array, printed: bool) -> Array:
    """Return the drive forces that overcome k_r and k_s, (N, 6) [N m s/rad], (N, 6) [N]."""
    force, kinematics = np.empty(k.shape), state.kinematics
    parameters = state.robot.geometry.kernel_parameters.extended(TransferParameters, printed)
    evaluate(transfer_kernel, parameters, kinematics.chain_table, kinematics.inverse_table, k,
             force)
    return force


class TransferParameters(NamedTuple):
    """Parameters of `transfer_kernel`: `printed` is 1 for Eq. (12) to the letter, else 0."""

    geometry: GeometryParameters
    printed: Value


def transfer_kernel(
    p: TransferParameters, s: Sample, chains: Array, inverse: Array, resistances: Array,
    force: Array,
) -> Any:
    """Fill a table of forces from one of k_r, k_s."""
    _write_forces(force, s, friction_forces(
        p.geometry, read_chains(chains, s), read_inverse(inverse, s),
        _read_resistances(resistances, s), p.printed))
    return True


@each_chain
def _read_resistances(i: int, resistances: Any, s: Sample) -> JointResistance:
    return JointResistance(resistances[s, i], resistances[s, CHAINS + i])


def resistance_kernel(
    p: Joints, s: Sample, reactions: Array, turnover: Array, resistances: Array,
) -> Any:
    """Fill a table of k_r, k_s."""
    k = _resistances_at(p, reactions, turnover, s)
    for i in range(CHAINS):
        resistances[s, i], resistances[s, CHAINS + i] = k[i].revolute, k[i].spherical
    return True


@each_chain
def _resistances_at(
    i: int, joints: Joints, reactions: Any, turnover: Any, s: Sample,
) -> JointResistance:
    return joint_resistances(
        joints, reactions[s, i], reactions[s, 3 + i], reactions[s, 6 + i], reactions[s, 12 + i],
        reactions[s, 15 + i], Turnover(turnover[s, i], turnover[s, CHAINS + i]))


def _write_forces(force: Any, s: Sample, forces: DriveValues) -> None:
    for i in range(CHAINS):
        force[s, i], force[s, CHAINS + i] = forces.slides[i], forces.lifts[i]


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

    def resistances(self, state: MechanismState) -> Resistances:
        """Return k_ri and k_si at the frictionless reactions, Eq. (9)."""
        k = self._resistance_table(state)
        return Resistances(k[:, :3], k[:, 3:])

    def _resistance_table(self, state: MechanismState) -> Array:
        """Return k_r and k_s, (N, 6)."""
        k, reactions = np.empty(state.rigid_body.force.shape), state.rigid_body.reaction_table
        evaluate(resistance_kernel, KernelParameters(self.joints), reactions,
                 state.kinematics.turnover(state.reversal.rate), k)
        return k

    @cached_property
    def joints(self) -> Joints:
        """The coefficients as kernels take them."""
        return Joints(*(value for joint in (self.revolute, self.spherical)
                        for value in (joint.viscous, joint.coulomb, joint.diameter)))

    @abstractmethod
    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N]."""


@dataclass(frozen=True)
class WholeMechanismFriction(PassiveFriction):
    """The first approach: a virtual motion of a drive moves every passive joint, Eq. (12)."""

    approach: ClassVar[str] = 'whole_mechanism'

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N], by virtual power."""
        return _transferred(state, self._resistance_table(state), self.printed)


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
        omega_n = relative_rate(state.chains.u_dot, state.chains.angular_velocity)
        lever = state.robot.geometry.rod_length * state.chains.cos_u
        sign = -1.0 if self.printed else 1.0
        M_s_up, M_s_n = -k_s * omega_n.k, -k_s * omega_n.n                     # Eq. (9)
        M_r_n = -k_r * state.chains.u_dot                                      # Eq. (9)
        slides = sign * M_s_up / lever                                         # Eq. (13)
        lifts = sign * (M_s_n + M_r_n) / lever                                 # Eq. (13)
        return np.concatenate((slides, lifts), axis=1)
