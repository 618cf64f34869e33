# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motion, Jacobians and frictionless forces of the mechanism, as effects take them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.reversal import Reversal, smooth_sign
from pprs_dynamics.physics.mechanism.structure_load import StructureLoad
from pprs_dynamics.physics.three_pprs.forward_motion import platform_rates
from pprs_dynamics.physics.three_pprs.inverse_kinematics import ChainKinematics, chain_table
from pprs_dynamics.physics.three_pprs.jacobians import Jacobians, inverse_table
from pprs_dynamics.physics.three_pprs.joint_rates import turnover_table
from pprs_dynamics.physics.three_pprs.kernel_parameters import REVOLUTE, Joints
from pprs_dynamics.physics.three_pprs.passive_joints import resistance_table, transferred
from pprs_dynamics.physics.three_pprs.rigid_body import RigidBody, solve_bodies
from pprs_dynamics.physics.three_pprs.robot import Geometry, Robot

POSITION_STEP = 3e-5  # of a rod's length, for derivatives by a drive's position


class MechanismKinematics:
    """Kinematics of a mechanism along a motion, independent of its masses; evaluated lazily.

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
    def drive_motion(self) -> tuple[Array, ...]:
        """Position, velocity and acceleration of the drives [m, m/s, m/s^2], (N, 6) each."""
        chains = self.chains
        return chains.position, chains.velocity, chains.acceleration

    @cached_property
    def chains(self) -> ChainKinematics:
        """Motion of the chains."""
        return ChainKinematics.from_table(self.chain_table)

    @cached_property
    def jacobians(self) -> Jacobians:
        """Jacobians of the mechanism."""
        return Jacobians(self.geometry, self.chains, self.inverse_table.reshape(-1, 6, 6))

    def direction(self, width: float | tuple[float, ...]) -> Array:
        """Return sgn of the drive velocities, (N, 6), turning over within widths [m/s]."""
        return self._kept('direction', width, lambda: np.asarray(
            smooth_sign(self.chains.velocity, np.asarray(width))))

    def turnover(self, width: float) -> Array:
        """Return sgn(s) / s of the joints C_i, then A_i, (N, 6), within `width` [rad/s]."""
        return self._kept('turnover', width, lambda: turnover_table(self.chain_table, width))

    def _kept(self, name: str, width: Any, found: Callable[[], Array]) -> Array:
        kept: tuple[Any, Array] | None = self.__dict__.get(f'_{name}')
        if kept is None or not np.array_equal(kept[0], width):
            # The last one only: a fit tries many widths.
            kept = self.__dict__[f'_{name}'] = (width, found())
        return kept[1]


@dataclass(frozen=True, eq=False)
class ThreePprsState:
    """Motion, Jacobians and frictionless forces at N samples.

    Drive quantities (`position`, `velocity`, `acceleration`, `friction_load`) are (N, 6) in drive
    order; chain quantities (N, 3).
    """

    robot: Robot
    motion: PlatformMotion
    kinematics: MechanismKinematics
    reversal: Reversal
    printed: bool = False
    load: StructureLoad | None = None

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return DRIVES

    @property
    def chains(self) -> ChainKinematics:
        """Motion of drives and rods."""
        return self.kinematics.chains

    @property
    def jacobians(self) -> Jacobians:
        """Jacobians of the mechanism."""
        return self.kinematics.jacobians

    @cached_property
    def rigid_body(self) -> RigidBody:
        """Frictionless drive forces and reactions."""
        return solve_bodies(self.robot, self.motion, self.kinematics.chain_table,
                            self.kinematics.inverse_table, self.printed, self.load)

    @property
    def rigid_force(self) -> Array:
        """Frictionless drive forces [N], (N, 6)."""
        return self.rigid_body.force

    @property
    def time(self) -> Array | None:
        """Times of the samples [s], (N,), where known."""
        return self.motion.time

    @property
    def channels(self) -> Mapping[str, Array]:
        """What was measured of the drives beside their motion."""
        return self.motion.channels

    @property
    def position(self) -> Array:
        """Drive positions q [m]."""
        return self.kinematics.drive_motion[0]

    @property
    def velocity(self) -> Array:
        """Drive velocities [m/s]."""
        return self.kinematics.drive_motion[1]

    @property
    def acceleration(self) -> Array:
        """Drive accelerations [m/s^2]."""
        return self.kinematics.drive_motion[2]

    @property
    def friction_load(self) -> Array:
        """Normal forces on the drives' guides [N]."""
        return self.rigid_body.guide_load

    @property
    def transmitted(self) -> Array:
        """Forces that the drives' screws pass on, without friction [N]."""
        return self.rigid_body.force

    @property
    def direction(self) -> Array:
        """Sign of the drive velocities, sgn, turning over within the reversal velocity."""
        return self.kinematics.direction(self.reversal.velocity)

    def __getitem__(self, samples: Any) -> ThreePprsState:
        """Return the samples that a slice, a mask or indices select, with their load."""
        return replace(self._along(self.motion[samples]),
                       load=None if self.load is None else self.load.at(samples))

    def _along(self, motion: PlatformMotion) -> ThreePprsState:
        """Return a state of the same robot along another motion."""
        kinematics = self.kinematics
        return replace(self, motion=motion, kinematics=MechanismKinematics(
            kinematics.geometry, motion, kinematics.minimum_sine, kinematics.condition_limit))

    @property
    def position_step(self) -> float:
        """By which a drive is moved for derivatives [m]."""
        return POSITION_STEP * self.robot.geometry.rod_length

    def perturbed(self, drive: int, step: float) -> ThreePprsState:
        """Return the state with a drive at other positions, to first order; all move as before."""
        from scipy.spatial.transform import Rotation  # here: commands start without it

        move = step * self.jacobians.J[:, :, drive]
        turned = Rotation.from_quat(self.motion.orientation)
        rates = platform_rates(self.robot.geometry, PlatformMotion.at_rest(
            self.motion.position + move[:, :3],
            (Rotation.from_rotvec(move[:, 3:]) * turned).as_quat()),
            self.velocity, self.acceleration).with_channels(self.channels)
        return self._along(rates if self.time is None else rates.with_time(self.time))

    def accelerated(self, drive: int, change: float) -> ThreePprsState:
        """Return the state with another acceleration of a drive."""
        rates = platform_rates(
            self.robot.geometry, self.motion, self.velocity,
            self.acceleration + change * np.eye(6)[drive]).with_channels(self.channels)
        return self._along(rates if self.time is None else rates.with_time(self.time))

    @property
    def tool_velocity(self) -> Array:
        """Velocity of o and angular velocity of the platform, in `base`, (N, 6)."""
        return np.concatenate((self.motion.linear_velocity, self.motion.angular_velocity), axis=1)

    def joint_position(self, joint: str) -> Array:
        """Return the angles u_i of the joints C_i, (N, 3) [rad]."""
        assert joint == REVOLUTE
        angle: Array = np.arctan2(self.chains.sin_u, self.chains.cos_u)
        return angle

    def resistances(self, joints: Joints) -> Array:
        """Return k_ri and k_si at the frictionless reactions, (N, 6) [N m s/rad], Eq. (9)."""
        return resistance_table(joints, self.rigid_body.reaction_table,
                                self.kinematics.turnover(self.reversal.rate))

    def against_friction(self, joints: Joints, printed: bool = False) -> Array:
        """Return the drive forces against friction of passive joints, (N, 6) [N].

        By virtual power: a virtual motion of a drive moves every passive joint, Eq. (12).
        """
        return transferred(self.robot.geometry.kernel_parameters, self.kinematics.chain_table,
                           self.kinematics.inverse_table, self.resistances(joints), printed)

    def with_smoothing(self, reversal: Reversal) -> ThreePprsState:
        """Return the state with a sgn of other widths; all else is computed once for both."""
        state = replace(self, reversal=reversal)
        vars(state)['rigid_body'] = self.rigid_body
        return state

    def with_load(self, robot: Robot, load: StructureLoad | None = None) -> ThreePprsState:
        """Return a state of this motion with other bodies, and with an additional load.

        The robot must have the geometry that the state was solved for.
        """
        if load is None:
            load = self.load
        elif self.load is not None:
            load = self.load + load
        return replace(self, robot=robot, load=load)


def solve_mechanism(
    robot: Robot, motion: PlatformMotion, *, reversal: Reversal | None = None,
    printed: bool = False, minimum_sine: float = 1e-6, condition_limit: float = np.inf,
) -> ThreePprsState:
    """Return the state of the mechanism for a platform motion.

    Raises
    ------
    WorkspaceError, SingularityError
        See `solve_inverse_kinematics` and `inverse_table`.
    """
    kinematics = MechanismKinematics(robot.geometry, motion, minimum_sine, condition_limit)
    state = ThreePprsState(robot, motion, kinematics, reversal or Reversal(), printed)
    _ = kinematics.inverse_table
    return state
