# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A robot in motion under the efforts of its drives.

Masses, gravity and inertial forces are MuJoCo's, of the tree; loops are eliminated. With T the
rates of all joints per rate of the drives and h the forces of the tree,

    T' M T a = tau - T' h - T' (M T_dot v) - friction

A step is the midpoint rule, with friction at the velocity of the midpoint. Friction of a joint is
c(|w|) w with c = c_v + (T + mu r F) tanh(|w| / width) / |w|. With the c of the round before, it is
linear in the acceleration. Loads are those of the acceleration of the step before.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError, WorkspaceError
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.simulation import injection
from pprs_dynamics.simulation.drive_control import ControlSettings
from pprs_dynamics.simulation.engine import MechanismEngine
from pprs_dynamics.simulation.injected_forms import (
    FORMS,
    UNKNOWN,
    JointMoment,
    draw_form,
    draw_temperatures,
)

LONGEST_STEP = 0.002  # [s]; a hexapod's takes 1 ms of processor time, for real time
ROUNDS = 12  # of friction's coefficients in a step
SOLVED = 1e-6  # of the width in which friction turns over, between rounds
# Stops at the ends of ranges: a spring of that frequency with the drive's inertia at home, damped.
STOP_FREQUENCY, STOP_DAMPING = 40.0, 0.3  # [Hz], of critical
BEYOND = 1.0  # of a range behind its stop, from which on the motion means nothing
FASTEST = 100.0  # of a range, or of a turn, in a second
NOMINAL = 10.0  # [s], of the motion that gives the sizes of efforts and speeds of this robot
OF_BODIES = ('payload_mass', 'link_mass', 'base_tilt')
# Forms that need the moment alone, without a memory or the acceleration.
OF_MOMENT = {name: form for name, form in {**FORMS, **UNKNOWN}.items()
             if name not in ('hysteresis', 'drive_inertia')}
INJECTED = (*OF_MOMENT, *OF_BODIES)


class UnsolvedError(PprsError, ArithmeticError):
    """A step that has no solution with a physical meaning."""

    def __init__(self, time: float, found: str) -> None:
        self.found = f'at {time:.6g} s {found}'
        super().__init__(f'the simulated robot: {self.found}, but forces and injected effects must '
                         'be such as a mechanism can have')


