"""The rigid body and the paper's friction in one pass over the samples.

Nothing between the motion and the forces is kept: the same equations as in `MechanismState` and
the two effects, which store every step, in a third of the time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.effects.active_friction import ActiveFriction, drive_friction
from pprs_dynamics.effects.passive_friction import (
    Joints,
    WholeMechanismFriction,
    chain_resistance,
    drive_forces_of,
    joint_resistances,
    joints_of,
)
from pprs_dynamics.mechanism.closure import (
    Wrench,
    closure_rows,
    condition_bound,
    eliminate,
    invert,
)
from pprs_dynamics.mechanism.evaluation import evaluate
from pprs_dynamics.mechanism.inverse_kinematics import (
    ChainSample,
    chain_motion,
    is_within_reach,
)
from pprs_dynamics.mechanism.joint_rates import turnover
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.numbers import ROBOT_NUMBERS, Chain, chain, lengths
from pprs_dynamics.mechanism.reversal import Reversal, smooth_sign
from pprs_dynamics.mechanism.rigid_body import ChainForces, body_forces
from pprs_dynamics.mechanism.robot import Robot
from pprs_dynamics.mechanism.sample import motion_sample
from pprs_dynamics.mechanism.state import Kinematics, MechanismState
from pprs_dynamics.mechanism.vectors import Vector
from pprs_dynamics.model.limits import Limits


class Settings(NamedTuple):
    """What is neither the robot nor its friction."""

    printed: Any
    printed_friction: Any
    least_sine: Any
    bound: Any
    r: Any
    rate: Any


JOINTS = ROBOT_NUMBERS + len(Settings._fields)
DRIVES = JOINTS + len(Joints._fields)
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
        self._fields = {'robot': robot, 'reversal': reversal, 'printed': printed, 'load': None}
        self._geometry = robot.geometry
        self._bounds = limits.rod_sine, limits.condition_number
        settings = Settings(
            printed, passive.printed, limits.rod_sine, limits.condition_number ** 2,
            robot.geometry.platform_radius, reversal.rate)
        self.numbers = np.concatenate((
            robot.numbers, settings, passive.numbers, active.viscous, active.coulomb,
            np.broadcast_to(reversal.velocity, 6)))

    def forces(self, motion: PlatformMotion) -> Array | None:
        """Return total, rigid body, active and passive friction, (4, N, 6) [N].

        For up to `SHORT` samples (7, N, 6): position, velocity and acceleration of the drives
        follow [m, m/s, m/s^2]. None where a sample may be out of reach or too near a singularity:
        whoever asks must look closely then.
        """
        rows = motion.rows
        samples = len(rows)
        table = np.empty((7 if samples <= SHORT else FORCES, samples, 6))
        doubtful = evaluate(forces_kernel, self.numbers, rows, table)
        return table if doubtful < 0 else None

    def mechanism(self, motion: PlatformMotion, table: Array) -> MechanismState:
        """Return the state of the mechanism, not yet solved, for a motion and its forces."""
        kinematics = Kinematics(self._geometry, motion, *self._bounds)
        if len(table) > FORCES:
            kinematics.__dict__['drive_motion'] = tuple(table[FORCES:])
        return MechanismState.unsolved(self._fields, motion, kinematics)


def settings_of(p: Any) -> Settings:
    """Return the settings in a row of numbers."""
    k = ROBOT_NUMBERS
    return Settings(p[k], p[k + 1], p[k + 2], p[k + 3], p[k + 4], p[k + 5])


def forces_kernel(p: Any, s: Any, motion: Any, parts: Any) -> Any:
    """Fill tables of forces from one of motions; p and tables as in `OnePass`."""
    m, size, settings = motion_sample(motion, s), lengths(p), settings_of(p)
    k1, k2, k3 = chain(p, 0), chain(p, 1), chain(p, 2)
    one, two = chain_motion(size, k1, m), chain_motion(size, k2, m)
    three = chain_motion(size, k3, m)
    if len(parts) > FORCES:
        _write_motion(parts, s, 0, one)
        _write_motion(parts, s, 1, two)
        _write_motion(parts, s, 2, three)
    rows_1 = closure_rows(k1, one.arm, one.cos_u, one.sin_u)
    rows_2 = closure_rows(k2, two.arm, two.cos_u, two.sin_u)
    rows_3 = closure_rows(k3, three.arm, three.cos_u, three.sin_u)
    inverse = invert(p, eliminate(p, rows_1, rows_2, rows_3, one, two, three), one, two, three)
    zero = 0.0 * one.cos_u
    nothing = Vector(zero, zero, zero)
    bodies = body_forces(p, m, one, two, three, inverse, Wrench(nothing, nothing), nothing,
                         settings.printed)
    joints = joints_of(p, JOINTS)
    passive = drive_forces_of(
        inverse, one.sin_u, two.sin_u, three.sin_u,
        _in_chain(settings, joints, k1, size.l, one, bodies.one),
        _in_chain(settings, joints, k2, size.l, two, bodies.two),
        _in_chain(settings, joints, k3, size.l, three, bodies.three))
    parts[3, s, 0], parts[3, s, 1] = passive.slide_1, passive.slide_2
    parts[3, s, 2], parts[3, s, 3] = passive.slide_3, passive.lift_1
    parts[3, s, 4], parts[3, s, 5] = passive.lift_2, passive.lift_3
    _write_drives(p, parts, s, 0, one, bodies.one)
    _write_drives(p, parts, s, 1, two, bodies.two)
    _write_drives(p, parts, s, 2, three, bodies.three)
    least = settings.least_sine
    bound = condition_bound(inverse, rows_1, rows_2, rows_3, one.sin_u, two.sin_u, three.sin_u,
                            settings.r)
    return (is_within_reach(one, least) & is_within_reach(two, least)
            & is_within_reach(three, least) & (bound <= settings.bound))


def _in_chain(
    settings: Settings, joints: Joints, k: Chain, l: Any, c: ChainSample, f: ChainForces,
) -> Wrench:
    """Return what overcomes the friction in a chain's joints."""
    k_r, k_s = joint_resistances(joints, f.H, f.V, f.W, f.V_star, f.W_star,
                                 turnover(c.u_dot, c.omega, settings.rate))
    return chain_resistance(k, l, c, k_r, k_s, settings.printed_friction)


