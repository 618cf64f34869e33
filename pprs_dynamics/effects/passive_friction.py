"""Friction in the passive joints: Eq. (9), and its way to the drives by Eq. (12) or (13)."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.effects.effect import Effect
from pprs_dynamics.errors import SingularityError
from pprs_dynamics.mechanism.arithmetic import sqrt
from pprs_dynamics.mechanism.closure import Inverse, Six, Wrench, power, read_inverse, rod_row
from pprs_dynamics.mechanism.evaluation import evaluate
from pprs_dynamics.mechanism.inverse_kinematics import ChainSample, read_chain
from pprs_dynamics.mechanism.joint_rates import Turnover, length, relative_rate
from pprs_dynamics.mechanism.numbers import Chain, chain
from pprs_dynamics.mechanism.reversal import sign_over_speed
from pprs_dynamics.mechanism.state import MechanismState
from pprs_dynamics.mechanism.vectors import in_base, plus, times


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


class Resistances(NamedTuple):
    """k_ri and k_si of Eq. (9) [N m s/rad], (N, 3) each."""

    revolute: Array
    spherical: Array


class Joints(NamedTuple):
    """c, mu and d of C_i and of A_i, for kernels."""

    c_r: Any
    mu_r: Any
    d_r: Any
    c_s: Any
    mu_s: Any
    d_s: Any


def resistance(viscous: float, dry: Array | float, speed: Array, reversal_rate: float) -> Array:
    """Return k = c + M sgn(s)/s [N m s/rad] for dry friction M [N m]: the moment is -k s."""
    k: Array = resist(viscous, dry, sign_over_speed(speed, reversal_rate))
    return k


def resist(c: Any, dry: Any, turnover: Any) -> Any:
    """Return the same from sgn(s)/s."""
    return c + dry * turnover                                                  # Eq. (2), (9)


def dry_moment(mu: Any, d: Any, load: Any) -> Any:
    """Return the dry friction moment of a joint of diameter d under a load [N m]."""
    return mu * d / 2.0 * load                                                 # Eq. (1)


def joint_resistances(
    joints: Joints, H: Any, V: Any, W: Any, V_star: Any, W_star: Any, turnover: Turnover,
) -> tuple[Any, Any]:
    """Return k_ri and k_si of a chain under its reactions."""
    revolute = dry_moment(joints.mu_r, joints.d_r, sqrt(V_star * V_star + W_star * W_star))
    spherical = dry_moment(joints.mu_s, joints.d_s, sqrt(H * H + V * V + W * W))
    return (resist(joints.c_r, revolute, turnover.revolute),
            resist(joints.c_s, spherical, turnover.spherical))


def spherical_speed(state: MechanismState) -> Array:
    """Return |omega_n| in A_i [rad/s], (N, 3)."""
    speed: Array = length(relative_rate(state.chains.u_dot, state.chains.angular_velocity))
    return speed


def chain_resistance(
    k: Chain, l: Any, c: ChainSample, k_r: Any, k_s: Any, printed: Any,
) -> Wrench:
    """Return the wrench on the platform that overcomes the friction in a chain's joints.

    What acts about u_i is brought there by the rod's row, which gives [J_u] with [J].

    Notes
    -----
    The corrected form is exact: k_si acts on u_dot_i n_i - omega of its own chain. The printed
    form gives the same total power and another share per drive.
    """
    about_u = (k_r + k_s) * c.u_dot - (1.0 + printed) * k_s * c.omega.n        # Eq. (12)
    against = relative_rate((1.0 - printed) * c.u_dot, c.omega)
    about_platform = times(-k_s, in_base(k, against))                          # Eq. (12)
    rod = rod_row(k, l, c.arm, c.sin_u)
    return Wrench(times(about_u, rod.force), plus(times(about_u, rod.moment), about_platform))


def drive_forces_of(
    inverse: Inverse, s1: Any, s2: Any, s3: Any, a: Wrench, b: Wrench, c: Wrench,
) -> Six:
    """Return the drive forces [J]^T w that put three wrenches on the platform; s is sin u."""
    w = Wrench(plus(a.force, plus(b.force, c.force)), plus(a.moment, plus(b.moment, c.moment)))
    return Six(
        power(w, inverse.slide_1), power(w, inverse.slide_2), power(w, inverse.slide_3),
        s1 * power(w, inverse.lift_1), s2 * power(w, inverse.lift_2),
        s3 * power(w, inverse.lift_3))                                         # Eq. (11)


def overcome(state: MechanismState, resistances: Resistances, printed: bool = False) -> Array:
    """Return the drive forces that overcome resistances in the joints, (N, 6) [N].

    By virtual power: a virtual motion of a drive moves every passive joint, Eq. (12).
    """
    k = np.concatenate(resistances, axis=1)
    force, kinematics = np.empty(k.shape), state.kinematics
    evaluate(overcome_kernel, np.append(state.robot.geometry.numbers, float(printed)),
             kinematics.chain_table, kinematics.inverse_table, k, force)
    return force


def overcome_kernel(
    p: Any, s: Any, chains: Any, inverse: Any, resistances: Any, force: Any,
) -> Any:
    """Fill a table of forces from one of k_r, k_s; p is the geometry, then `printed`."""
    l, printed = p[1], p[24]
    one, two, three = read_chain(chains, s, 0), read_chain(chains, s, 1), read_chain(chains, s, 2)
    write_six(force, s, drive_forces_of(
        read_inverse(inverse, s), one.sin_u, two.sin_u, three.sin_u,
        chain_resistance(chain(p, 0), l, one, resistances[s, 0], resistances[s, 3], printed),
        chain_resistance(chain(p, 1), l, two, resistances[s, 1], resistances[s, 4], printed),
        chain_resistance(chain(p, 2), l, three, resistances[s, 2], resistances[s, 5], printed)))
    return True


def resistance_kernel(p: Any, s: Any, reactions: Any, turnover: Any, resistances: Any) -> Any:
    """Fill a table of k_r, k_s; p holds the numbers of `Joints`."""
    joints = joints_of(p, 0)
    for i in range(3):
        resistances[s, i], resistances[s, 3 + i] = _resistances_at(
            joints, reactions, turnover, s, i)
    return True


def passive_kernel(
    p: Any, s: Any, chains: Any, inverse: Any, reactions: Any, turnover: Any, force: Any,
) -> Any:
    """Do what `resistance_kernel` and `overcome_kernel` do; p is as for both, joints last."""
    l, printed, joints = p[1], p[24], joints_of(p, 25)
    one, two, three = read_chain(chains, s, 0), read_chain(chains, s, 1), read_chain(chains, s, 2)
    k_r1, k_s1 = _resistances_at(joints, reactions, turnover, s, 0)
    k_r2, k_s2 = _resistances_at(joints, reactions, turnover, s, 1)
    k_r3, k_s3 = _resistances_at(joints, reactions, turnover, s, 2)
    write_six(force, s, drive_forces_of(
        read_inverse(inverse, s), one.sin_u, two.sin_u, three.sin_u,
        chain_resistance(chain(p, 0), l, one, k_r1, k_s1, printed),
        chain_resistance(chain(p, 1), l, two, k_r2, k_s2, printed),
        chain_resistance(chain(p, 2), l, three, k_r3, k_s3, printed)))
    return True


def _resistances_at(
    joints: Joints, reactions: Any, turnover: Any, s: Any, i: int,
) -> tuple[Any, Any]:
    return joint_resistances(
        joints, reactions[s, i], reactions[s, 3 + i], reactions[s, 6 + i], reactions[s, 12 + i],
        reactions[s, 15 + i], Turnover(turnover[s, i], turnover[s, 3 + i]))


def joints_of(p: Any, k: int) -> Joints:
    """Return the joints' numbers in a row from element k on."""
    return Joints(p[k], p[k + 1], p[k + 2], p[k + 3], p[k + 4], p[k + 5])