class Plant(injection.Injecting):
    """A robot under efforts of its drives; it starts at home, an arm amid its ranges.

    Parameters
    ----------
    model : DriveModel
        Its added effects are no part of the plant.
    names : sequence of str
        See `inject`.
    seed : int
        Of the injected effects.
    scale : float
        Multiplies their size.
    rate : float
        Ticks at which it is looked at [Hz].

    Attributes
    ----------
    time, time_step : float
        [s]
    steps_per_tick : int
    position, velocity : (D,) arrays
        Of the drives [m, rad].
    last_acceleration : (D,) array
        Of the last step: loads that friction follows are those of it.
    injected : list of dict
        Name, drives and parameters of each injected effect.
    largest : (D,) array
        Largest efforts of an excitation [N, N m].
    inertia : (D,) array
        For which the drives' loops are made, at home [kg, kg m^2]: of each drive alone, less where
        motions of several together move little.

    Raises
    ------
    MissingLibraryError
        Where mujoco is not installed.
    InjectedEffectError
        See `inject`.
    """

    def __init__(self, model: DriveModel, names: Sequence[str] = (), seed: int = 0,
                 scale: float = 1.0, rate: float = 500.0) -> None:
        self.steps_per_tick = math.ceil(1 / (rate * LONGEST_STEP))
        self.time_step = 1 / (rate * self.steps_per_tick)
        self.model = model
        self.engine = MechanismEngine(model)
        self.structure = s = model.robot.structure
        self._nominal = injection.draw_motion(self.model, NOMINAL, 0)
        self._efforts = self.engine.torques(self._nominal)
        self.largest = np.abs(self._efforts).max(axis=0)
        self._guides = sorted(injection.guides(self.model), key=s.drives.index)
        self._offset, self._width = model.offset, model.reversal.widths(len(s.drives))
        self._friction = injection.own_joint_friction(model)
        self.inject(names, seed, scale)
        home, _ = s.room(np.pi)  # where motions that are drawn begin
        self.limits = self.model.limits
        self.lower, self.upper = self.limits.lower, self.limits.upper
        with np.errstate(invalid='ignore'):
            span = self.upper - self.lower
        self._span = np.where(np.isfinite(span), span, 2 * np.pi)
        self.time = 0.0
        self.position = home
        self.velocity = self.last_acceleration = self._held = self._rest = np.zeros_like(home)
        self.holding(home)
        M = self._equations(home, self._rest, self._rest)[0]
        alone = np.diag(M)
        # A loop for `alone` would be unstable in the lightest motion, one for that weak in all
        # others: the geometric mean of both.
        lightest = np.linalg.eigvalsh(M / np.sqrt(np.outer(alone, alone)))[0]
        self.inertia = alone * np.sqrt(lightest)

    def inject(self, names: Sequence[str], seed: int = 0, scale: float = 1.0) -> None:
        """Replace the injected effects; the motion continues.

        Parameters
        ----------
        names : sequence of str
            Of `INJECTED`, or 'random'; drives may follow: 'coulomb_friction:lift_1,lift_2'.
        seed : int
            A name has the same parameters with the same seed, whatever else is injected.
        scale : float
            Multiplies the size of the effects.

        Raises
        ------
        InjectedEffectError
            For another name, or an effect that the robot cannot have.
        """
        chosen = self.choices(names, seed, scale)
        self.engine.reset()
        self._pushes: list[tuple[int, str, dict[str, float], JointMoment]] = []
        self.injected: list[dict[str, Any]] = []
        for choice in chosen:
            effect = injection.BODIES.get(choice.name, Plant._push)
            self.injected.append(self.inject_one(choice, effect))

    def choices(self, names: Sequence[str], seed: int, scale: float) -> list[injection.Choice]:
        """Return the effects of names without injecting them; see `inject`."""
        chosen = []
        for words in names:
            if words == injection.RANDOM:
                words = str(np.random.default_rng(seed).choice(sorted(INJECTED)))
            random = np.random.default_rng((seed, zlib.crc32(words.encode())))
            choice = injection.named(words, random, scale)
            choice.require(INJECTED, self.structure.drives)
            if choice.name in OF_MOMENT:
                injection.one_able_joint(
                    choice.name, self.model, self._nominal, np.random.default_rng(0))
            elif choice.name == 'link_mass':
                injection.links_that_weigh(self.model)
            elif choice.name == 'base_tilt':
                injection.require_tool(self.model, choice.name)
            chosen.append(choice)
        return chosen

    def _push(self) -> injection.Injected:
        """Inject a force on drives."""
        name, random = self.choice.name, self.random
        model, motion, form = self.model, self._nominal, OF_MOMENT[name]
        chosen = self.given or [injection.one_able_joint(name, model, motion, random)]
        assert motion.time is not None
        temperature = draw_temperatures(random, motion.time, motion.velocity)
        parameters = {}
        for j in chosen:
            moment = JointMoment.along(motion, j, self._efforts[:, j], self.largest[j],
                                       model.gear_ratios[j], temperature)
            drawn = parameters[model.drives[j]] = draw_form(form, random, moment, self.scale)
            self._pushes.append((j, name, drawn, moment))
        return [*parameters], parameters

    def gains(self, frequency: float, damping: float, **settings: Any) -> ControlSettings:
        """Return a PD loop of a frequency [Hz] and a damping ratio for what the drives move."""
        rate = 2 * np.pi * frequency
        return ControlSettings(rate ** 2 * self.inertia, 2 * damping * rate * self.inertia,
                               **settings)

    def holding(self, position: Array) -> Array:
        """Return the efforts that hold the model's weight at positions of the drives (D,).

        Where the loops do not close there, those of the last position where they did.
        """
        try:
            rest = self._rest[None]
            self._held = self.model.robot.torques(position[None], rest, rest)[0]
        except WorkspaceError:
            pass
        return self._held + self._offset

    def step(self, effort: Array) -> None:
        """Advance by one time step under constant efforts (D,).

        Raises
        ------
        WorkspaceError
            Where the drives can no longer hold the tool.
        UnsolvedError
            Where the step has no solution with a physical meaning.
        """
        h, v, a = self.time_step, self.velocity, self.last_acceleration
        middle = self.position + h / 2 * v + h * h / 8 * a
        acceleration = self.acceleration(middle, v + h / 2 * a, effort, v, h / 2)
        velocity = v + h * acceleration
        position = self.position + h / 2 * (v + velocity)
        if not np.all(np.abs(velocity) < FASTEST * self._span):
            raise UnsolvedError(self.time, 'the engine could not solve its motion')
        if np.any((position < self.lower - BEYOND * self._span)
                  | (position > self.upper + BEYOND * self._span)):
            raise UnsolvedError(self.time, 'a drive has gone through the stop at its end')
        self.position, self.velocity, self.last_acceleration = position, velocity, acceleration
        self.time += h

    def acceleration(self, position: Array, velocity: Array, effort: Array, start: Array,
                     ahead: float) -> Array:
        """Return the acceleration of the drives, with friction at start + ahead * acceleration.

        Parameters
        ----------
        position, velocity : (D,) arrays
            At which inertia and inertial forces are taken.
        effort : (D,) array
        start : (D,) array
            Velocity that friction starts from.
        ahead : float
            [s]
        """
        M, bias, rows, coefficients = self._equations(position, velocity, self.last_acceleration)
        push = effort - bias - self._offset + self._stops(position, velocity)
        a = found = self.last_acceleration
        for _ in range(ROUNDS):
            mid = start + ahead * a
            C = np.einsum('kid,k,kie->de', rows, coefficients(rows @ mid), rows)
            injected, slope = self._injected(position, mid)
            # A slope beside M: friction at the middle, linear with the secants of this round.
            damping = C + np.diag(slope)
            found = np.linalg.solve(M + ahead * damping, push - injected - damping @ start)
            if np.all(ahead * np.abs(found - a) <= SOLVED * self._width):
                break
            # Secants overshoot at a reversal: half of the way, where the velocity turns over.
            turns = np.sign(start + ahead * found) != np.sign(mid)
            a = np.where(turns, (a + found) / 2, found)
        return found

    def _equations(self, position: Array, velocity: Array, acceleration: Array,
                   ) -> tuple[Array, Array, Array, Any]:
        """Return T' M T, forces without friction, and the friction of joints.

        Friction is relative rates per rate of drives (K, 3, D) and a law, which gives friction over
        rate, (K,), of rates (K, 3).
        """
        closed = self.engine.closed(JointMotion(position[None], velocity[None], acceleration[None]))
        carried = self.engine.carried(closed)
        T = closed.rates[0]
        mass = T.T @ self.engine.inertia() @ T
        self._load = carried.efforts[0]
        self._pressed = np.abs(self._load)
        if self._guides and self._pushes:
            self._pressed[[self.structure.drives.index(name) for name in self._guides]] = (
                np.linalg.norm(self.engine.across(self._guides, carried)[0], axis=1))
        rubbing = self.engine.friction(self._friction, closed, carried)
        return (mass + np.diag(self.model.robot.armature), self._load - mass @ acceleration,
                rubbing.rows[0] @ T, lambda rates: rubbing.coefficients(rates[None])[0])

    def _injected(self, position: Array, velocity: Array) -> tuple[Array, Array]:
        """Return injected forces that do not depend on velocities, and slopes of the others."""
        force, slope = np.zeros_like(position), np.zeros_like(position)
        for j, name, drawn, nominal in self._pushes:
            only, following = slice(j, j + 1), [(j + 1) % len(position)]
            moment = JointMoment(
                np.array([self.time]), position[only], velocity[only], self.last_acceleration[only],
                self._load[only], nominal.effort, nominal.speed, nominal.gear_ratio,
                np.interp([self.time], nominal.time, nominal.temperature), self._pressed[only],
                velocity[following])
            pushed = float(OF_MOMENT[name].force(drawn, moment)[0])
            if 'friction' in name and pushed * velocity[j] > 0:
                slope[j] += pushed / velocity[j]
            else:
                force[j] += pushed
        return force, slope

    def _stops(self, position: Array, velocity: Array) -> Array:
        """Return the forces of the stops at the ends of the ranges."""
        beyond = np.minimum(self.upper - position, 0.0) + np.maximum(self.lower - position, 0.0)
        if not beyond.any():
            return beyond
        rate = 2 * np.pi * STOP_FREQUENCY
        return self.inertia * (rate ** 2 * beyond - 2 * STOP_DAMPING * rate * velocity
                               * (beyond != 0))