def _write_drives(
    p: Any, parts: Any, s: Any, i: int, c: ChainSample, f: ChainForces,
) -> None:
    """Write rigid body, active friction and total of a chain's two drives."""
    slide = DRIVES + i
    lift = slide + 3
    parts[1, s, i], parts[1, s, 3 + i] = f.slide, f.lift
    parts[2, s, i] = drive_friction(
        p[slide], p[slide + 6], c.slide_velocity, f.slide_load,
        smooth_sign(c.slide_velocity, p[slide + 12]))
    parts[2, s, 3 + i] = drive_friction(
        p[lift], p[lift + 6], c.lift_velocity, f.lift_load,
        smooth_sign(c.lift_velocity, p[lift + 12]))
    parts[0, s, i] = parts[1, s, i] + parts[2, s, i] + parts[3, s, i]          # Eq. (14)
    parts[0, s, 3 + i] = parts[1, s, 3 + i] + parts[2, s, 3 + i] + parts[3, s, 3 + i]  # Eq. (14)


def _write_motion(parts: Any, s: Any, i: int, c: ChainSample) -> None:
    """Write the motion of a chain's two drives."""
    parts[FORCES, s, i], parts[FORCES, s, 3 + i] = c.slide, c.lift
    parts[FORCES + 1, s, i], parts[FORCES + 1, s, 3 + i] = c.slide_velocity, c.lift_velocity
    parts[FORCES + 2, s, i] = c.slide_acceleration
    parts[FORCES + 2, s, 3 + i] = c.lift_acceleration
