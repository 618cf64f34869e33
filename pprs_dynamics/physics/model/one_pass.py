# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The rigid body and the paper's friction in one pass over the samples.

No intermediate quantity is stored. The equations are the functions that `ThreePprsState` and the
two effects call, too, which store every step and take three times as long.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array, Sample, Value
from pprs_dynamics.physics.mechanism.evaluation import evaluate
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.motion_sample import motion_sample
from pprs_dynamics.physics.mechanism.reversal import Reversal, smooth_sign
from pprs_dynamics.physics.mechanism.vectors import Vector
from pprs_dynamics.physics.model.force_model import (
    ACTIVE_FRICTION,
    PASSIVE_FRICTION,
    RIGID_BODY,
    total_force,
)
from pprs_dynamics.physics.model.limits import Limits
from pprs_dynamics.physics.three_pprs.active_friction import ActiveFriction, drive_friction
from pprs_dynamics.physics.three_pprs.chains import CHAINS, each_chain
from pprs_dynamics.physics.three_pprs.closure import (
    Wrench,
    condition_bound,
    eliminate,
    invert,
    rows_of_chains,
)
from pprs_dynamics.physics.three_pprs.inverse_kinematics import (
    ChainSample,
    ThreeChains,
    are_within_reach,
    chain_motions,
)
from pprs_dynamics.physics.three_pprs.joint_rates import turnover
from pprs_dynamics.physics.three_pprs.kernel_parameters import Joints, RobotParameters
from pprs_dynamics.physics.three_pprs.passive_friction import WholeMechanismFriction
from pprs_dynamics.physics.three_pprs.passive_joints import (
    JointResistance,
    friction_forces,
    joint_resistances,
)
from pprs_dynamics.physics.three_pprs.rigid_body import ThreeForces, body_forces
from pprs_dynamics.physics.three_pprs.robot import Robot
from pprs_dynamics.physics.three_pprs.state import MechanismKinematics, ThreePprsState


class DriveFriction(NamedTuple):
    """Friction of one drive: c [N s/m], mu and the reversal velocity [m/s]."""

    viscous: Value
    coulomb: Value
    reversal_velocity: Value


class ForcesParameters(NamedTuple):
    """Parameters of `forces_kernel`.

    `printed` and `printed_friction` are 1 for the equations to the letter, else 0; `bound` is
    the square of the condition number allowed, `reversal_rate` that of the passive joints
    [rad/s], `drives` six of `DriveFriction`.
    """

    robot: RobotParameters
    platform_radius: Value
    printed: Value
    printed_friction: Value
    minimum_sine: Value
    bound: Value
    reversal_rate: Value
    joints: Joints
    drives: tuple[DriveFriction, ...]


FORCES = 4  # total and three parts
# Samples up to which the drives' motion is kept with the forces: a node checks it before it
# answers; of a recording, writing it would take longer than calculating it where it is needed.
SHORT = 2048


