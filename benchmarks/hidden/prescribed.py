# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Drive forces of the simulated robot along a given motion, without time stepping.

The plant finds the motion from the efforts, step by step; here the motion is known and the
efforts are asked for, at the samples of a recording. With a = T y_dot + g the engine's inverse
dynamics give

    tau = T'(M a + b - f) + friction + hidden forces,

where f are forces on passive joints and platform. Nothing is solved in time but the memory of
hidden effects. What depends on the motion alone is computed once (`DrivenMotion`), what depends
on the bodies once per robot; the rest are operations on whole arrays.

N samples are the first axis of every array.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from benchmarks.hidden.driven_motion import DrivenMotion
from pprs_dynamics.arrays import Array
from pprs_dynamics.simulation.closed_chains import (
    DOFS,
    DRIVE_DOFS,
    PASSIVE_DOFS,
    ClosedChains,
)
from pprs_dynamics.simulation.injected_effect import (
    BodyChange,
    DriveForce,
    DriveMoment,
    InjectedEffect,
    StructureForce,
)
from pprs_dynamics.simulation.injected_forces import FrictionTemperature
from pprs_dynamics.simulation.plant import LOAD_ROUNDS, LOAD_TOLERANCE, PlantSettings
from pprs_dynamics.simulation.resistance import JOINT_OF_RATE, Resistance
from pprs_dynamics.simulation.sensors import ButterworthFilter, SensorFaults


@dataclass(frozen=True)
class BodyForces:
    """Inverse dynamics of the bodies along a motion.

    Parameters
    ----------
    joints : (N, 15) array
        M a + b [N, N m].
    bodies : (N, 3, 3, 3) array
        Forces on slide, lift and rod of each chain and all further out, without the reactions
        in A_i, in `base` [N].
    """

    joints: Array
    bodies: Array


@dataclass(frozen=True)
class Efforts:
    """Efforts of the drives along a motion.

    Parameters
    ----------
    total : (N, 6) array
        [N]
    loads : (N, 12) array
        In the joints [N]: drives, C_i, A_i.
    """

    total: Array
    loads: Array


@dataclass(frozen=True)
class Readings:
    """Readings of sensors without noise, with hidden faults; (N, 6) arrays.

    Parameters
    ----------
    position, velocity, acceleration : (N, 6) arrays
        As measured; the latter two are what differentiation would find, but for what a play adds
        to the position [m, m/s, m/s^2].
    lead : (N, 6) array
        What a play adds to the position [m].
    effort : (N, 6) array
        [N]
    channels : dict of str to (N, 6) array
        What thermometers say, where an effect follows the temperature.
    """

    position: Array
    velocity: Array
    acceleration: Array
    lead: Array
    effort: Array
    channels: dict[str, Array]


