# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Passive joints and loops of a mechanism, and their friction as its equations take it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pprs_dynamics.physics.mechanism.places import PassiveJoint
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.mechanism.structure import Structure
from pprs_dynamics.physics.mechanism.tree_tables import JointFriction

ROTATING = ('spherical', 'revolute', 'universal')


def friction_rows(structure: Structure) -> dict[str, tuple[int, int]]:
    """Return joints that move and rotating loops by name: joint of the tables or -1, loop or -1."""
    held = set(structure.mobility.held.tolist())
    joints = {name: (row, -1) for name, row in structure.rows.items()
              if int(structure.tables.coordinate[row]) not in held}
    return joints | {loop.name: (-1, k) for k, loop in enumerate(structure.loops)
                     if loop.kind in ROTATING}


def passive_joints(structure: Structure, radii: Mapping[str, float]) -> tuple[PassiveJoint, ...]:
    """Return the joints and rotating loops without a drive; `radii` as of `Mechanism`."""
    return tuple(PassiveJoint(name, radii.get(name, 0.0),
                              row < 0 or bool(structure.tables.turns[row]), row >= 0)
                 for name, (row, _) in friction_rows(structure).items()
                 if name not in structure.drives)


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