class OnePass:
    """A model without effects on the bodies, ready to be evaluated.

    Parameters
    ----------
    robot : Robot
    active : ActiveFriction
    passive : WholeMechanismFriction
    limits : Limits
    reversal : Reversal
    printed : bool
    """

    def __init__(
        self, robot: Robot, active: ActiveFriction, passive: WholeMechanismFriction,
        limits: Limits, reversal: Reversal, printed: bool,
    ) -> None:
        self._robot, self._reversal, self._printed = robot, reversal, printed
        self._bounds = limits.rod_sine, limits.condition_number
        widths = reversal.widths(len(active.viscous)).tolist()
        drives = zip(active.viscous, active.coulomb, widths, strict=True)
        self.parameters = robot.kernel_parameters.extended(
            ForcesParameters, robot.geometry.platform_radius, float(printed),
            float(passive.printed), limits.rod_sine, limits.condition_number ** 2, reversal.rate,
            passive.joints, tuple(DriveFriction(*drive) for drive in drives))

    def forces(self, motion: PlatformMotion) -> Array | None:
        """Return total, rigid body, active and passive friction, (4, N, 6) [N].

        For up to `SHORT` samples (7, N, 6): position, velocity and acceleration of the drives
        follow [m, m/s, m/s^2]. None where a sample may be out of reach or too near a singularity:
        the caller must check every sample then.
        """
        rows = motion.rows
        table = np.empty((FORCES + 3 if len(rows) <= SHORT else FORCES, len(rows), 6))
        return table if evaluate(forces_kernel, self.parameters, rows, table) < 0 else None

    @staticmethod
    def parts(table: Array) -> dict[str, Array]:
        """Return the parts in a table of `forces` by name."""
        return {RIGID_BODY: table[1], ACTIVE_FRICTION: table[2], PASSIVE_FRICTION: table[3]}

    def mechanism(self, motion: PlatformMotion, table: Array) -> ThreePprsState:
        """Return the state of the mechanism, not yet solved, for a motion and its forces."""
        kinematics = MechanismKinematics(self._robot.geometry, motion, *self._bounds)
        if len(table) > FORCES:
            kinematics.__dict__['drive_motion'] = tuple(table[FORCES:])
        return ThreePprsState(self._robot, motion, kinematics, self._reversal, self._printed)


def forces_kernel(p: ForcesParameters, s: Sample, motion: Array, parts: Any) -> Any:
    """Fill tables of forces from one of motions, see `OnePass.forces`."""
    m, geometry = motion_sample(motion, s), p.robot.geometry
    rods = chain_motions(geometry, m)
    if len(parts) > FORCES:
        for i in range(CHAINS):
            _write_motion(i, parts, s, rods[i])
    rows = rows_of_chains(geometry, rods)
    inverse = invert(geometry, eliminate(geometry, rows, rods), rods)
    zero = 0.0 * rods[0].cos_u
    nothing = Vector(zero, zero, zero)
    bodies = body_forces(p.robot, m, rods, inverse, Wrench(nothing, nothing), nothing, p.printed)
    k = _joint_resistances(p, rods, bodies)
    passive = friction_forces(geometry, rods, inverse, k, p.printed_friction)
    for i in range(CHAINS):
        c, f = rods[i], bodies[i]
        _write_forces(i, p, parts, s, f.slide, c.slide_velocity, f.slide_load, passive.slides[i])
        _write_forces(CHAINS + i, p, parts, s, f.lift, c.lift_velocity, f.lift_load,
                      passive.lifts[i])
    bound = condition_bound(inverse, rows, rods, p.platform_radius)
    return are_within_reach(rods, p.minimum_sine) & (bound <= p.bound)


@each_chain
def _joint_resistances(
    i: int, p: ForcesParameters, rods: ThreeChains, bodies: ThreeForces,
) -> JointResistance:
    f = bodies[i]
    return joint_resistances(p.joints, f.H, f.V, f.W, f.V_star, f.W_star,
                             turnover(rods[i].u_dot, rods[i].omega, p.reversal_rate))


def _write_forces(
    drive: int, p: ForcesParameters, parts: Any, s: Sample, rigid_body: Any, velocity: Any,
    load: Any, passive: Any,
) -> None:
    """Write the parts of a drive's force, and their sum."""
    c, mu, width = p.drives[drive]
    active = drive_friction(c, mu, velocity, load, smooth_sign(velocity, width))
    parts[0, s, drive] = total_force((rigid_body, active, passive))
    parts[1, s, drive], parts[2, s, drive], parts[3, s, drive] = rigid_body, active, passive


def _write_motion(i: int, parts: Any, s: Sample, c: ChainSample) -> None:
    """Write the motion of a chain's two drives."""
    parts[FORCES, s, i], parts[FORCES, s, 3 + i] = c.slide, c.lift
    parts[FORCES + 1, s, i], parts[FORCES + 1, s, 3 + i] = c.slide_velocity, c.lift_velocity
    parts[FORCES + 2, s, i] = c.slide_acceleration
    parts[FORCES + 2, s, 3 + i] = c.lift_acceleration
