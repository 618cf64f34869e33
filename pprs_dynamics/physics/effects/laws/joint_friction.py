# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in the passive joints and loops of a mechanism.

Torque against the relative rate: c w + (T + mu r F) sgn(w), with F the force that the joint
transmits across its axis, of a ball all of it; by virtual work T' tau at the drives.

References
----------
T.-P. Itul, D. L. Pisla, The Influence of Friction on the Dynamic Model for a 6-DOF Parallel Robot
with Triangular Platform, 2007, on the friction of revolute and ball joints.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.added_body import flattened, nested
from pprs_dynamics.physics.effects.effect import ARM, Card, Effect, Parameter
from pprs_dynamics.physics.effects.structure_effect import PassiveJointEffect
from pprs_dynamics.physics.mechanism.alike import proportional_joints
from pprs_dynamics.physics.mechanism.linkage_equations import JointFriction
from pprs_dynamics.physics.mechanism.mechanism import LinkageState, Mechanism
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.mechanism.structure import Structure

RADIUS = 0.01  # [m] at which a load rubs where the model does not say
ROTATING = ('spherical', 'revolute', 'universal')


def friction_rows(structure: Structure) -> dict[str, tuple[int, int]]:
    """Return joints that move and rotating loops by name: joint of the tables or -1, loop or -1."""
    held = set(structure.mobility.held.tolist())
    joints = {name: (row, -1) for name, row in structure.rows.items()
              if int(structure.tables.coordinate[row]) not in held}
    return joints | {loop.name: (-1, k) for k, loop in enumerate(structure.loops)
                     if loop.kind in ROTATING}


def friction_table(structure: Structure, blocks: Mapping[str, Mapping[str, float]],
                   reversal: Reversal) -> JointFriction:
    """Return the table of some joints' friction.

    Parameters
    ----------
    structure : Structure
    blocks : mapping of str to mapping
        `viscous`, `torque`, `coulomb` and `radius` by joint; 0 where one is left out, but the
        radius of a slide, which is 1.
    reversal : Reversal
        In drives by their velocity, in all others by their rate, or that of slides.
    """
    widths = dict(zip(structure.drives, reversal.widths(len(structure.drives)).tolist(),
                      strict=True))
    rows = friction_rows(structure)
    joint, loop = (np.array([rows[name][side] for name in blocks], dtype=np.int64)
                   for side in (0, 1))
    viscous, torque, coulomb = (
        np.array([float(block.get(key, 0.0)) for block in blocks.values()])
        for key in ('viscous', 'torque', 'coulomb'))
    slides = [row >= 0 and not structure.tables.turns[row] for row in joint]
    radius = np.array([1.0 if slide else float(block.get('radius', 0.0))
                       for slide, block in zip(slides, blocks.values(), strict=True)])
    return JointFriction(joint, loop, viscous, torque, coulomb * radius,
                         np.array([widths.get(name, reversal.slide if slide else reversal.rate)
                                   for name, slide in zip(blocks, slides, strict=True)]))


