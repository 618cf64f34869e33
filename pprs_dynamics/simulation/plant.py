# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated mechanism in motion: friction, hidden effects and time stepping.

Its state is the six drive positions and velocities; passive joints and platform follow. A step
is the midpoint rule. The equations are set up once, half a step ahead, and solved for the drive
acceleration with friction at the velocity of the midpoint. So friction that reverses within one
step does not chatter. Loads are those of the step before.

Notes
-----
Why the engine does not close the chains. The paper's robot on an excitation under PD control
and feedforward, its true motion explained by an exact model (one core, time in Python included):

=============================================  ========  =============  =====================
closed by                                      gap [m]   force rms [N]  times real time
=============================================  ========  =============  =====================
engine's `connect`, 0.5 ms, implicitfast       1.8e-7    3e-4           15-22, no friction
engine's `connect`, 0.5 ms, RK4                9e-10     3e-4           10, no friction
engine's `connect`, 0.1 ms, implicitfast       7e-9      5e-5           5, no friction
elimination as here, 0.5 ms                    1e-15     5e-7           3.5-5, with friction
=============================================  ========  =============  =====================

The engine's constraints leave out the change of their Jacobian, which costs the tenths of a
millinewton, and friction that follows loads would have to be added a step late and explicitly.
The time step causes errors of 0.07 um and 0.4 mN rms against one of 0.05 ms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg.lapack import dposv

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError, SingularityError
from pprs_dynamics.physics.model.platform_block import platform_limits
from pprs_dynamics.simulation.closed_chains import (
    DRIVE_DOFS,
    ClosedChains,
    Equations,
)
from pprs_dynamics.simulation.injected_effect import (
    BodyChange,
    DriveMoment,
    InjectedEffect,
    PlatformMoment,
    StructureForce,
)
from pprs_dynamics.simulation.resistance import Resistance

LOAD_ROUNDS = 20
LOAD_TOLERANCE = 3e-5  # [N], between rounds; what is left in the forces is below mu times it
# Stops at the ends of the strokes.
STOP_STIFFNESS = 1e5  # [N/m]
STOP_DAMPING = 300.0  # [N s/m]
# Share of the shorter stroke in one time step, 100 m/s for the paper's robot, beyond which the
# stops at its ends are not seen.
LONGEST_MOVE = 0.1


@dataclass(frozen=True)
class PlantSettings:
    """Settings of the simulation.

    Parameters
    ----------
    step : float
        Time step [s].
    friction : bool
        False switches the model file's friction off.
    drive_width, passive_width : float or (6,) array, float
        Width in which friction turns over, as a multiple of the model file's.
    actual_loads : bool
        False: friction follows the loads that the joints would have without friction in the
        passive joints, as the paper's equations do. True: the loads they have.
    """

    step: float = 0.0005
    friction: bool = True
    drive_width: float | tuple[float, ...] = 1.0
    passive_width: float = 1.0
    actual_loads: bool = False


@dataclass(frozen=True)
class Truth:
    """True state of the mechanism at one moment, everything in `base`.

    Parameters
    ----------
    time : float
    position, velocity, acceleration, effort : (6,) arrays
        Of the drives; effort is what they apply [N].
    platform_position, orientation : (3,), (4,) arrays
        Orientation as x, y, z, w.
    linear_velocity, angular_velocity, linear_acceleration, angular_acceleration : (3,) arrays
    guide_load : (6,) array
        [N]
    gap : float
        Largest component of the distance between the halves of a spherical joint [m].
    """

    time: float
    position: Array
    velocity: Array
    acceleration: Array
    effort: Array
    platform_position: Array
    orientation: Array
    linear_velocity: Array
    angular_velocity: Array
    linear_acceleration: Array
    angular_acceleration: Array
    guide_load: Array
    gap: float


class UnsolvedError(PprsError, ArithmeticError):
    """A step that neither the engine nor the time step can follow: what it gives is no motion."""

    def __init__(self, time: float, found: str) -> None:
        self.found = f'at {time:.6g} s {found}'
        super().__init__(f'the simulated robot: {self.found}, but forces and hidden effects must '
                         'be such as a mechanism can have')


