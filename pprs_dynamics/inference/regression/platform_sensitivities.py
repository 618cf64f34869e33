# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Derivatives of the forces of a 3-PPRS by its numbers and by effects outside the drives.

The geometry changes the motion, bodies change the loads, loads change friction: most of it is
differences of the whole model.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.regression.sensitivities import (
    BARE,
    HOMING,
    NUMBERS,
    OF_DRIVES,
    OF_JOINTS,
    PRESENT,
    RELATIVE_STEP,
    Number,
    Sensitivities,
    following,
    passive_reversal_columns,
    reversal_columns,
)
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.laws.active_friction import ActiveFriction
from pprs_dynamics.physics.effects.laws.passive_friction import PassiveFriction
from pprs_dynamics.physics.effects.structure_effect import BodyEffect, StructureEffect
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveForces, DriveModel
from pprs_dynamics.physics.three_pprs.forward_motion import platform_rates, solve_forward_motion
from pprs_dynamics.physics.three_pprs.state import MechanismState

HOMING_STEP = 3e-5  # of a rod's length
HOMING_STRIDE = 5  # samples; these columns change slowly
# Numbers that act on the drives of one chain, or on one drive, only: all at once, then split.
PER_DRIVE = ('friction.drives.viscous', 'friction.drives.coulomb')
PER_CHAIN = ('masses.slides', 'masses.lifts')