class PrescribedPlant:
    """The mechanism, its friction and hidden effects along a motion.

    Parameters
    ----------
    values : mapping
        Flat keys and values of a model file; its geometry is the motion's.
    motion : DrivenMotion
    settings : PlantSettings, optional
        `step` is of no use here.
    """

    def __init__(self, values: Mapping[str, Any], motion: DrivenMotion,
                 settings: PlantSettings | None = None) -> None:
        self.values, self.motion = values, motion
        self.settings = settings or PlantSettings()
        self._chains = ClosedChains(values)
        self._bodies: BodyForces | None = None

    def efforts(self, effects: Sequence[InjectedEffect] = (),
                delay: Array | None = None) -> Efforts:
        """Return the efforts of the drives.

        Parameters
        ----------
        effects : sequence of InjectedEffect
            Their memory starts afresh. Those of sensors are left to others.
        delay : (6,) array, optional
            Return efforts of times that lie so much earlier [s]; before the first sample, those
            of the first sample.
        """
        motion, settings = self.motion, self.settings
        resistance = Resistance(self.values, settings.drive_width, settings.passive_width,
                                settings.friction)
        resistance.use_effects(effects)
        bodies = self._bodies_with([e for e in effects if isinstance(e, BodyChange)])
        structure = self._structure([e for e in effects if isinstance(e, StructureForce)])
        relative = np.einsum('nij,nj->ni', motion.rates, motion.velocity)
        moments, loads = self._passive_joints(bodies, structure, resistance, relative)
        transmitted = bodies.joints[:, DRIVE_DOFS] + np.einsum(
            'ni,nij->nj', bodies.joints[:, PASSIVE_DOFS] - structure, motion.T_d)
        smooth = transmitted + np.einsum('ni,nij->nj', moments, motion.rates[:, 6:])
        moment = DriveMoment(motion.time[:, None], motion.position, motion.velocity, loads[:, :6],
                             transmitted)
        if delay is not None and np.any(delay):
            moment, smooth = _earlier(motion, moment, smooth, delay)
        relative[:, :6] = moment.velocity
        drive_loads = np.concatenate((moment.guide_load, loads[:, 6:]), axis=1)
        resistances, _ = resistance.of_joints(relative, drive_loads)
        total = smooth + resistances[:, :6] * moment.velocity
        for effect in resistance.drive_forces:
            total += _hidden_force(effect, moment)
        return Efforts(total, loads)

    def readings(self, effects: Sequence[InjectedEffect] = ()) -> Readings:
        """Return the readings, without noise and quantisation."""
        motion, faults = self.motion, SensorFaults.of(effects)
        smooth = ButterworthFilter(faults.time_constant, float(np.median(np.diff(motion.time))))
        effort = (1 + faults.gain) * smooth.samples(
            self.efforts(effects, faults.effort_delay).total)
        position, velocity, acceleration = motion.position, motion.velocity, motion.acceleration
        if np.any(faults.position_delay):
            time = _earlier_times(motion, faults.position_delay)
            position, velocity, acceleration = (
                _at(motion, values, time, CubicSpline)
                for values in (position, velocity, acceleration))
        warm = next((one for one in effects if isinstance(one, FrictionTemperature)), None)
        # What a play does to recorded rates is left to those who differentiate positions.
        lead = faults.lead(velocity, acceleration)
        return Readings(position + faults.zero + lead, velocity, acceleration, lead, effort,
                        {} if warm is None else warm.measured(motion.time, motion.velocity))

    def _bodies_with(self, changes: Sequence[BodyChange]) -> BodyForces:
        if changes:
            return self._weigh(changes)
        if self._bodies is None:
            self._bodies = self._weigh(())
        return self._bodies

    def _weigh(self, changes: Sequence[BodyChange]) -> BodyForces:
        chains, motion = ClosedChains(self.values), self.motion
        for change in changes:
            change.apply(chains, self.values)
        engine, model, data = chains.engine, chains.model, chains.data
        joints, forces = np.empty((len(motion), DOFS)), np.empty((len(motion), 9, 3))
        for k, time in enumerate(motion.time):
            for change in changes:
                change.advance(chains, float(time))
            data.qpos[:], data.qvel[:], data.qacc[:] = (
                motion.qpos[k], motion.qvel[k], motion.qacc[k])
            engine.mj_kinematics(model, data)
            engine.mj_comPos(model, data)
            engine.mj_comVel(model, data)
            engine.mj_rne(model, data, 1, joints[k])
            engine.mj_rnePostConstraint(model, data)
            forces[k] = data.cfrc_int[1:10, 3:]
        # The engine's recursion leaves out the armature.
        joints += model.dof_armature * motion.qacc
        return BodyForces(joints, forces.reshape(-1, 3, 3, 3))

    def _structure(self, effects: Sequence[StructureForce]) -> Array:
        """Return forces of hidden effects on hinges and platform, (N, 9)."""
        motion = self.motion
        passive = np.zeros((len(motion), 9))
        for k in range(len(motion)) if effects else ():
            moment = motion.platform_moment(k)
            for effect in effects:
                hinges, force, torque = effect.apply(moment)
                passive[k, :3] += hinges
                passive[k, 3:6] += force
                passive[k, 6:] += moment.rotation.T @ torque
        return passive

    def _passive_joints(self, bodies: BodyForces, structure: Array, resistance: Resistance,
                        relative: Array) -> tuple[Array, Array]:
        """Return friction along the relative velocities in the passive joints, (N, 12), and loads.

        The loads follow friction and friction the loads: a fixed point, as in the plant.
        """
        motion, passive = self.motion, structure
        loads = self._loads(bodies, passive)
        for _ in range(LOAD_ROUNDS):
            resistances, _ = resistance.of_joints(relative, loads)
            moments = resistances[:, JOINT_OF_RATE[6:]] * relative[:, 6:]
            if not self.settings.actual_loads:
                break
            taken = np.einsum('ni,nij->nj', moments[:, 3:], motion.axes)
            taken[:, :3] += moments[:, :3]
            before, loads = loads, self._loads(bodies, structure - taken)
            if np.abs(loads - before).max() < LOAD_TOLERANCE:
                break
        return moments, loads

    def _loads(self, bodies: BodyForces, passive: Array) -> Array:
        """Return the forces in the joints, (N, 12), as `ClosedChains.loads`."""
        needed = bodies.joints[:, PASSIVE_DOFS] - passive
        reactions = np.einsum('ni,nij->nj', needed, self.motion.J_d_inverse).reshape(-1, 3, 3)
        return self._chains.joint_loads(bodies.bodies - reactions[:, :, None], reactions)


def _earlier(motion: DrivenMotion, moment: DriveMoment, smooth: Array,
             delay: Array) -> tuple[DriveMoment, Array]:
    """Return moment and forces of times `delay` earlier, (6,) [s], each drive's own.

    Drive friction is not interpolated but evaluated there: it turns over between two samples.
    """
    time = _earlier_times(motion, delay)
    position, velocity = (_at(motion, values, time, CubicSpline)
                          for values in (moment.position, moment.velocity))
    # Loads and the rest contain friction of the passive joints, with steps.
    loads, transmitted, smooth = (
        _at(motion, values, time, PchipInterpolator)
        for values in (moment.guide_load, moment.transmitted, smooth))
    return DriveMoment(time, position, velocity, loads, transmitted), smooth


def _earlier_times(motion: DrivenMotion, delay: Array) -> Array:
    times: Array = np.maximum(motion.time[:, None] - delay, motion.time[0])
    return times


def _at(motion: DrivenMotion, values: Array, time: Array, spline: Any) -> Array:
    return np.stack([spline(motion.time, values[:, i])(time[:, i]) for i in range(6)], axis=1)


def _hidden_force(effect: DriveForce, moment: DriveMoment) -> Array:
    """Return an effect's force at all samples, (N, 6); memory advances from one to the next."""
    if type(effect).advance is DriveForce.advance:
        return effect.force(moment)
    q, y, carried = moment.position, moment.velocity, (moment.guide_load, moment.transmitted)
    time = np.broadcast_to(moment.time, q.shape)
    force = np.empty_like(q)
    steps = np.diff(time, axis=0).max(axis=1)
    # What is late shows the beginning first, where the robot stands, for as long as it is late.
    steps = np.where(steps > 0, steps, steps.max())
    for k in range(len(q)):
        carries = [one[k] for one in carried]
        force[k] = effect.force(DriveMoment(time[k], q[k], y[k], *carries))
        if k < len(steps):
            # Displacement, and not velocity, is what friction remembers.
            middle = (q[k + 1] - q[k]) / steps[k]
            effect.advance(DriveMoment(time[k], q[k], middle, *carries), float(steps[k]))
    return force
