# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The paper's equations in one pass over samples: kinematics, reactions, forces and friction."""

from __future__ import annotations

from math import tanh
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.evaluation import reader_of
from pprs_dynamics.physics.mechanism.motion_sample import motion_sample, vector
from pprs_dynamics.physics.mechanism.tree_tables import (
    DRIVE_FRICTION,
    JOINT_EFFORT,
    RIGID,
    TOTAL,
    elements,
)
from pprs_dynamics.physics.mechanism.vectors import Vector
from pprs_dynamics.physics.three_pprs.closure import (
    Twist,
    Wrench,
    condition_bound,
    invert,
    rows_of_chains,
)
from pprs_dynamics.physics.three_pprs.inverse_kinematics import (
    ThreeChains,
    are_within_reach,
    chain_motions,
)
from pprs_dynamics.physics.three_pprs.kernel_parameters import (
    CHAINS,
    Chain,
    ChainMasses,
    GeometryParameters,
    Joints,
    PlatformBody,
    RobotParameters,
    each_chain,
)
from pprs_dynamics.physics.three_pprs.passive_joints import (
    JointResistance,
    friction_forces,
    joint_resistances,
    turnover,
)
from pprs_dynamics.physics.three_pprs.rigid_body import ThreeForces, body_forces

# Tables of results, (N, 6) each: TOTAL, RIGID, DRIVE_FRICTION and JOINT_EFFORT, of which alone
# there are tables for long batches; the drives' motion and guide loads; of the chains cosine and
# sine of u, its rates, k_r and k_s; and the six rows of [J].
FORCES = 4
POSITION, VELOCITY, ACCELERATION, GUIDE_LOAD = 4, 5, 6, 7
ANGLE, RATE, RESISTANCE, JACOBIAN, EVERYTHING = 8, 9, 10, 11, 17
NO_LOAD = np.zeros((1, 9))


class DriveParameters(NamedTuple):
    """Friction of one drive: c [N s/m], mu and the reversal velocity [m/s]."""

    viscous: Value
    coulomb: Value
    reversal_velocity: Value


class ForcesParameters(NamedTuple):
    """Parameters of `forces`.

    `printed` is 1 for Eq. (7) to the letter, else 0; `bound` is the square of the condition
    number allowed, `drives` six of `DriveParameters`.
    """

    robot: RobotParameters
    platform_radius: Value
    printed: Value
    minimum_sine: Value
    bound: Value
    joints: Joints
    drives: tuple[DriveParameters, ...]


FRICTIONLESS_JOINTS, FRICTIONLESS_DRIVES = Joints(1.0, 0.0), (DriveParameters(0.0, 0.0, 1.0),) * 6


class Tables(NamedTuple):
    """Motions, loads and results of samples; see `forces`."""

    motion: Any
    load: Any
    parts: Any


_V, _CHAIN, _MASSES = Vector(0.0, 0.0, 0.0), Chain(*(0.0,) * 7), ChainMasses(0.0, 0.0, 0.0)
read_parameters = reader_of(ForcesParameters(
    RobotParameters(GeometryParameters(0.0, 0.0, 0.0, (_CHAIN,) * 3),
                    PlatformBody(0.0, _V, _V, _V), (_MASSES,) * 3, _V),
    0.0, 0.0, 0.0, 0.0, FRICTIONLESS_JOINTS, FRICTIONLESS_DRIVES))


def forces(parameters: Any, motion: Any, load: Any, parts: Any) -> int:
    """Fill tables of results from one of motions, and one of loads or a single load for all.

    Parameters
    ----------
    parameters : array
        `row_of` a `ForcesParameters`.
    motion : (N, 19) array
        See `PlatformMotion.rows`.
    load : (N, 9) or (1, 9) array
        Wrench of the platform, and moments in the hinges.
    parts : (FORCES or EVERYTHING, N, 6) array

    Returns
    -------
    int
        The first sample out of reach or too near a singularity, or -1.
    """
    p, t = read_parameters(parameters), elements(Tables(motion, load, parts))
    first = -1
    for s in range(len(motion)):
        if not _is_sound(p, s, t.motion, t.load, t.parts) and first < 0:
            first = s
    return first


