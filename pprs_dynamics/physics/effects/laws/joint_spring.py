# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Springs in passive joints: k (q - q_0), q an angle, or the position of a slide."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar, Self

import numpy as np

from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.laws.drive_spring import FARTHEST, relaxed_position
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.alike import alike_joints
from pprs_dynamics.physics.mechanism.state import MECHANISM, PLATFORM, MechanismState, StructureLoad


class JointSpring(BodyEffect):
    """A spring between the links of a passive joint; what is fitted is k q + M with M = -k q_0.

    On a 3-PPRS in its joints C_i, between lift and rod, alike in all chains.

    Equation
    --------
    tau -> tau + T' k (q - q_0), of one passive joint; of a 3-PPRS of all C_i

    Symptom
    -------
    Errors of several drives at once, in the proportions in which they move the joint, that
    follow its position whatever the speed. They are the same at every pass through a pose, in
    both directions.

    Causes
    ------
    Flexures in place of bearings, a cable loom or hose across the joint, a seal or boot that
    is deformed.

    Confirmation
    ------------
    Free the loom or take off the boot and repeat. Move slowly: the error must stay.

    References
    ----------
    Howell, Compliant Mechanisms, 2001.
    """

    name = 'joint_spring'
    acts_in = frozenset({PLATFORM, MECHANISM})
    is_of_one_place = True
    linear = ()
    joints: ClassVar[tuple[str, ...]] = ()

    def __init__(self, values: Mapping[str, float]) -> None:
        super().__init__(values)
        self.exact = self.to_coefficients(self.values)

    @classmethod
    def bound(cls, robot: Any) -> Any:
        """Return the effect in the passive joints of a robot that have a position."""
        return cls if robot is None else _in_joints(
            tuple((one.name, one.turns) for one in robot.passive_joints if one.has_position),
            alike_joints(robot))

    @classmethod
    def at(cls, coefficients: Mapping[str, float]) -> Self:
        """Return the effect with exactly these coefficients, for which there may be no q_0."""
        effect = super().at(coefficients)
        effect.exact = {c.name: float(coefficients.get(c.name, 0.0)) for c in cls.coefficients}
        return effect

    @classmethod
    def to_coefficients(cls, values: Mapping[str, float]) -> dict[str, float]:
        """Return k and M = -k q_0 of each joint."""
        found = {}
        for joint in cls.joints:
            k = values.get(f'{joint}.stiffness', 0.0)
            found[f'{joint}.stiffness'] = k
            found[f'{joint}.moment'] = 0.0 - k * values.get(f'{joint}.position', 0.0)
        return found

    @classmethod
    def from_coefficients(cls, coefficients: Mapping[str, float]) -> dict[str, float]:
        """Return k and q_0 of each joint; see `relaxed_position`."""
        found = {}
        for joint in cls.joints:
            found[f'{joint}.stiffness'], found[f'{joint}.position'] = relaxed_position(
                coefficients.get(f'{joint}.stiffness', 0.0),
                coefficients.get(f'{joint}.moment', 0.0))
        return found

    def load(self, state: MechanismState) -> StructureLoad:
        """Return k q + M in each joint."""
        torques = {}
        for joint in self.joints:
            k, moment = self.exact[f'{joint}.stiffness'], self.exact[f'{joint}.moment']
            if k or moment:
                torques[joint] = k * state.joint_position(joint) + moment
        return StructureLoad(np.zeros((len(state.velocity), 6)), torques)


@cache
def _in_joints(joints: tuple[tuple[str, bool], ...], alike: tuple[tuple[str, ...], ...],
               ) -> type[JointSpring]:
    """Return the effect in joints, that turn or slide; of joints that are alike the first."""
    linear, coefficients, variants = [], [], []
    stand_ins = {name for group in alike for name in group[1:]}
    for name, turns in joints:
        of_torque, of_position = ('N m', 'rad') if turns else ('N', 'm')
        stiffness = Parameter(f'{name}.stiffness', 'k', f'{of_torque}/{of_position}',
                              f'stiffness in {name}', -1e6, 1e6, 0.0, scale=0.1)
        linear += [stiffness, Parameter(
            f'{name}.position', 'q_0', of_position, f'position of {name} at which it is slack',
            -FARTHEST, FARTHEST, 0.0, scale=0.1)]
        coefficients += [stiffness, Parameter(
            f'{name}.moment', 'M', of_torque, f'what it does at position 0 of {name}, -k q_0',
            -1e6, 1e6, 0.0, scale=0.1)]
        if name not in stand_ins:
            variants.append((f'{name}.stiffness', f'{name}.moment'))
    return type('JointSpring', (JointSpring,), {
        'joints': tuple(name for name, _ in joints), 'linear': tuple(linear),
        'coefficients': tuple(coefficients), 'variants': tuple(variants), 'alike': alike,
        'unphysical_below': {f'{name}.stiffness': 0.0 for name, _ in joints},
        '__module__': __name__, 'made_by': (_in_joints, (joints, alike))})
