"""From the platform's motion to the motion of drives and rods: Eq. (3) and its derivatives.

In chain i, with unit vectors e_i (radial), n_i (revolute axis) and k (up):
C_i = R e_i + q_i n_i + q_(i+3) k and A_i = C_i + l (-cos u_i e_i + sin u_i k).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.errors import SingularityError, WorkspaceError
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.robot import Array, ChainVector, Geometry, add, cross


@dataclass(frozen=True)
class ChainKinematics:
    """Motion of every chain; all arrays (N, 3), chains last.

    Parameters
    ----------
    arm : ChainVector
        rho_i = A_i - P, from the platform's origin to the spherical joint [m].
    cos_u, sin_u : (N, 3) arrays
        Cosine and sine of the rod angle u_i.
    u_dot, u_ddot : (N, 3) arrays
        Rate and acceleration of u_i [rad/s, rad/s^2].
    position, velocity, acceleration : (N, 6) arrays
        Of the drives, in drive order [m, m/s, m/s^2].
    angular_velocity : ChainVector
        omega in every chain frame [rad/s].
    """

    arm: ChainVector
    cos_u: Array
    sin_u: Array
    u_dot: Array
    u_ddot: Array
    position: Array
    velocity: Array
    acceleration: Array
    angular_velocity: ChainVector

    @property
    def rod_direction(self) -> ChainVector:
        """Unit vectors d_i along the rods, from C_i to A_i."""
        return ChainVector(-self.cos_u, np.zeros_like(self.cos_u), self.sin_u)

    @property
    def rod_normal(self) -> ChainVector:
        """Unit vectors w_i: minus the direction in which the rod's tip moves as u_i grows."""
        return ChainVector(-self.sin_u, np.zeros_like(self.cos_u), -self.cos_u)

    @property
    def rod_angle(self) -> Array:
        """u_i [rad], (N, 3)."""
        angle: Array = np.arctan2(self.sin_u, self.cos_u)
        return angle


def spherical_joint_arms(geometry: Geometry, rotation: Array) -> Array:
    """Return rho_i = Rot r e'_i in `base`, (N, 3, 3): samples, chains, components."""
    arms = geometry.platform_radius * np.stack(
        (np.cos(geometry.platform_angles), np.sin(geometry.platform_angles)))
    # Only the first two columns of Rot act: the spherical joints lie in the platform's plane.
    arm: Array = np.swapaxes(rotation[..., :2] @ arms, 1, 2)
    return arm


@dataclass(frozen=True)
class JointPositions:
    """Where the joints are, in `base`; each (N, 3, 3): samples, chains, components [m].

    `foot` is the slide on its guide at height 0, `elbow` C_i on the lift, `tip` A_i.
    """

    foot: Array
    elbow: Array
    tip: Array


def joint_positions(geometry: Geometry, motion: PlatformMotion) -> JointPositions:
    """Return the joints' positions at the poses of a motion, to draw the mechanism."""
    chains = solve_inverse_kinematics(geometry, motion)
    slide, lift = chains.position[:, :3], chains.position[:, 3:]
    R, zero = np.full_like(slide, geometry.base_radius), np.zeros_like(slide)
    base = geometry.frames.base
    tip = motion.position[:, None, :] + base(chains.arm)
    return JointPositions(base(ChainVector(R, slide, zero)), base(ChainVector(R, slide, lift)), tip)


def solve_inverse_kinematics(
    geometry: Geometry, motion: PlatformMotion, minimum_sine: float = 1e-6,
) -> ChainKinematics:
    """Return the motion of drives and rods that belongs to a platform motion, Eq. (3) and (4).

    Parameters
    ----------
    geometry : Geometry
    motion : PlatformMotion
    minimum_sine : float
        Smallest allowed abs(sin u_i); rates grow without bound towards 0.

    Raises
    ------
    WorkspaceError
        Where a rod is too short to reach: abs(R - A_i . e_i) > l.
    SingularityError
        Where abs(sin u_i) < `minimum_sine`: the rod lies (almost) horizontally.
    """
    R, l = geometry.base_radius, geometry.rod_length
    frames = geometry.frames
    rho = frames.components(spherical_joint_arms(geometry, motion.rotation))
    omega = frames.components(motion.angular_velocity)
    epsilon = frames.components(motion.angular_acceleration)
    A = add(frames.components(motion.position), rho)

    cos_u = (R - A.e) / l
    _require_reach(cos_u, A.e, geometry)
    sin_u = geometry.elbow_sign * np.sqrt(1.0 - cos_u * cos_u)
    _require_upright_rods(sin_u, minimum_sine)
    q_slide = A.n                                                              # Eq. (3)
    q_lift = A.k - l * sin_u                                                   # Eq. (3)

    spin = cross(omega, rho)
    v_A = add(frames.components(motion.linear_velocity), spin)
    u_dot = v_A.e / (l * sin_u)
    q_slide_dot = v_A.n                                                        # Eq. (4)
    q_lift_dot = v_A.k - l * cos_u * u_dot                                     # Eq. (4)

    a_A = add(frames.components(motion.linear_acceleration),
              add(cross(epsilon, rho), cross(omega, spin)))
    u_ddot = (a_A.e / l - cos_u * u_dot * u_dot) / sin_u
    q_slide_ddot = a_A.n
    q_lift_ddot = a_A.k - l * (cos_u * u_ddot - sin_u * u_dot * u_dot)
    return ChainKinematics(
        rho, cos_u, sin_u, u_dot, u_ddot,
        np.concatenate((q_slide, q_lift), axis=1),
        np.concatenate((q_slide_dot, q_lift_dot), axis=1),
        np.concatenate((q_slide_ddot, q_lift_ddot), axis=1), omega)


def _require_reach(cos_u: Array, A_e: Array, geometry: Geometry) -> None:
    beyond = ~(np.abs(cos_u) <= 1.0)
    if np.any(beyond):
        sample, chain = (int(i) for i in np.argwhere(beyond)[0])
        raise WorkspaceError(
            sample, f'the rod of chain {chain + 1} would have to span '
            f'{abs(geometry.base_radius - A_e[sample, chain]):.6g} m radially',
            f'its length is geometry.rod_length = {geometry.rod_length:g} m')


def _require_upright_rods(sin_u: Array, minimum: float) -> None:
    flat = np.abs(sin_u) < minimum
    if np.any(flat):
        sample, chain = (int(i) for i in np.argwhere(flat)[0])
        raise SingularityError(
            sample, f'|sin u| of chain {chain + 1} is {abs(sin_u[sample, chain]):.3g} '
            '(its rod lies horizontally)', f'it must be at least {minimum:g} (limits.rod_sine)')