def _is_sound(p: ForcesParameters, s: int, motion: Any, load: Any, parts: Any) -> Any:
    """Fill in sample s and return whether it is within reach and far from a singularity."""
    m, geometry = motion_sample(motion, s), p.robot.geometry
    rods = chain_motions(geometry, m)
    rows = rows_of_chains(geometry, rods)
    inverse = invert(geometry, rows, rods)
    at = s if len(load) > 1 else 0
    wrench = Wrench(vector(load, at, 0), vector(load, at, 3))
    bodies = body_forces(p.robot, m, rods, inverse, wrench, vector(load, at, 6), p.printed)
    k = _joint_resistances(p, rods, bodies)
    passive = friction_forces(geometry, rods, inverse, k, p.joints.printed)
    for i in range(CHAINS):
        c, f = rods[i], bodies[i]
        _write_forces(i, p, parts, s, f.slide, c.slide_velocity, f.slide_load, passive.slides[i])
        _write_forces(CHAINS + i, p, parts, s, f.lift, c.lift_velocity, f.lift_load,
                      passive.lifts[i])
        if len(parts) > FORCES:
            _write(parts, POSITION, s, i, c.slide, c.lift)
            _write(parts, VELOCITY, s, i, c.slide_velocity, c.lift_velocity)
            _write(parts, ACCELERATION, s, i, c.slide_acceleration, c.lift_acceleration)
            _write(parts, GUIDE_LOAD, s, i, f.slide_load, f.lift_load)
            _write(parts, ANGLE, s, i, c.cos_u, c.sin_u)
            _write(parts, RATE, s, i, c.u_dot, c.u_ddot)
            _write(parts, RESISTANCE, s, i, k[i].revolute, k[i].spherical)
            _write_twist(parts, s, i, 1.0, inverse.slides[i])
            _write_twist(parts, s, CHAINS + i, c.sin_u, inverse.lifts[i])
    bound = condition_bound(inverse, rows, rods, p.platform_radius)
    return are_within_reach(rods, p.minimum_sine) and bound <= p.bound


@each_chain
def _joint_resistances(
    i: int, p: ForcesParameters, rods: ThreeChains, bodies: ThreeForces,
) -> JointResistance:
    f = bodies[i]
    return joint_resistances(p.joints, f.H, f.V, f.W, f.V_star, f.W_star,
                             turnover(rods[i].u_dot, rods[i].omega, p.joints.width))


def _write_forces(
    drive: int, p: ForcesParameters, parts: Any, s: int, rigid_body: Any, velocity: Any,
    load: Any, passive: Any,
) -> None:
    """Write the parts of a drive's force, and their sum."""
    c, mu, width = p.drives[drive]
    active = c * velocity + mu * load * tanh(velocity / width)                 # Eq. (15), (16)
    parts[TOTAL, s, drive] = rigid_body + active + passive                     # Eq. (14)
    parts[RIGID, s, drive], parts[DRIVE_FRICTION, s, drive] = rigid_body, active
    parts[JOINT_EFFORT, s, drive] = passive


def _write(parts: Any, row: int, s: int, i: int, first: Any, second: Any) -> None:
    """Write two numbers of chain i."""
    parts[row, s, i], parts[row, s, CHAINS + i] = first, second


def _write_twist(parts: Any, s: int, drive: int, A: Any, twist: Twist) -> None:
    """Write a column of [J] = [B]^-1 [A], Eq. (11)."""
    v, omega = twist.v, twist.omega
    parts[JACOBIAN, s, drive], parts[JACOBIAN + 3, s, drive] = A * v.x, A * omega.x
    parts[JACOBIAN + 1, s, drive], parts[JACOBIAN + 4, s, drive] = A * v.y, A * omega.y
    parts[JACOBIAN + 2, s, drive], parts[JACOBIAN + 5, s, drive] = A * v.z, A * omega.z
