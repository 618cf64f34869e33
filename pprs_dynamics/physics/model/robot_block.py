# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The block of a model file that describes a mechanism: its description, drives, loops, home."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.effects.laws.joint_friction import LinkageFriction, friction_rows
from pprs_dynamics.physics.mechanism.description import Description, Frame, Loop
from pprs_dynamics.physics.mechanism.structure import Structure, build_structure, pose_frame
from pprs_dynamics.physics.mechanism.urdf import read_urdf, transmissions
from pprs_dynamics.physics.model.keys import ARM, POSE, drives_key, mechanism_block

# Joints whose motors do not move one joint each.
COUPLED = ('differential', 'fourbar')


def read_structure(values: dict[str, Any], folder: Path) -> Structure:
    """Return the structure that a block describes; the path in `values` becomes absolute.

    Raises
    ------
    ModelError
        Where it cannot be: see `build_structure`.
    UnreadableFileError
        Where its description cannot be read.
    """
    block = mechanism_block(values)
    given = [key for key in (f'{block}.urdf', f'{block}.mjcf') if values.get(key)]
    if not given:
        raise ModelError(f'{block}.urdf', MISSING, f'be given, or {block}.mjcf instead')
    if len(given) > 1:
        raise ModelError(given[1], values[given[1]], f'not stand beside {given[0]}')
    values[given[0]] = str((folder / values[given[0]]).resolve())
    if given[0].endswith('mjcf'):
        from pprs_dynamics.physics.mechanism.mjcf import read_mjcf
        description = read_mjcf(values[given[0]])
    else:
        description = read_urdf(values[given[0]])
        _require_one_motor_each(values, block)
    own = tuple((key, value) for key, value in values.items()
                if key.startswith((f'{block}.home.', f'{block}.loops.')))
    return _structure(description, block, values[f'{block}.base'], values[f'{block}.tool'],
                      values[drives_key(block)], own)


@lru_cache(maxsize=64)
def _structure(description: Description, block: str, base: str, tool: str,
               drives: tuple[str, ...], own: tuple[tuple[str, Any], ...]) -> Structure:
    home: dict[str, float] = {}
    poses: dict[str, Frame] = {}
    loops: dict[str, dict[str, Any]] = {}
    for key, value in own:
        kind, _, name = key.removeprefix(f'{block}.').partition('.')
        if kind == 'loops':
            name, _, rest = name.partition('.')
            loops.setdefault(name, {})[rest] = value
        elif name.endswith(POSE):
            if not np.linalg.norm(value[3:]) > 0:
                raise ModelError(key, list(value), 'hold a quaternion that is not zero')
            poses[name.removesuffix(POSE)] = pose_frame(value)
        else:
            home[name] = value
    for name in poses:
        if name not in description.links:
            raise UnknownNameError('link', name, description.links, f'{block}.home')
    closures = (*description.loops, *(Loop(
        name, one['type'], one['a.link'], Frame.of(one['a.xyz'], one['a.rpy']),
        one['b.link'], Frame.of(one['b.xyz'], one['b.rpy'])) for name, one in loops.items()))
    return build_structure(description, base, tool, drives, closures, home, poses, block=block,
                           lock_others=block == ARM)


def _require_one_motor_each(values: Mapping[str, Any], block: str) -> None:
    drives = values[drives_key(block)]
    for kind, coupled in transmissions(values[f'{block}.urdf']):
        if any(word in kind for word in COUPLED) and set(coupled) & set(drives):
            raise ModelError(drives_key(block), coupled, 'have a motor each, but share a '
                             f'transmission {kind} in the URDF: coupled joints are not covered')


def joint_radii(values: Mapping[str, Any]) -> dict[str, float]:
    """Return the radii at which loads of joints rub, where the file has them [m]."""
    return {key.removeprefix('friction.joints.').removesuffix('.radius'): value
            for key, value in values.items()
            if key.startswith('friction.joints.') and key.endswith('.radius') and value}


def passive_friction(structure: Structure, values: Mapping[str, Any]) -> Iterator[LinkageFriction]:
    """Yield the model's own friction in passive joints and loops, if it has any."""
    blocks: dict[str, dict[str, float]] = {}
    for key, value in values.items():
        if key.startswith('friction.joints.'):
            name, _, last = key.removeprefix('friction.joints.').rpartition('.')
            blocks.setdefault(name, {})[last] = value
    for name in blocks:
        if name not in friction_rows(structure):
            raise UnknownNameError('joint', name, friction_rows(structure),
                                   'friction.joints')
        joint = friction_rows(structure)[name][0]
        turns = joint < 0 or structure.tables.turns[joint]
        if turns and blocks[name]['coulomb'] and not blocks[name]['radius']:
            raise ModelError(f'friction.joints.{name}.radius', blocks[name]['radius'],
                             'be greater than 0 beside coulomb: the load rubs at it [m]')
    if blocks:
        yield LinkageFriction(structure, blocks)
