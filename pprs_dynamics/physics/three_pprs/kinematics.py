# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Kinematics and reactions of the 3-PPRS in closed form, as `MechanismState` takes them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.three_pprs.geometry import Geometry
from pprs_dynamics.physics.three_pprs.inverse_kinematics import ChainKinematics, chain_table
from pprs_dynamics.physics.three_pprs.jacobians import drive_jacobian, inverse_table
from pprs_dynamics.physics.three_pprs.kernel_parameters import REVOLUTE, Joints
from pprs_dynamics.physics.three_pprs.passive_joints import solve_friction
from pprs_dynamics.physics.three_pprs.rigid_body import RigidBody


class PlatformKinematics:
    """Kinematics of the 3-PPRS along a motion, independent of its masses; evaluated lazily.

    Parameters
    ----------
    geometry : Geometry
    motion : PlatformMotion
    minimum_sine, condition_limit : float
        See `chain_table` and `inverse_table`.

    Raises
    ------
    WorkspaceError, SingularityError
        On first use, see `solve_inverse_kinematics` and `inverse_table`.
    """

    def __init__(
        self, geometry: Geometry, motion: PlatformMotion, minimum_sine: float,
        condition_limit: float,
    ) -> None:
        self.geometry, self.motion = geometry, motion
        self.minimum_sine, self.condition_limit = minimum_sine, condition_limit

    @cached_property
    def chain_table(self) -> Array:
        """Motion of the chains for kernels."""
        return chain_table(self.geometry, self.motion, self.minimum_sine)

    @cached_property
    def inverse_table(self) -> Array:
        """[B]^-1 for kernels, (N, 36)."""
        return inverse_table(self.geometry, self.chain_table, self.condition_limit)

    @cached_property
    def drive_motion(self) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration of the drives [m, m/s, m/s^2], (N, 6) each."""
        chains = self.chains
        return chains.position, chains.velocity, chains.acceleration

    @cached_property
    def chains(self) -> ChainKinematics:
        """Motion of the chains."""
        return ChainKinematics.from_table(self.chain_table)

    @cached_property
    def J(self) -> Array:
        """[J], X_dot = J q_dot, (N, 6, 6)."""
        return drive_jacobian(self.inverse_table, self.chains.sin_u)

    @property
    def tool_velocity(self) -> Array:
        """Velocity of o and angular velocity of the platform, in `base`, (N, 6)."""
        return np.concatenate((self.motion.linear_velocity, self.motion.angular_velocity), axis=1)

    def joint_position(self, joint: str) -> Array:
        """Return the angles u_i of the joints C_i, (N, 3) [rad]."""
        assert joint == REVOLUTE
        return self.chains.rod_angle

    def resistances(self, loads: RigidBody, joints: Joints) -> Array:
        """Return k_ri and k_si at the frictionless reactions, (N, 6) [N m s/rad], Eq. (9)."""
        return self._friction(loads, joints)[0]

    def friction(self, loads: RigidBody, joints: Joints) -> Array:
        """Return the drive forces against friction of passive joints, (N, 6) [N].

        By virtual power: a virtual motion of a drive moves every passive joint, Eq. (12).
        """
        return self._friction(loads, joints)[1]

    def _friction(self, loads: RigidBody, joints: Joints) -> tuple[Array, Array]:
        return solve_friction(self.geometry.kernel_parameters, joints, self.chain_table,
                              self.inverse_table, loads.reaction_table)
