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
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.mechanism.linkage_equations import JointFriction
from pprs_dynamics.physics.mechanism.mechanism import LinkageState
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.mechanism.structure import Structure

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
        In drives by their velocity, in all others by their rate.
    """
    widths = dict(zip(structure.drives, np.broadcast_to(
        reversal.velocity, len(structure.drives)).tolist(), strict=True))
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
                         np.array([widths.get(name, reversal.rate) for name in blocks]))


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

    def table(self, reversal: Reversal) -> JointFriction:
        """Return the friction with widths of turning over."""
        return friction_table(self.structure, self.blocks, reversal)

    def force(self, state: Any, memory: Any = None) -> Array:
        """Return the drives' efforts [N m, N], (N, D)."""
        assert isinstance(state, LinkageState)
        return state.linkage.joint_friction(state.robot, self.table(state.reversal))
