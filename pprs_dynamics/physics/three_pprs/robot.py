# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS with its bodies, evaluated by the paper's closed form."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import COUNT, DRIVES
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.mechanism.evaluation import KernelParameters
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.places import PLATFORM, BodyPlace, PassiveJoint
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.mechanism.state import MechanismState
from pprs_dynamics.physics.mechanism.structure_load import StructureLoad
from pprs_dynamics.physics.mechanism.vectors import Vector
from pprs_dynamics.physics.three_pprs.forward_motion import solve_forward_motion
from pprs_dynamics.physics.three_pprs.geometry import Geometry, Masses
from pprs_dynamics.physics.three_pprs.jacobians import condition_number
from pprs_dynamics.physics.three_pprs.kernel_parameters import (
    REVOLUTE,
    SPHERICAL,
    ChainMasses,
    Joints,
    PlatformBody,
    RobotParameters,
)
from pprs_dynamics.physics.three_pprs.kinematics import PlatformKinematics
from pprs_dynamics.physics.three_pprs.rigid_body import RigidBody, solve_bodies
from pprs_dynamics.physics.three_pprs.tree import tree_structure

RODS = 'rods'
HOME_HEIGHT = 0.5  # [m], of the platform at home
POSITION_STEP = 3e-5  # of a rod's length, for derivatives by a drive's position
# The condition number of a long trajectory is computed at this many samples, evenly spread:
# neighbours hardly differ, and a singular value decomposition costs more than the model.
MOST_CONDITIONS = 64


class SingularityBounds(NamedTuple):
    """Distances that poses must keep from singularities.

    Parameters
    ----------
    rod_sine : float
        Smallest abs(sin u_i); at 0 a rod is horizontal and the inverse kinematics singular.
    condition_number : float
        Largest condition number of the drive Jacobian, rotations times r.
    rod_cosine : float
        Smallest abs(cos u_i); infinitely small unless chains are independent, Eq. (13).
    """

    rod_sine: float = 1e-6
    condition_number: float = inf
    rod_cosine: float = 0.0


UNBOUNDED = SingularityBounds()