def write_six(force: Any, s: Any, six: Six) -> None:
    """Write the drive forces of sample s to a table."""
    force[s, 0], force[s, 1], force[s, 2] = six.slide_1, six.slide_2, six.slide_3
    force[s, 3], force[s, 4], force[s, 5] = six.lift_1, six.lift_2, six.lift_3


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
        k = np.empty(state.rigid_body.force.shape)
        evaluate(resistance_kernel, self.numbers, state.rigid_body.reaction_table,
                 state.kinematics.turnover(state.reversal.rate), k)
        return Resistances(k[:, :3], k[:, 3:])

    @cached_property
    def numbers(self) -> Array:
        """What kernels take, see `Joints`."""
        return np.array([value for joint in (self.revolute, self.spherical)
                         for value in (joint.viscous, joint.coulomb, joint.diameter)])

    @abstractmethod
    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N]."""


@dataclass(frozen=True)
class WholeMechanismFriction(PassiveFriction):
    """The first approach: a virtual motion of a drive moves every passive joint, Eq. (12)."""

    approach: ClassVar[str] = 'whole_mechanism'

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N], by virtual power."""
        kinematics, reactions = state.kinematics, state.rigid_body.reaction_table
        force = np.empty((len(reactions), 6))
        evaluate(passive_kernel, np.concatenate((
            state.robot.geometry.numbers, [self.printed], self.numbers)),
            kinematics.chain_table, kinematics.inverse_table, reactions,
            kinematics.turnover(state.reversal.rate), force)
        return force


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