class PlatformSensitivities(Sensitivities):
    """Columns of a 3-PPRS.

    Parameters
    ----------
    model : DriveModel
    """

    model: DriveModel

    def columns(self, forces: DriveForces) -> dict[str, Array]:
        """Return columns of all kinds, (K, N, 6) each."""
        found = ChunkSensitivities(self.model, forces)
        count = len(forces.mechanism.velocity)
        samples = np.arange(min(HOMING_STRIDE // 2, count - 1), count, HOMING_STRIDE)
        nearest = np.minimum(np.arange(count) // HOMING_STRIDE, len(samples) - 1)
        columns = {
            NUMBERS: found.of_numbers(self.numbers), OF_DRIVES: found.of_drive_widths(),
            OF_JOINTS: found.of_passive_widths(), HOMING: found.of_homing(samples)[:, nearest]}
        for effect in self.searched:
            full, bare = zip(*found.of_structure(effect), strict=True)
            columns[effect.name] = np.stack(full)
            if issubclass(effect, BodyEffect):
                columns[BARE + effect.name] = np.stack(bare)
        known = {effect.name for effect in self.given.effects}
        for present in self.model.effects:
            if isinstance(present, StructureEffect) and present.name in known:
                columns[PRESENT + present.name] = np.stack(
                    [full for full, _ in found.of_structure(type(present))])
        return columns


class ChunkSensitivities:
    """Columns of one chunk.

    Parameters
    ----------
    model : DriveModel
    forces : DriveForces
        Of the model, before its sensors.
    """

    def __init__(self, model: DriveModel, forces: DriveForces) -> None:
        self.model, self.state = model, forces.mechanism
        self._following = following(model)
        self._sensors = [e for e in model.effects if isinstance(e, MeasurementEffect)]

    @cached_property
    def _reference(self) -> Array:
        return self._forces(self.state)

    def _forces(self, state: MechanismState) -> Array:
        total: Array = state.rigid_body.force + sum(e.force(state) for e in self._following)
        return total

    def sensed(self, column: Array) -> Array:
        """Return what the model's sensors make of a change of the drives' forces, (N, 6)."""
        for effect in self._sensors:
            column = effect.sensed(column, self.state.time, DRIVES)
        return column

    def of_structure(self, effect: type[StructureEffect]) -> Iterator[tuple[Array, Array]]:
        """Yield the columns of every coefficient of an effect, (N, 6) per unit.

        Two for each: as the model says, and as it would be if friction did not follow the loads
        that the effect adds (a preloaded guide). Around the effect's values in the model, where
        it has them, and around none.
        """
        present = next((one for one in self.model.effects if type(one) is effect), None)
        values = effect.to_coefficients(present.values) if present is not None else {}
        for coefficient in effect.coefficients:
            step = coefficient.scale
            moved = effect.at({**values, coefficient.name: values.get(coefficient.name, 0) + step})
            if not isinstance(moved, BodyEffect):
                change = moved.force(self.state)
                change = change if present is None else change - present.force(self.state)
                full = bare = self.sensed(change / step)
            else:
                state = (moved.apply(self.state) if present is None
                         else self._solved(self._with(present, moved)))
                full = self.sensed((self._forces(state) - self._reference) / step)
                bare = self.sensed((state.rigid_body.force - self.state.rigid_body.force) / step)
            yield full, bare

    def _with(self, old: CatalogueEffect, new: CatalogueEffect) -> DriveModel:
        return replace(self.model, effects=tuple(
            new if effect is old else effect for effect in self.model.effects))

    def _solved(self, model: DriveModel) -> MechanismState:
        """Return the state with another model of the same geometry."""
        state = replace(self.state, load=None, reversal=model.reversal).loaded(model.robot)
        for effect in model.effects:
            if isinstance(effect, BodyEffect):
                state = effect.apply(state)
        return state

    def _difference(self, model: DriveModel) -> Array:
        """Return the change with another model of the same geometry, memories left out."""
        state = self._solved(model)
        total = state.rigid_body.force + sum(
            effect.force(state) for effect in following(model))
        difference: Array = total - self._reference
        return difference

    def of_numbers(self, numbers: tuple[Number, ...]) -> Array:
        """Return the column of each number, per standard deviation, (K, N, 6)."""
        columns = np.zeros((len(numbers), *self.state.velocity.shape))
        together: dict[str, Array] = {}
        for row, number in enumerate(numbers):
            key, element = number.key, number.element
            if key in PER_DRIVE or key in PER_CHAIN:
                if key not in together:
                    together[key] = self._moved(key, None)
                assert element is not None
                mine = ([element] if key in PER_DRIVE else [element, element + 3])
                columns[row][:, mine] = together[key][:, mine]
            else:
                columns[row] = self._moved(key, element)
            now = self.model.values[key] if element is None else self.model.values[key][element]
            columns[row] = self.sensed(columns[row] * number.deviation / abs(now))
        return columns

    def _moved(self, key: str, element: int | None) -> Array:
        """Return the change per relative change of a number, or of all of a list, (N, 6)."""
        value = self.model.values[key]
        if isinstance(value, tuple):
            moved: Any = tuple(one * (1 + RELATIVE_STEP * (element in (None, k)))
                               for k, one in enumerate(value))
        else:
            moved = value * (1 + RELATIVE_STEP)
        model = DriveModel.from_parameters({**self.model.values, key: moved})
        if key.startswith('geometry.'):
            s = self.state
            found = solve_forward_motion(model.robot.geometry, s.position, s.velocity,
                                         s.acceleration, s.motion[:1])
            motion = found.motion if s.time is None else found.motion.with_time(s.time)
            change = model.forces_at(model.mechanism(motion)).total - self.model.forces_at(
                self.model.mechanism(s.motion)).total
        elif key.startswith('friction.'):
            change = self._changed_friction(model)
        else:
            change = self._difference(model)
        result: Array = change / RELATIVE_STEP
        return result

    def _changed_friction(self, model: DriveModel) -> Array:
        state = replace(self.state, reversal=model.reversal)
        change = np.zeros_like(self.state.velocity)
        for before, after in zip(self.model.effects, model.effects, strict=True):
            if isinstance(after, (ActiveFriction, PassiveFriction)):
                change += after.force(state) - before.force(self.state)
        return change

    def of_drive_widths(self) -> Array:
        """Return what other widths of turning over would change in each drive, (W, N, 6)."""
        friction = next(e for e in self.model.effects if isinstance(e, ActiveFriction))
        return np.stack([self.sensed(column) for column in reversal_columns(
            friction.dry(self.state.guide_load), self.state.velocity, self.state.direction,
            np.asarray(self.model.reversal.velocity))])

    def of_passive_widths(self) -> Array:
        """Return the same for the passive joints, all at once, (W, N, 6)."""
        friction = next(e for e in self.model.effects if isinstance(e, PassiveFriction))
        return np.stack([self.sensed(column) for column in
                         passive_reversal_columns(friction, self.state)])

    def of_homing(self, samples: np.ndarray) -> Array:
        """Return the change per metre that each drive's measured position is too large.

        Parameters
        ----------
        samples : (n,) int array
            Of the chunk; the others would tell nothing new.

        Returns
        -------
        (6, n, 6) array
            By the drive that is off, then samples and drives [N/m].
        """
        from scipy.spatial.transform import Rotation

        s = self.state
        motion, time = s.motion[samples], None if s.time is None else s.time[samples]
        velocity, acceleration = s.velocity[samples], s.acceleration[samples]
        robot = self.model.robot
        bare = replace(self.model, effects=tuple(
            effect for effect in self.model.effects if effect.initial_memory() is None))
        turned = Rotation.from_quat(motion.orientation)

        def forces(pose: PlatformMotion) -> Array:
            rates = platform_rates(robot.geometry, pose, velocity, acceleration)
            rates = rates if time is None else rates.with_time(time)
            return bare.forces_at(bare.mechanism(rates)).total

        before, step = forces(motion), HOMING_STEP * robot.geometry.rod_length
        columns = np.empty((len(DRIVES), len(samples), len(DRIVES)))
        for drive in range(len(DRIVES)):
            move = -step * s.jacobians.J[samples][:, :, drive]
            pose = PlatformMotion.at_rest(
                motion.position + move[:, :3],
                (Rotation.from_rotvec(move[:, 3:]) * turned).as_quat())
            columns[drive] = (forces(pose) - before) / step
        return columns