class Plant:
    """The mechanism under drive efforts.

    Parameters
    ----------
    values : mapping
        Flat keys and values of a model file.
    effects : sequence of InjectedEffect
    settings : PlantSettings, optional

    Attributes
    ----------
    effects : tuple of InjectedEffect
        Those that are hidden in it now.

    Raises
    ------
    MissingLibraryError
        Where mujoco is not installed.
    """

    def __init__(self, values: Mapping[str, Any], effects: Sequence[InjectedEffect] = (),
                 settings: PlantSettings | None = None) -> None:
        self.settings, self._values = settings or PlantSettings(), values
        self.time_step = self.settings.step
        self.limits = platform_limits(values)
        self.lower, self.upper = self.limits.strokes
        self.resistance = Resistance(values, self.settings.drive_width,
                                     self.settings.passive_width, self.settings.friction)
        self.effects: tuple[InjectedEffect, ...] = ()
        self.chains = self._with(effects)
        # A copy without hidden effects, of which the drives' control knows the weight.
        self._known = ClosedChains(values)
        self._held = np.zeros(6)
        self.time = 0.0
        self.velocity = np.zeros(6)
        self._all_velocities = np.zeros(15)
        self._acceleration = np.zeros(15)
        self._loads = np.zeros(12)
        strokes = self.upper - self.lower
        self._fastest = LONGEST_MOVE * float(strokes.min()) / self.time_step
        self._widest = 3 * float(strokes.max())  # a whole stroke beyond the end
        self.place(self.position)

    def _with(self, effects: Sequence[InjectedEffect]) -> ClosedChains:
        """Take effects, and return the bodies with them."""
        chains = ClosedChains(self._values)
        self.resistance.use_effects(effects)
        self._structure_forces = [e for e in effects if isinstance(e, StructureForce)]
        self._body_changes = [e for e in effects if isinstance(e, BodyChange)]
        for change in self._body_changes:
            change.apply(chains, self._values)
        self.effects = tuple(effects)
        return chains

    @property
    def largest(self) -> None:
        """Largest efforts of its motion: not known, sensors go by their own."""
        return None

    def use_effects(self, effects: Sequence[InjectedEffect]) -> None:
        """Have other hidden effects from now on; the motion goes on, and what stays remembers."""
        before = self.chains.qpos.copy()
        self.chains = self._with(effects)
        self.chains.qpos[:] = before

    @property
    def hidden(self) -> list[dict[str, Any]]:
        """What is hidden in it: name, drives, parameters and form of each effect."""
        return [effect.truth() for effect in self.effects]

    def holding(self, position: Array) -> Array:
        """Return the efforts [N] that hold the model's weight at drive positions (6,) [m].

        Where it cannot close there, those of the last that did.
        """
        kept = self._known.qpos.copy()
        try:
            self._known.place_drives(position)
            self._held = self._known.evaluate(np.zeros(6)).drive_bias
        except SingularityError:
            self._known.qpos[:] = kept
        return self._held

    @property
    def position(self) -> Array:
        """Drive positions [m], (6,)."""
        return self.chains.qpos.take(DRIVE_DOFS)

    def place(self, position: Array, velocity: Array | None = None) -> None:
        """Put the drives at positions (6,) [m], at rest or with velocities (6,) [m/s].

        Raises
        ------
        SingularityError
            Where the mechanism cannot follow.
        """
        self.chains.place_drives(np.asarray(position, dtype=float))
        self.velocity = np.zeros(6) if velocity is None else np.array(velocity, dtype=float)
        equations = self.chains.evaluate(self.velocity)
        self._all_velocities = equations.T @ self.velocity
        # As if the drives held the platform, until the first step knows better.
        self._acceleration = equations.g.copy()
        self._loads = self.chains.loads(
            equations, self._acceleration, self._structure(self.time))

    def step(self, effort: Array) -> None:
        """Advance by one time step under constant efforts (6,) [N].

        Raises
        ------
        SingularityError
            Where the drives can no longer hold the platform.
        UnsolvedError
            Where the step has no solution that means anything.
        """
        h, chains = self.time_step, self.chains
        qpos, y, last = chains.qpos, self.velocity, self._acceleration
        for change in self._body_changes:
            change.advance(chains, self.time + h / 2)
        start, before = qpos.take(DRIVE_DOFS), qpos.copy()
        chains.engine.mj_integratePos(
            chains.model, qpos, self._all_velocities + h / 4 * last, h / 2)
        position = qpos.take(DRIVE_DOFS)
        guess = last.take(DRIVE_DOFS)
        predicted = y + h / 2 * guess
        equations = chains.evaluate(predicted)
        passive = self._structure(self.time + h / 2)
        drive = (effort - equations.drive_bias + passive.dot(equations.T_d)
                 + self._stops(position, predicted))
        moment = DriveMoment(self.time + h / 2, position, y, self._loads[:6],
                             effort - drive + equations.mass.dot(guess))
        y_dot = self.resistance.solve(equations, drive, moment, self._loads, guess, h / 2)
        acceleration = equations.T.dot(y_dot) + equations.g
        middle = moment.at(y + h / 2 * y_dot)
        self._loads = self._joint_loads(equations, acceleration, middle.velocity, passive)
        self.resistance.advance(middle, h)

        velocities = equations.T.dot(middle.velocity)
        chains.engine.mj_integratePos(
            chains.model, qpos, velocities + h / 4 * acceleration, h / 2)
        self.velocity = y + h * y_dot
        reason = self._unsolved()
        if reason:
            qpos[:], self.velocity = before, np.zeros(6)
            raise UnsolvedError(self.time, reason)
        qpos[DRIVE_DOFS] = start + h / 2 * (y + self.velocity)
        self._all_velocities = velocities + h / 2 * acceleration
        self._acceleration = acceleration
        self.time += h

    def _unsolved(self) -> str:
        """Return why the last step is no motion of a mechanism, or nothing."""
        if not np.abs(self.velocity).max() < self._fastest or self.chains.warnings:
            return 'the engine could not solve its motion'
        if np.abs(2 * self.position - self.lower - self.upper).max() > self._widest:
            return 'a drive has gone through the stop at its end'
        return ''

    def observe(self, effort: Array) -> Truth:
        """Return the true state now, when the drives apply efforts (6,) [N]."""
        chains, y = self.chains, self.velocity
        gap = chains.close()
        pose = chains.qpos[9:16].copy()
        position = self.position
        equations = chains.evaluate(y)
        passive = self._structure(self.time)
        drive = (effort - equations.drive_bias + passive.dot(equations.T_d)
                 + self._stops(position, y))
        kept = self._loads
        passed = effort - drive + equations.mass.dot(self._acceleration.take(DRIVE_DOFS))
        # Friction follows the loads, and these the acceleration: a fixed point, each round of
        # which leaves about a twentieth (mu) of the error, or what a gear loses.
        for _ in range(LOAD_ROUNDS):
            before = self._loads
            moment = DriveMoment(self.time, position, y, before[:6], passed)
            force = self.resistance.in_drives(equations, moment, before)
            _, y_dot, _ = dposv(equations.mass, drive - force)
            a = equations.T.dot(y_dot) + equations.g
            self._loads = self._joint_loads(equations, a, y, passive)
            passed = effort - drive + equations.mass.dot(y_dot)
            if max(np.abs(self._loads - before).max(),
                   np.abs(passed - moment.transmitted).max()) < LOAD_TOLERANCE:
                break
        v, rotation = equations.T.dot(y), chains.rotation
        truth = Truth(
            self.time, position, y.copy(), y_dot, np.array(effort), pose[:3],
            pose[[4, 5, 6, 3]], v[9:12], rotation @ v[12:], a[9:12], rotation @ a[12:],
            self._loads[:6].copy(), gap)
        self._loads = kept
        return truth

    def _structure(self, time: float) -> Array:
        """Return forces of hidden effects on hinges and platform, (9,), as now evaluated."""
        if not self._structure_forces:
            return _NO_FORCES
        passive = np.zeros(9)
        chains = self.chains
        rotation, velocities = chains.rotation.copy(), chains.qvel
        moment = PlatformMoment(
            time, chains.qpos[9:12].copy(), rotation, velocities[9:12].copy(),
            rotation @ velocities[12:], chains.qpos[2:9:3].copy())
        for effect in self._structure_forces:
            hinges, force, torque = effect.apply(moment)
            passive[:3] += hinges
            passive[3:6] += force
            passive[6:] += rotation.T @ torque
        return passive

    def _joint_loads(
        self, equations: Equations, acceleration: Array, velocity: Array, passive: Array,
    ) -> Array:
        if self.settings.actual_loads:
            passive = passive - self.resistance.of_passive_joints(
                equations, velocity, self._loads)
        return self.chains.loads(equations, acceleration, passive)

    def _stops(self, position: Array, velocity: Array) -> Array:
        """Return the force of the stops at the ends of the strokes [N], (6,)."""
        beyond = position - np.minimum(np.maximum(position, self.lower), self.upper)
        if not beyond.any():
            return _NO_STOPS
        return -STOP_STIFFNESS * beyond - STOP_DAMPING * velocity * (beyond != 0)


_NO_FORCES = np.zeros(9)
_NO_STOPS = np.zeros(6)