class JointFrictionEffect(PassiveJointEffect):
    """Friction of passive joints beyond the model's."""

    name: ClassVar[str] = 'joint_friction'
    acts_in = frozenset({ARM})
    is_friction: ClassVar[bool] = True
    is_of_one_place: ClassVar[bool] = True
    linear = ()
    radii: ClassVar[Mapping[str, float]] = {}
    card = Card(
        'tau -> tau + T\' (c w + (T + mu r F) sgn(w)), of one passive joint',
        'errors of several drives at once, in the proportions in which they move the joint, with '
        'the sign of its rate or growing with it',
        'a bearing that runs dry, is overtightened or worn; a seal; a cable loom over the joint',
        'take the load off, move the joint by hand and compare it with its like; lubricate it and '
        'repeat: the error must fall',
        'Itul, Pisla, The Influence of Friction on the Dynamic Model for a 6-DOF Parallel Robot, '
        '2007')

    @classmethod
    def bound(cls, robot: Any) -> Any:
        """Return the effect in the passive joints of a mechanism."""
        if not isinstance(robot, Mechanism):
            return cls
        joints = [name for name in friction_rows(robot.structure)
                  if name not in robot.structure.drives]
        groups = tuple(tuple(sorted(group, key=lambda name: name not in robot.structure.drives))
                       for group in proportional_joints(robot.structure) if len(group) > 1)
        return _in_joints(tuple((name, robot.radii.get(name, RADIUS)) for name in joints), groups)

    @classmethod
    def from_file(cls, values: Mapping[str, Any], complete: bool = True) -> Self:
        """Build the effect from blocks by joint."""
        return cls(cls._checked(f'effects.{cls.name}', flattened(values), complete))

    def to_file(self) -> dict[str, Any]:
        """Return blocks of the joints that it is in."""
        return nested({name: value for name, value in self.values.items() if value})

    def force(self, state: Any, memory: Any = None) -> Array:
        """Return the drives' efforts [N m, N], (N, D)."""
        assert isinstance(state, LinkageState)
        blocks: dict[str, dict[str, float]] = nested(
            {name: value for name, value in self.values.items() if value})
        for name, block in blocks.items():
            block['radius'] = self.radii[name]
        table = friction_table(state.robot.structure, blocks, state.reversal)
        return state.against_friction(table)


@cache
def _in_joints(joints: tuple[tuple[str, float], ...], alike: tuple[tuple[str, ...], ...],
               ) -> type[JointFrictionEffect]:
    """Return the effect in joints with the radii at which the load rubs [m].

    Of joints that are alike the first stands for all, whatever the load; a drive for friction
    of its own.
    """
    linear, variants, bounds = [], [], {}
    stand_ins = {name for group in alike for name in group[1:]}
    for name, _ in joints:
        linear += [
            Parameter(f'{name}.viscous', 'c', 'N m s/rad', f'viscous friction of {name}', -1e4,
                      1e4, 0.0, scale=0.1),
            Parameter(f'{name}.torque', 'T', 'N m', f'dry friction of {name}, whatever its load',
                      -1e4, 1e4, 0.0, scale=0.1),
            Parameter(f'{name}.coulomb', 'mu', '1', f'dry friction of {name} over its load',
                      -100.0, 100.0, 0.0, scale=0.1)]
        if name not in stand_ins:
            variants += [(f'{name}.viscous',), (f'{name}.torque',),
                         (f'{name}.viscous', f'{name}.torque')]
        variants.append((f'{name}.coulomb',))
        bounds.update({f'{name}.{last}': 0.0 for last in ('viscous', 'torque', 'coulomb')})
    return type('JointFrictionEffect', (JointFrictionEffect,), {
        'linear': tuple(linear), 'variants': tuple(variants), 'radii': dict(joints),
        'unphysical_below': bounds, 'alike': alike, '__module__': __name__,
        'made_by': (_in_joints, (joints, alike))})


class LinkageFriction(Effect):
    """The model's own friction in passive joints.

    Parameters
    ----------
    structure : Structure
    blocks : mapping of str to mapping
        See `friction_table`.
    """

    name: ClassVar[str] = 'passive_friction'

    def __init__(self, structure: Structure, blocks: Mapping[str, Mapping[str, float]]) -> None:
        self.structure, self.blocks = structure, {name: dict(one) for name, one in blocks.items()}
        self._tables: dict[Reversal, JointFriction] = {}

    def force(self, state: Any, memory: Any = None) -> Array:
        """Return the drives' efforts [N m, N], (N, D)."""
        assert isinstance(state, LinkageState)
        return state.against_friction(self.table(state.reversal))

    def table(self, reversal: Reversal) -> JointFriction:
        """Return the table of its friction; computed once for each way to turn over."""
        if reversal not in self._tables:
            self._tables[reversal] = friction_table(self.structure, self.blocks, reversal)
        return self._tables[reversal]
