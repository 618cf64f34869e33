# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""An arm, or a robot with loops, in motion under the efforts of its drives.

Masses, gravity and inertial forces are MuJoCo's, of the tree; loops are eliminated, as in `plant`:
with T the rates of all joints per rate of the drives and h of the tree,

    T' M T a = tau - T' h - T' (M T_dot v) - friction

A step is the midpoint rule, friction taken at the velocity of the midpoint. Friction of a joint is
c(|w|) w with c = c_v + (T + mu r F) tanh(|w| / width) / |w|: with the c of the round before it is
linear in the acceleration. Loads are those of the acceleration of the step before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.simulation.drive_control import ControlSettings
from pprs_dynamics.simulation.injected_effect import InjectedEffectError
from pprs_dynamics.simulation.joint_forms import FORMS, JointMoment, draw_form, truth
from pprs_dynamics.simulation.mechanism_engine import SLOWEST, MechanismEngine
from pprs_dynamics.simulation.mechanism_run import (
    draw_motion,
    inject_link_mass,
    inject_payload,
    inject_tilt,
    one_able_joint,
)
from pprs_dynamics.simulation.plant import UnsolvedError
from pprs_dynamics.simulation.temperatures import Climate

LONGEST_STEP = 0.002  # [s]; a hexapod's takes 1.2 ms of processor time, for real time
ROUNDS = 12  # of friction's coefficients in a step
SOLVED = 1e-6  # of the width in which friction turns over, between rounds
# Stops at the ends of ranges: a spring of that frequency with the drive's inertia at home, damped.
STOP_FREQUENCY, STOP_DAMPING = 40.0, 0.3  # [Hz], of critical
BEYOND = 1.0  # of a range behind its stop, from which on the motion means nothing
FASTEST = 100.0  # of a range, or of a turn, in a second
NOMINAL = 10.0  # [s], of the motion that tells how large efforts and speeds of this robot are
# Hidden effects that need no more than the moment.
BODIES = ('payload_mass', 'link_mass')
OF_MOMENT = tuple(name for name in FORMS if name not in ('hysteresis', 'drive_inertia'))
HIDDEN = (*OF_MOMENT, *BODIES, 'base_tilt')


