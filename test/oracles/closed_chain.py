# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What both engines share: closing the cut mechanism, and projecting forces onto the drives.

The mechanism is cut at its three spherical joints into four trees: the free platform, and three
chains slide-lift-hinge. An engine supplies kinematics, Jacobians and inverse dynamics of the
trees in its own velocity coordinates; here the cuts are closed by Newton's method on the
distance between rod tips and platform points, and d'Alembert's principle does the rest.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

# Positions of half a metre carry rounding errors of a few 1e-16 m.
CLOSURE_TOLERANCE = 2e-15
MAXIMUM_STEPS = 30
HINGES = np.array([2, 5, 8])
DRIVES = np.array([0, 3, 6, 1, 4, 7])  # slides, then lifts, among (slide, lift, hinge) x 3


@dataclass
class OracleForces:
    """What an engine says about N states.

    Parameters
    ----------
    force : (N, 6) array
        Frictionless drive forces [N].
    passive : (N, 6) array
        Drive forces against viscous friction of the passive joints [N].
    position, velocity, acceleration : (N, 6) arrays
        Of the drives [m, m/s, m/s^2].
    """

    force: np.ndarray
    passive: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class ClosedChain(ABC):
    """A 3-PPRS in an engine, cut at the spherical joints.

    Velocity coordinates are the platform's six, in whatever frame the engine takes, then
    (slide, lift, hinge) per chain. A hinge angle of 0 is a rod that points up, pi one that
    points down.
    """

    def __init__(self, robot) -> None:
        self.robot = robot

    # What the engine supplies -----------------------------------------------------------------

    @abstractmethod
    def place(self, position, quaternion, chains) -> None:
        """Set the configuration and compute positions; quaternion as x, y, z, w."""

    @abstractmethod
    def gaps(self) -> np.ndarray:
        """Return rod tips minus platform points, (9,) [m]."""

    @abstractmethod
    def gap_jacobian(self) -> np.ndarray:
        """Return the derivative of `gaps` with respect to the velocities, (9, 15)."""

    @abstractmethod
    def platform_velocity(self, v, omega) -> np.ndarray:
        """Return the engine's six platform velocities for a twist in the base frame."""

    @abstractmethod
    def platform_acceleration(self, v, omega, a, epsilon) -> np.ndarray:
        """Return the engine's six platform accelerations for classical ones in the base frame."""

    @abstractmethod
    def gap_drift(self, velocity) -> np.ndarray:
        """Return the second derivative of `gaps` at zero engine acceleration, (9,)."""

    @abstractmethod
    def inverse_dynamics(self, velocity, acceleration) -> np.ndarray:
        """Return the generalised forces of the open trees, (15,)."""

    @abstractmethod
    def joint_rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Return Jacobians (3, 3, 15) of rod against lift, and of rod against platform."""

    # What follows from it ---------------------------------------------------------------------

    def solve(self, motion, c_revolute=0.0, c_spherical=0.0) -> OracleForces:
        """Return forces and drive motion for every sample of a platform motion."""
        rows = [self._solve_one(motion, sample, c_revolute, c_spherical)
                for sample in range(len(motion.position))]
        return OracleForces(*(np.array(column) for column in zip(*rows, strict=True)))

    def _solve_one(self, motion, sample, c_revolute, c_spherical):
        P, quaternion = motion.position[sample], motion.orientation[sample]
        v, omega = motion.linear_velocity[sample], motion.angular_velocity[sample]
        a, epsilon = motion.linear_acceleration[sample], motion.angular_acceleration[sample]
        chains = self._close(P, quaternion)
        gap_jacobian = self.gap_jacobian()
        of_platform, of_chains = gap_jacobian[:, :6], gap_jacobian[:, 6:]
        follow = -np.linalg.solve(of_chains, of_platform)  # chain velocities per platform velocity
        platform = self.platform_velocity(v, omega)
        velocity = np.concatenate((platform, follow @ platform))
        platform = self.platform_acceleration(v, omega, a, epsilon)
        drift = np.linalg.solve(of_chains, self.gap_drift(velocity))
        acceleration = np.concatenate((platform, follow @ platform - drift))
        # All velocities per drive velocity: the rows of the drives form the unit matrix.
        all_per_platform = np.concatenate((np.eye(6), follow))
        force = self.inverse_dynamics(velocity, acceleration)
        revolute, spherical = self.joint_rates()
        damping = (c_revolute * np.einsum('ckv,ckw->vw', revolute, revolute)
                   + c_spherical * np.einsum('ckv,ckw->vw', spherical, spherical)) @ velocity
        projected = np.linalg.solve(
            follow[DRIVES].T, all_per_platform.T @ np.stack((force, damping), axis=1))
        chain_velocity, chain_acceleration = velocity[6:], acceleration[6:]
        return (projected[:, 0], projected[:, 1], chains[DRIVES], chain_velocity[DRIVES],
                chain_acceleration[DRIVES])

    def _close(self, position, quaternion) -> np.ndarray:
        """Move the chains until their tips meet the platform, and leave the engine there."""
        geometry = self.robot.geometry
        up = geometry.elbow == 'up'
        chains = np.zeros(9)
        chains[1::3] = position[2] - (1 if up else -1) * geometry.rod_length
        chains[HINGES] = 0.0 if up else np.pi
        best, best_chains = np.inf, chains
        for _ in range(MAXIMUM_STEPS):
            self.place(position, quaternion, chains)
            gaps = self.gaps()
            size = np.abs(gaps).max()
            if size >= best and best < CLOSURE_TOLERANCE:
                break  # only rounding is left
            if size < best:
                best, best_chains = size, chains.copy()
            chains = chains - np.linalg.solve(self.gap_jacobian()[:, 6:], gaps)
        assert best < CLOSURE_TOLERANCE, f'the engine did not close its chains: {best} m'
        leaning = np.cos(best_chains[HINGES])
        assert np.all(leaning > 0 if up else leaning < 0), 'the engine closed the other elbow'
        self.place(position, quaternion, best_chains)
        return best_chains
