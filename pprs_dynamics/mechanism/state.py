"""Everything that one evaluation of the mechanism yields, shared by all effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from pprs_dynamics.mechanism.inverse_kinematics import ChainKinematics, solve_inverse_kinematics
from pprs_dynamics.mechanism.jacobians import Jacobians, compute_jacobians
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.reversal import Reversal, smooth_sign
from pprs_dynamics.mechanism.rigid_body import RigidBody, StructureLoad, solve_inverse_dynamics
from pprs_dynamics.mechanism.robot import DRIVES, Array, Robot


class DriveStates(Protocol):
    """What effects on drives look at: N samples of D drives, whatever they move."""

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""

    @property
    def time(self) -> Array | None:
        """[s], (N,), where known."""

    @property
    def position(self) -> Array:
        """[m], (N, D)."""

    @property
    def velocity(self) -> Array:
        """[m/s], (N, D)."""

    @property
    def acceleration(self) -> Array:
        """[m/s^2], (N, D)."""

    @property
    def direction(self) -> Array:
        """sgn of the velocities, (N, D)."""

    @property
    def guide_load(self) -> Array:
        """[N], (N, D)."""


@dataclass(frozen=True)
class MechanismState:
    """Motion, Jacobians and frictionless forces at N samples.

    Drive quantities (`position`, `velocity`, `acceleration`, `guide_load`) are (N, 6) in drive
    order; chain quantities (N, 3).
    """

    robot: Robot
    motion: PlatformMotion
    chains: ChainKinematics
    jacobians: Jacobians
    rigid_body: RigidBody
    reversal: Reversal
    printed: bool = False
    load: StructureLoad | None = None

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return DRIVES

    @property
    def time(self) -> Array | None:
        """Times of the samples [s], (N,), where known."""
        return self.motion.time

    @property
    def position(self) -> Array:
        """Drive positions q [m]."""
        return self.chains.position

    @property
    def velocity(self) -> Array:
        """Drive velocities [m/s]."""
        return self.chains.velocity

    @property
    def acceleration(self) -> Array:
        """Drive accelerations [m/s^2]."""
        return self.chains.acceleration

    @property
    def guide_load(self) -> Array:
        """Normal forces on the drives' guides [N]."""
        return self.rigid_body.guide_load

    @cached_property
    def direction(self) -> Array:
        """sgn of the drive velocities, turning over within the reversal velocity."""
        return smooth_sign(self.velocity, np.asarray(self.reversal.velocity))

    def loaded(self, robot: Robot, load: StructureLoad | None = None) -> MechanismState:
        """Return the same motion with other bodies, and with a load more.

        The robot must have the geometry that the state was solved for.
        """
        if load is None:
            load = self.load
        elif self.load is not None:
            load = self.load + load
        rigid_body = solve_inverse_dynamics(
            robot, self.motion, self.chains, self.jacobians, printed=self.printed, load=load)
        return replace(self, robot=robot, rigid_body=rigid_body, load=load)


def solve_mechanism(
    robot: Robot, motion: PlatformMotion, *, reversal: Reversal | None = None,
    printed: bool = False, minimum_sine: float = 1e-6, condition_limit: float = np.inf,
) -> MechanismState:
    """Return the state of the mechanism for a platform motion.

    Raises
    ------
    WorkspaceError, SingularityError
        See `solve_inverse_kinematics` and `compute_jacobians`.
    """
    chains = solve_inverse_kinematics(robot.geometry, motion, minimum_sine)
    jacobians = compute_jacobians(robot.geometry, chains, condition_limit)
    rigid_body = solve_inverse_dynamics(robot, motion, chains, jacobians, printed=printed)
    return MechanismState(robot, motion, chains, jacobians, rigid_body, reversal or Reversal(),
                          printed)
