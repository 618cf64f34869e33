# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Velocity-dependent resistance to the drives, and the acceleration with it.

By the model file's numbers a joint resists with c v + mu N tanh(v / v_rev); a spherical joint along
the relative angular velocity of rod and platform. N comes from the engine's inverse dynamics. The
width v_rev may differ from the model's: that is one of the ways in which a robot is unlike its
model. Arrays of 12 hold the drives, C_1..C_3, A_1..A_3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dposv

from pprs_dynamics.arrays import Array
from pprs_dynamics.simulation.closed_chains import Equations
from pprs_dynamics.simulation.injected_effect import (
    DriveForce,
    DriveMoment,
    InjectedEffect,
    InjectedJointFriction,
)

FORCE_TOLERANCE = 1e-8  # [N]
# A Newton step shorter than this share of the width in which friction turns over leaves an
# error below 0.4 times its square, times the dry friction: a few millinewtons for some steps at
# a reversal, which leaves the error of the time step as it is.
RESOLVED_SHARE = 0.1
ITERATIONS = 40
SMALLEST_SHARE = 1 / 64  # of a Newton step that would not lower the error
# Speeds are taken as at least this share of the width: tanh(s)/s is 1 there to rounding.
SMALLEST_SPEED = 1e-6
VELOCITY_NUDGE = 1e-7  # [m/s], for slopes of hidden forces; below every width of turning over

# Joint (of 12) to which each relative velocity (of 18) belongs.
JOINT_OF_RATE = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 10, 10, 10, 11, 11, 11])
SUM_PER_JOINT = np.equal.outer(JOINT_OF_RATE, np.arange(12)).astype(float)