class MechanismPlant:
    """A mechanism under efforts of its drives; it starts at home, an arm amid its ranges.

    Parameters
    ----------
    model : DriveModel
        Of which the mechanism and its own friction count, and no added effects.
    names : sequence of str
        Of `HIDDEN`, or 'random': physics that the model lacks.
    seed : int
        Of these.
    scale : float
        Multiplies their size.
    rate : float
        At which it is looked at [Hz]: a whole number of steps lies between.

    Attributes
    ----------
    time, time_step : float
        [s]
    position, velocity : (D,) arrays
        Of the drives [m, rad].
    hidden : list of dict
        What is hidden.
    largest : (D,) array
        Largest efforts of an excitation [N, N m].
    inertia : (D,) array
        That the drives' loops are made for, at home [kg, kg m^2]: what each moves while the others
        stand, less where motions of several together move little.

    Raises
    ------
    MissingLibraryError
        Where mujoco is not installed.
    InjectedEffectError
        For a name of none.
    """

    def __init__(self, model: DriveModel, names: Sequence[str] = (), seed: int = 0,
                 scale: float = 1.0, rate: float = 500.0) -> None:
        self.time_step = 1 / (rate * math.ceil(1 / (rate * LONGEST_STEP)))
        self.model, self.engine = model, MechanismEngine(model)
        self.structure = s = model.robot.structure
        random = np.random.default_rng(seed)
        motion = draw_motion(model, NOMINAL, seed)
        efforts = self.engine.torques(motion)
        self.largest = np.abs(efforts).max(axis=0)
        reversal = model.reversal
        self._viscous, self._coulomb, self._offset = (
            np.broadcast_to(np.asarray(one, dtype=float), len(s.drives))
            for one in (model.friction.viscous, model.friction.coulomb, model.offset.value))
        self._width = reversal.widths(len(s.drives))
        self._passive = [effect.table(model.robot, reversal) for effect in model.effects
                         if isinstance(effect, ModelJointFriction)]
        self._pushes: list[tuple[int, str, dict[str, float], JointMoment]] = []
        self.hidden = [self._hide(name, motion, efforts, random, scale)
                       for name in _drawn(names, random)]
        home, _ = s.room(np.pi)  # where motions that are drawn begin
        self.limits = model.limits
        self.lower, self.upper = self.limits.strokes
        with np.errstate(invalid='ignore'):
            span = self.upper - self.lower
        self._span = np.where(np.isfinite(span), span, 2 * np.pi)
        self.time = 0.0
        self._rest = np.zeros_like(home)
        self.place(home)
        M = self._equations(home, self._rest, self._rest)[0]
        alone = np.diag(M)
        # A loop for `alone` would be unstable in the lightest motion, one for that weak in all
        # others: the geometric mean of both.
        lightest = np.linalg.eigvalsh(M / np.sqrt(np.outer(alone, alone)))[0]
        self.inertia = alone * np.sqrt(lightest)

    def _hide(self, name: str, motion: JointMotion, efforts: Array, random: np.random.Generator,
              scale: float) -> dict[str, Any]:
        model = self.model
        if name == 'payload_mass':
            return truth(name, *inject_payload(
                self.engine, scale * float(random.uniform(0.05, 0.12)), 0.0))
        if name == 'link_mass':
            links = [j for j in range(len(model.robot.bodies)) if j != model.robot.carrier]
            if not links:
                raise InjectedEffectError('link_mass needs a link beside that of the tool')
            return truth(name, *inject_link_mass(
                self.engine, int(random.choice(links)), scale * float(random.uniform(0.1, 0.3))))
        if name == 'base_tilt':
            return truth(name, *inject_tilt(
                self.engine, scale * float(random.uniform(0.01, 0.03))))
        j = one_able_joint(name, model, motion, random)
        assert motion.time is not None
        moment = JointMoment.along(motion, j, efforts[:, j], self.largest[j],
                                   model.gear_ratios[j],
                                   Climate.draw(random, len(model.drives)).along(
                                       motion.time, motion.velocity))
        drawn = draw_form(name, random, moment, scale)
        self._pushes.append((j, name, drawn, moment))
        return truth(name, [model.drives[j]], drawn, FORMS[name].form)

    def use_effects(self, effects: Sequence[Any]) -> None:
        """Refuse: what is hidden in a mechanism stays."""
        raise TypeError('what is hidden in a mechanism stays')

    def gains(self, frequency: float, damping: float, **settings: Any) -> ControlSettings:
        """Return a PD loop of a frequency [Hz] and a damping ratio for what the drives move."""
        rate = 2 * np.pi * frequency
        return ControlSettings(tuple(rate ** 2 * self.inertia),
                               tuple(2 * damping * rate * self.inertia), **settings)

    def holding(self, position: Array) -> Array:
        """Return the efforts that hold the model's weight at positions of the drives (D,).

        Where the loops do not close there, those of the last that did.
        """
        try:
            rest = self._rest[None]
            self._held: Array = self.model.robot.torques(position[None], rest, rest)[0]
        except WorkspaceError:
            pass
        return self._held + self._offset

    def place(self, position: Array, velocity: Array | None = None) -> None:
        """Put the drives at positions (D,), at rest or with velocities.

        Raises
        ------
        WorkspaceError
            Where the mechanism cannot go there.
        """
        self.position = np.array(position, dtype=float)
        self.velocity = np.zeros_like(self.position) if velocity is None else np.array(velocity)
        self.engine.home()
        self.engine.loops.put(self.position, self.velocity, self._rest)
        self._acceleration = np.zeros_like(self.position)
        self._held = self._rest
        self._held = self.holding(self.position) - self._offset

    def step(self, effort: Array) -> None:
        """Advance by one time step under constant efforts (D,).

        Raises
        ------
        WorkspaceError
            Where the drives can no longer hold the tool.
        UnsolvedError
            Where the step has no solution that means anything.
        """
        h, v, a = self.time_step, self.velocity, self._acceleration
        middle = self.position + h / 2 * v + h * h / 8 * a
        acceleration = self.acceleration(middle, v + h / 2 * a, effort, v, h / 2)
        velocity = v + h * acceleration
        position = self.position + h / 2 * (v + velocity)
        if not np.all(np.abs(velocity) < FASTEST * self._span):
            raise UnsolvedError(self.time, 'the engine could not solve its motion')
        if np.any((position < self.lower - BEYOND * self._span)
                  | (position > self.upper + BEYOND * self._span)):
            raise UnsolvedError(self.time, 'a drive has gone through the stop at its end')
        self.position, self.velocity, self._acceleration = position, velocity, acceleration
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
        last = self._acceleration
        M, bias, T = self._equations(position, velocity, last)
        push = effort - bias - self._offset + self._stops(position, velocity)
        rows, coefficients = self._joints(T)
        a, found = last, last
        for _ in range(ROUNDS):
            mid = start + ahead * a
            rates = rows @ mid
            C = np.einsum('kid,k,kie->de', rows, coefficients(rates), rows)
            hidden, slope = self._hidden(position, mid)
            # A slope beside M: friction at the middle, linear with the secants of this round.
            damping = C + np.diag(slope)
            found = np.linalg.solve(M + ahead * damping, push - hidden - damping @ start)
            if np.all(ahead * np.abs(found - a) <= SOLVED * self._width):
                break
            # Secants overshoot at a reversal: half of the way, where the velocity turns over.
            turns = np.sign(start + ahead * found) != np.sign(mid)
            a = np.where(turns, (a + found) / 2, found)
        return found

    def _equations(self, position: Array, velocity: Array, acceleration: Array,
                   ) -> tuple[Array, Array, Array]:
        """Return T' M T, all forces that do not depend on the acceleration, and T (nv, D)."""
        needed, M, T = self.engine.inverse(position, velocity, acceleration)
        self._needed = needed.copy()
        mass = T.T @ M @ T
        pushed = T.T @ needed
        self._load = np.abs(pushed)
        bias = pushed - mass @ acceleration
        return mass + np.diag(self.model.robot.armature), bias, T

    def _joints(self, T: Array) -> tuple[Array, Any]:
        """Return relative rates of rubbing joints per rate of drives (K, 3, D), and their law.

        The law gives friction over rate, (K,), of rates (K, 3): a hinge's stand in the first.
        """
        count = len(self._rest)
        rows = [np.concatenate((np.eye(count)[:, None], np.zeros((count, 2, count))), axis=1)]
        laws = []
        for table in self._passive:
            own, law = self.engine.friction_of(table, self._needed, T.T @ self._needed)
            rows.append(own @ T)
            laws.append(law)
        ends = np.cumsum([len(one) for one in rows])

        def coefficients(rates: Array) -> Array:
            x = np.maximum(np.abs(rates[:count, 0]) / self._width, SLOWEST)
            return np.concatenate((
                self._viscous + self._coulomb * np.tanh(x) / (x * self._width),
                *(law(rates[start:end]) for law, start, end in zip(
                    laws, ends[:-1], ends[1:], strict=True))))

        return np.concatenate(rows), coefficients

    def _hidden(self, position: Array, velocity: Array) -> tuple[Array, Array]:
        """Return hidden forces that do not go with velocities, and slopes of those that do."""
        force, slope = np.zeros_like(position), np.zeros_like(position)
        for j, name, drawn, nominal in self._pushes:
            moment = JointMoment(
                np.array([self.time]), position[j:j + 1], velocity[j:j + 1],
                self._acceleration[j:j + 1], self._load[j:j + 1], nominal.effort, nominal.speed,
                nominal.gear_ratio,
                np.interp([self.time], nominal.time, nominal.temperature))
            pushed = float(FORMS[name].force(drawn, moment)[0])
            if pushed * velocity[j] > 0 and 'friction' in name:
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


def _drawn(names: Sequence[str], random: np.random.Generator) -> list[str]:
    """Return names of hidden effects, or raise InjectedEffectError."""
    drawn = [str(random.choice(sorted(HIDDEN))) if name == 'random' else name for name in names]
    for name in drawn:
        if name not in HIDDEN:
            raise InjectedEffectError(f'{name} cannot be hidden in such a robot while it moves, '
                                      f'must be one of {", ".join(HIDDEN)}')
    return drawn