@dataclass(frozen=True)
class ThreePprs:
    """The 3-PPRS; its members are those of `Mechanism`.

    Parameters
    ----------
    geometry : Geometry
    masses : Masses
    gravity : 3 floats
        Gravity acceleration in `base` [m/s^2].
    radii : 2 floats
        At which loads of C_i and A_i rub [m], where known.
    bounds : SingularityBounds
    printed : bool
        Take Eq. (7) to the letter.
    """

    geometry: Geometry
    masses: Masses
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    radii: tuple[float, float] = (0.0, 0.0)
    bounds: SingularityBounds = UNBOUNDED
    printed: bool = False

    # Bodies and passive joints are three of a kind, and no two kinds are alike.
    structure: ClassVar[None] = None
    drives: ClassVar[tuple[str, ...]] = DRIVES
    motors: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    armature: ClassVar[Array] = np.zeros(COUNT)
    motions: ClassVar[tuple[type, ...]] = (PlatformMotion,)
    turning: ClassVar[tuple[str, ...]] = ()
    kind: ClassVar[str] = PLATFORM

    @property
    def passive_joints(self) -> tuple[PassiveJoint, ...]:
        """The joints C_i, and the joints A_i."""
        revolute, spherical = self.radii
        return (PassiveJoint(REVOLUTE, revolute),
                PassiveJoint(SPHERICAL, spherical, has_position=False))

    @property
    def tool_place(self) -> BodyPlace:
        """The centre of mass of platform and payload, where a payload is added."""
        return BodyPlace('platform', (0.0, 0.0, 0.0), inf, is_spread=True)

    @property
    def link_places(self) -> tuple[BodyPlace, ...]:
        """The rods, all three alike."""
        return (BodyPlace(RODS, (0.0, 0.0, 0.0), inf, is_spread=True),)

    @property
    def moved_mass(self) -> float:
        """Mass of the platform and its payload [kg]."""
        return self.masses.total

    @property
    def numbers(self) -> Array:
        """All numbers that determine the forces, in one row."""
        return self.kernel_parameters.row

    @property
    def position_step(self) -> float:
        """Step of a drive for derivatives by its position [m]."""
        return POSITION_STEP * self.geometry.rod_length

    def friction_table(self, blocks: Mapping[str, Mapping[str, float]], reversal: Reversal,
                       ) -> Joints:
        """Return friction of joints as `MechanismState.against_friction` takes it."""
        return Joints.of(blocks, reversal.rate)

    def heavier(self, link: str, mass: float) -> ThreePprs:
        """Return the robot with a payload, or with rods, that weigh more [kg].

        The masses are not checked, see `with_masses`.
        """
        if link == RODS:
            return self.with_masses(rods=tuple(m_b + mass for m_b in self.masses.rods))
        return self.with_masses(payload=self.masses.payload + mass)

    def with_masses(self, **masses: Any) -> ThreePprs:
        """Return the robot with some fields of `Masses` changed, unchecked.

        A fit changes one coefficient at a time, and an inertia about one axis alone belongs to no
        body. Build `Masses` from the result to check them.
        """
        altered = copy.copy(self.masses)
        for name, value in masses.items():
            object.__setattr__(altered, name, value)
        return replace(self, masses=altered)

    @cached_property
    def kernel_parameters(self) -> KernelParameters[RobotParameters]:
        """Geometry, masses and gravity."""
        masses = self.masses
        first, second, third = (ChainMasses(*chain) for chain in zip(
            masses.slides, masses.lifts, masses.rods, strict=True))
        body = PlatformBody(masses.total, Vector(*masses.centre), Vector(*masses.inertia[:3]),
                            Vector(*masses.inertia[3:]))
        return KernelParameters(RobotParameters(
            self.geometry.kernel_parameters.named, body, (first, second, third),
            Vector(*self.gravity)))

    def as_mechanism(self, strokes: tuple[Array, Array], efforts: Array, *, is_free: bool = True,
                     ) -> Mechanism:
        """Return the robot as a mechanism; see `tree_structure`."""
        structure = tree_structure(self.geometry, self.masses, (*strokes, efforts), is_free)
        bodies = np.flatnonzero(structure.inertial[:, 0] > 0)
        return Mechanism(structure, bodies, structure.inertial[bodies], np.zeros(COUNT),
                         self.gravity)

    # --- motion --------------------------------------------------------------------------------

    def motion_of_drives(self, position: Array, velocity: Array, acceleration: Array,
                         closed: dict[Any, Array] | None = None) -> PlatformMotion:
        """Return the platform's motion, by forward kinematics; see `solve_forward_motion`."""
        return solve_forward_motion(self.geometry, position, velocity, acceleration, closed)

    def at_home(self, samples: int) -> PlatformMotion:
        """Return the platform at rest at its home pose."""
        return PlatformMotion.at_rest(np.tile([0.0, 0.0, HOME_HEIGHT], (samples, 1)))

    def state(self, motion: PlatformMotion, reversal: Reversal, friction: object = None,
              closed: object = None, drive_motion: tuple[Array, Array, Array] | None = None,
              ) -> MechanismState:
        """Return the state for a platform motion, whose drive motion may be known already.

        Raises
        ------
        WorkspaceError
            For a pose out of reach.
        SingularityError
            For a pose nearer to a singularity than `bounds` allow.
        """
        found = PlatformKinematics(
            self.geometry, motion, self.bounds.rod_sine, self.bounds.condition_number)
        # Very large numbers overflow; users of the result check that it is finite.
        with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
            if drive_motion is None:
                drive_motion = found.drive_motion
                _ = found.inverse_table
        return MechanismState(*drive_motion, motion.time, channels=motion.channels, robot=self,
                              reversal=reversal, known=found, motion=motion)

    def remember(self, state: MechanismState, closed: object) -> None:
        """Store nothing: poses have a closed form."""

    def kinematics(self, state: MechanismState) -> PlatformKinematics:
        """Return the kinematics of a state that lacks them."""
        return PlatformKinematics(
            self.geometry, state.motion, self.bounds.rod_sine, self.bounds.condition_number)

    def loads(self, found: PlatformKinematics, load: StructureLoad | None) -> RigidBody:
        """Return frictionless drive forces and reactions."""
        return solve_bodies(self.kernel_parameters, found.motion, found.chain_table,
                            found.inverse_table, self.printed, load)

    def inverse_dynamics(self, state: MechanismState) -> None:
        """Return None: the model evaluates its one pass itself."""

    def friction_load(self, state: MechanismState) -> Array:
        """Return the normal forces on the guides [N], (N, 6)."""
        load: Array = state.reactions.guide_load
        return load

    def moved(self, state: MechanismState, position: Array, acceleration: Array) -> MechanismState:
        """Return the state at other positions and accelerations of the drives."""
        motion = self.motion_of_drives(position, state.velocity, acceleration)
        motion = motion.with_channels(state.channels)
        return replace(self.state(motion if state.time is None else motion.with_time(state.time),
                                  state.reversal), robot=state.robot, load=state.load)

    # --- singularities ----------------------------------------------------------------------------

    def singularity_margin(self, state: MechanismState) -> float:
        """Return 1 minus the largest of three shares, 0 at the limit.

        Condition number over its limit, smallest sine of a rod angle over that of the rods, and,
        with independent chains, the ratio for the cosine.
        """
        bounds, J, chains = self.bounds, state.links.J, state.links.chains
        number = condition_number(self.geometry, J[::-(-len(J) // MOST_CONDITIONS)])
        return float(1 - max(number.max() / bounds.condition_number,
                             bounds.rod_sine / np.abs(chains.sin_u).min(),
                             bounds.rod_cosine / np.abs(chains.cos_u).min()))

    def variables(self, state: MechanismState) -> dict[str, Array]:
        """Return loads of the guides, rod angles, and where the platform is."""
        motion = state.motion
        x, y, z = motion.position.T
        return {'load': state.friction_load, 'rod_angle': np.tile(state.links.chains.rod_angle, 2),
                'platform_x': x, 'platform_y': y, 'platform_z': z,
                'platform_tilt': motion.tilt, 'platform_turn': motion.turn}

    def require_bodies(self, key: str, value: Any) -> None:
        """Raise ModelError, of a key and its value, for bodies that cannot be."""
        if not self.masses.total > 0 or min(self.masses.rods) < 0:
            raise ModelError(key, value, 'leave masses greater than 0')