class Resistance:
    """The joints' friction and the hidden forces in drives and passive joints.

    Parameters
    ----------
    values : mapping
        Flat keys and values of a model file.
    drive_width : float or (6,) array_like
        Width in which the drives' friction turns over, as a multiple of the model file's.
    passive_width : float
        The same for the passive joints.
    friction : bool
        False for a robot without friction of its own.
    """

    def __init__(self, values: Mapping[str, Any], drive_width: ArrayLike = 1.0,
                 passive_width: float = 1.0, friction: bool = True) -> None:
        joints = [{key: values[f'friction.{joint}.{key}'] for key in
                   ('viscous', 'coulomb', 'diameter')} for joint in ('revolute', 'spherical')]
        self.viscous = np.concatenate((
            values['friction.drives.viscous'], *([joint['viscous']] * 3 for joint in joints)))
        self.dry = np.concatenate((
            values['friction.drives.coulomb'],
            *([joint['coulomb'] * joint['diameter'] / 2] * 3 for joint in joints)))
        if not friction:
            self.viscous, self.dry = np.zeros(12), np.zeros(12)
        self.width = np.concatenate((
            np.broadcast_to(np.multiply(drive_width, values['friction.reversal_velocity']), 6),
            np.full(6, passive_width * values['friction.reversal_rate'])))
        self._smallest_squares = (SMALLEST_SPEED * self.width) ** 2
        self._resolved = RESOLVED_SHARE * float(self.width[:6].min())
        self.drive_forces: list[DriveForce] = []
        self._passive_friction: list[InjectedJointFriction] = []

    def use_effects(self, effects: Sequence[InjectedEffect]) -> None:
        """Have these hidden effects from now on; those of other kinds are left to others.

        Those that act already keep their memory.
        """
        running = self.drive_forces
        self.drive_forces = [e for e in effects if isinstance(e, DriveForce)]
        self._passive_friction = [e for e in effects if isinstance(e, InjectedJointFriction)]
        for force in self.drive_forces:
            if force not in running:
                force.prepare(self.dry[:6], self.width[:6])

    def in_drives(self, equations: Equations, moment: DriveMoment, loads: Array) -> Array:
        """Return the additional drive forces [N], (6,), at loads (12,) [N]."""
        relative = equations.rates.dot(moment.velocity)
        resistances, _ = self.of_joints(relative, loads)
        force: Array = (resistances.take(JOINT_OF_RATE) * relative).dot(equations.rates)
        for effect in self.drive_forces:
            force += effect.force(moment)
        return force

    def of_passive_joints(self, equations: Equations, velocity: Array, loads: Array) -> Array:
        """Return the moments of friction on hinges and platform [N m], (9,)."""
        relative = equations.rates.dot(velocity)
        resistances, _ = self.of_joints(relative, loads)
        moments = resistances.take(JOINT_OF_RATE) * relative
        passive: Array = moments[9:].dot(equations.axes)
        passive[:3] += moments[6:9]
        return passive

    def solve(self, equations: Equations, drive: Array, moment: DriveMoment, loads: Array,
              guess: Array, ahead: float) -> Array:
        """Return the drive acceleration with friction at velocity + ahead * acceleration.

        Newton's method, shortened where friction turns over within the step and the full step
        would not lower the error.

        Parameters
        ----------
        equations : Equations
        drive : (6,) array
            All forces on the drives that velocities do not change within the step [N].
        moment : DriveMoment
            With the velocity to start from.
        loads : (12,) array
        guess : (6,) array
        ahead : float
            [s]
        """
        y = moment.velocity
        y_dot, step = guess, np.zeros(6)
        best, share = np.inf, 1.0
        for _ in range(ITERATIONS):
            force, slopes = self._with_slopes(equations, moment.at(y + ahead * y_dot), loads)
            error = drive - force - equations.mass.dot(y_dot)
            size = np.abs(error).max()
            if size < FORCE_TOLERANCE:
                break
            if size >= best and share > SMALLEST_SHARE:
                share /= 2
                y_dot = y_dot - share * step
                continue
            best, share = size, 1.0
            _, step, _ = dposv(equations.mass + ahead * slopes, error)
            y_dot = y_dot + step
            if ahead * np.abs(step).max() < self._resolved:
                break
        return y_dot

    def advance(self, moment: DriveMoment, duration: float) -> None:
        """Advance the memory of hidden effects by a time step."""
        for effect in self.drive_forces:
            effect.advance(moment, duration)

    def of_joints(self, relative: Array, loads: Array) -> tuple[Array, Array]:
        """Return forces per speed in the joints, (..., 12), and slopes of the drives, (..., 6).

        Parameters
        ----------
        relative : (..., 18) array
            Relative velocities, see `Equations.rates`.
        loads : (..., 12) array
            N [N].
        """
        squares = (relative * relative).dot(SUM_PER_JOINT)
        speeds = np.sqrt(squares + self._smallest_squares)
        sign = np.tanh(speeds / self.width)
        dry = self.dry * loads
        resistances: Array = self.viscous + dry * sign / speeds
        sign = sign[..., :6]
        slopes: Array = self.viscous[:6] + dry[..., :6] / self.width[:6] * (1.0 - sign * sign)
        for effect in self._passive_friction:
            part = slice(6, 9) if effect.joint == 'revolute' else slice(9, 12)
            resistances[..., part] += effect.resistance(
                np.sqrt(squares[..., part]), loads[..., part])
        return resistances, slopes

    def _with_slopes(
        self, equations: Equations, moment: DriveMoment, loads: Array,
    ) -> tuple[Array, Array]:
        """Return `in_drives`, and its slopes over the drive velocities, (6, 6)."""
        rates = equations.rates
        relative = rates.dot(moment.velocity)
        resistances, slopes = self.of_joints(relative, loads)
        weights = resistances.take(JOINT_OF_RATE)
        force = (weights * relative).dot(rates)
        # Of the passive joints the secant is taken: not smaller than the slope, so that the
        # matrix stays positive, and their share is small.
        weights[:6] = slopes
        for effect in self.drive_forces:
            hidden = effect.force(moment)
            force += hidden
            if effect.steep:
                nudged = effect.force(moment.at(moment.velocity + VELOCITY_NUDGE))
                # Friction that falls with the speed is taken explicitly.
                weights[:6] += np.maximum((nudged - hidden) / VELOCITY_NUDGE, 0.0)
        return force, (rates.T * weights).dot(rates)
