# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How the efforts of an arm's joints change with its numbers and with effects on its bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
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
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction
from pprs_dynamics.physics.effects.laws.joint_friction import LinkageFriction
from pprs_dynamics.physics.effects.structure_effect import BodyEffect, StructureEffect
from pprs_dynamics.physics.mechanism.mechanism import LinkageState
from pprs_dynamics.physics.model.arm_model import ArmForces, ArmModel
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.keys import is_gain
from pprs_dynamics.system.parallel import each

HOMING_STEP = 1e-4  # [rad, m]


class ArmSensitivities(Sensitivities):
    """Columns of an arm.

    Parameters
    ----------
    model : ArmModel
    given : ForceModel
    """

    model: ArmModel

    def __init__(self, model: ForceModel, given: ForceModel) -> None:
        super().__init__(model, given)
        self._following = following(self.model)
        # Built once, not chunk by chunk.
        self._moved = [None if is_gain(number.key) else self._with(number)
                       for number in self.numbers]

    def columns(self, forces: ArmForces) -> dict[str, Array]:
        """Return columns of all kinds, (K, N, n) each."""
        state = forces.mechanism
        reference = self._efforts(self.model, state)
        numbers = np.zeros((len(self.numbers), *state.velocity.shape))
        for row, (number, moved) in enumerate(zip(self.numbers, self._moved, strict=True)):
            if moved is None:
                assert number.element is not None
                # The more torque an ampere gives, the fewer amperes the model's torque takes.
                numbers[row, :, number.element] = (
                    -forces.total[:, number.element] * number.deviation
                    / self.model.gain[number.element])
                continue
            change = self._efforts(moved, self._state(moved, state)) - reference
            numbers[row] = self.sensed(
                change * number.deviation / (RELATIVE_STEP * abs(number.value)), state)
        dry = sum((effect.dry(state.guide_load) for effect in self.model.effects
                   if isinstance(effect, AxisFriction)), np.zeros_like(state.guide_load))
        widths = np.stack([self.sensed(column, state) for column in reversal_columns(
            dry, state.velocity, state.direction, np.asarray(self.model.reversal.velocity))])
        columns = {NUMBERS: numbers, OF_DRIVES: widths, HOMING: self._homing(state, reference)}
        for friction in self._following:
            if isinstance(friction, LinkageFriction):
                columns[OF_JOINTS] = np.stack([self.sensed(column, state) for column in
                                               passive_reversal_columns(friction, state)])
        for effect in self.searched:
            full, bare = self._of_structure(effect, state, reference, {})
            columns[effect.name] = full
            if issubclass(effect, BodyEffect):
                columns[BARE + effect.name] = bare
        known = {effect.name for effect in self.given.effects}
        for present in self.model.effects:
            if isinstance(present, StructureEffect) and present.name in known:
                columns[PRESENT + present.name] = self._of_structure(
                    type(present), state, reference, present.to_coefficients(present.values))[0]
        return columns

    def _with(self, number: Number) -> ArmModel:
        """Return the model with a number moved away from 0 by `RELATIVE_STEP` of the given one."""
        value: Any = self.model.values[number.key]
        step = RELATIVE_STEP * number.value
        moved = (value + step if number.element is None else tuple(
            one + step * (k == number.element) for k, one in enumerate(value)))
        return ArmModel.from_parameters({**self.model.values, number.key: moved})

    def _state(self, model: ArmModel, state: LinkageState) -> LinkageState:
        """Return the same motion with the bodies of another model."""
        found = replace(state, robot=model.robot, reversal=model.reversal, load=None,
                        known=state.linkage)
        for effect in model.effects:
            if isinstance(effect, BodyEffect):
                found = effect.apply(found)
        return found

    def _efforts(self, model: ArmModel, state: LinkageState) -> Array:
        """Return efforts at a state, without effects that know their past."""
        at: Any = state
        own = {effect.name: effect for effect in model.effects}
        total: Array = state.rigid_force + sum(
            own[effect.name].force(at) for effect in self._following)
        return total

    def _homing(self, state: LinkageState, reference: Array) -> Array:
        """Return the change per radian, or metre, that each joint is measured too far."""
        def column(k: int) -> Array:
            position = state.position.copy()
            position[:, k] -= HOMING_STEP
            moved = replace(state, position=position)
            return (self._efforts(self.model, moved) - reference) / HOMING_STEP

        return np.stack(each(column, range(len(self.model.drives))))

    def _of_structure(self, effect: type[StructureEffect], state: LinkageState, reference: Array,
                      values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return columns per unit of each coefficient, around values that the model has.

        As the model says, and as they would be if friction did not follow the loads that the
        effect adds.
        """
        def columns(coefficient: Parameter) -> tuple[Array, Array]:
            step = coefficient.scale
            moved: Any = effect.at({**values, coefficient.name:
                                    values.get(coefficient.name, 0.0) + step})
            if not isinstance(moved, BodyEffect):
                at: Any = state
                change = self.sensed((moved.force(at) - effect.at(values).force(at)) / step, state)
                return change, change
            if values:
                model = replace(self.model, effects=tuple(
                    moved if type(one) is effect else one for one in self.model.effects))
                found = self._state(model, state)
            else:
                found = moved.apply(state)
            return (self.sensed((self._efforts(self.model, found) - reference) / step, state),
                    self.sensed((found.rigid_force - state.rigid_force) / step, state))

        full, bare = zip(*each(columns, effect.coefficients), strict=True)
        return np.stack(full), np.stack(bare)
