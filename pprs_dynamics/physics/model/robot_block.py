# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The block of a model file that describes a mechanism: its description, drives, loops, home."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.laws.drive_friction import DriveFriction, DriveOffset
from pprs_dynamics.physics.effects.laws.joint_friction import (
    IndependentChainsFriction,
    ModelJointFriction,
    PrintedFriction,
)
from pprs_dynamics.physics.mechanism.description import (
    REVOLUTE,
    Description,
    Frame,
    Loop,
    Transmission,
)
from pprs_dynamics.physics.mechanism.evaluation import not_compiling_yet
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.state import Reversal
from pprs_dynamics.physics.mechanism.structure import Structure, build_structure, pose_frame
from pprs_dynamics.physics.mechanism.urdf import read_urdf
from pprs_dynamics.physics.model import keys
from pprs_dynamics.physics.model.forces import DriveLimits
from pprs_dynamics.physics.model.recorded_names import gravity_in_efforts
from pprs_dynamics.physics.three_pprs import robot as three_pprs
from pprs_dynamics.physics.three_pprs.robot import Geometry, Masses
from pprs_dynamics.system.package_files import located

STROKES = ('limits.slide_stroke',) * 3 + ('limits.lift_stroke',) * 3  # keys, by drive
# Joints whose motors do not move one joint each.
COUPLED = ('differential', 'fourbar')
STANDARD_GRAVITY = (0.0, 0.0, -9.81)  # [m/s^2] where no description has it
# Elements of an inertia tensor: as files have them, and as `Mechanism` has them.
OF_FILES, OF_MECHANISM = ('xx', 'yy', 'zz', 'xy', 'xz', 'yz'), ('xx', 'xy', 'yy', 'xz', 'yz', 'zz')
FROM_FILES = [OF_FILES.index(axes) for axes in OF_MECHANISM]
TO_FILES = [OF_MECHANISM.index(axes) for axes in OF_FILES]


def read_platform(values: Mapping[str, Any],
                  ) -> tuple[three_pprs.ThreePprs, tuple[Effect, ...], Reversal, DriveLimits]:
    """Return a 3-PPRS, its own friction, its smoothing and limits, from checked values."""
    for stroke in dict.fromkeys(STROKES):
        if not values[stroke][0] < values[stroke][1]:
            raise ModelError(stroke, values[stroke], 'be a lower and a higher position [m]')
    blocks = {joint: {'viscous': values[f'friction.{joint}.viscous'],
                      'coulomb': values[f'friction.{joint}.coulomb'],
                      'radius': values[f'friction.{joint}.diameter'] / 2}
              for joint in (REVOLUTE, three_pprs.SPHERICAL)}
    is_independent = values['friction.approach'] == 'independent_chains'
    is_printed = values['equations'] == 'printed'
    passive = (IndependentChainsFriction(blocks, values['limits.rod_cosine']) if is_independent
               else PrintedFriction(blocks) if is_printed else ModelJointFriction(blocks))
    lower, upper = zip(*(values[key] for key in STROKES), strict=True)
    robot = three_pprs.ThreePprs.of(
        Geometry(**keys.below(values, 'geometry.')), Masses(**keys.below(values, 'masses.')),
        gravity_in_efforts(values, 'gravity'), (lower, upper, values['limits.effort']),
        radii={name: block['radius'] for name, block in blocks.items()},
        bounds=three_pprs.SingularityBounds(
            values['limits.rod_sine'], values['limits.condition_number'],
            values['limits.rod_cosine'] if is_independent else 0.0),
        printed=is_printed)
    drives = DriveFriction(values['friction.drives.viscous'], 0.0,
                           values['friction.drives.coulomb'])
    return (robot, (drives, passive),
            Reversal(_reversal_widths(values), values['friction.reversal_rate']),
            _limits(robot.structure, STROKES, 'limits.effort'))


def _reversal_widths(values: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the width in which friction of each drive turns over."""
    return tuple(own or values['friction.reversal_velocity']
                 for own in values['friction.reversal_velocities'])


def read_mechanism(values: dict[str, Any], folder: Path,
                   ) -> tuple[Mechanism, tuple[Effect, ...], Reversal, DriveLimits]:
    """Return a mechanism, its own friction, its smoothing and limits.

    The checked values are completed by those of the description.
    """
    structure = read_structure(values, folder)
    values.update(described_values(structure, values))
    robot = _with_bodies(structure, values)
    return (robot, (DriveFriction(values['friction.viscous'], values['friction.coulomb']),
                    DriveOffset(values['friction.offset']), *passive_friction(structure, values)),
            Reversal(_reversal_widths(values), values['friction.reversal_rate'],
                     values['friction.reversal_slide']),
            _limits(structure, ('its range in the URDF',) * len(structure.drives),
                    'the effort limit of URDF or node'))


def _limits(structure: Structure, sources: tuple[str, ...], effort_source: str) -> DriveLimits:
    return DriveLimits(
        structure.drives, tuple(DriveUnits(kind == REVOLUTE) for kind in structure.kinds),
        structure.lower, structure.upper, structure.effort, sources, effort_source)


def read_structure(values: dict[str, Any], folder: Path) -> Structure:
    """Return the structure that a block describes; the path in `values` becomes absolute.

    Raises
    ------
    ModelError
        Where it cannot be: see `build_structure`.
    UnreadableFileError
        Where its description cannot be read.
    """
    given = [key for key in keys.FILES if values.get(key)]
    if not given:
        raise ModelError('robot.urdf', MISSING, 'be given, or robot.mjcf instead')
    if len(given) > 1:
        raise ModelError(given[1], values[given[1]], f'not be given with {given[0]}')
    values[given[0]] = str(located(values[given[0]], folder))
    if given[0].endswith('mjcf'):
        from pprs_dynamics.physics.mechanism.mjcf import read_mjcf
        description = read_mjcf(values[given[0]])
    else:
        description = read_urdf(values[given[0]])
        _require_motors(description, values)
    own = tuple((key, value) for key, value in values.items()
                if key.startswith(('robot.home.', 'robot.loops.', keys.LOCKED)))
    return _structure(description, values['robot.base'], values['robot.tool'],
                      values[keys.DRIVES_KEY], own)


@lru_cache(maxsize=64)
def _structure(description: Description, base: str, tool: str, drives: tuple[str, ...],
               own: tuple[tuple[str, Any], ...]) -> Structure:
    home, poses = keys.below(dict(own), 'robot.home.'), {}
    for name in [name for name in home if name.endswith(keys.POSE)]:
        pose, link = home.pop(name), name.removesuffix(keys.POSE)
        if not np.linalg.norm(pose[3:]) > 0:
            raise ModelError(f'robot.home.{name}', list(pose), 'have a quaternion that is not zero')
        if link not in description.links:
            raise UnknownNameError('link', link, description.links, 'robot.home')
        poses[link] = pose_frame(pose)
    loops = keys.blocks_below(dict(own), 'robot.loops.')
    for loop in description.loops:
        if loop.name in loops:
            raise ModelError(f'robot.loops.{loop.name}', loop.kind, 'not stand in the file as '
                             'well as in the description')
    closures = (*description.loops, *(Loop(
        name, loop['type'], loop['a.link'], Frame.of(loop['a.xyz'], loop['a.rpy']),
        loop['b.link'], Frame.of(loop['b.xyz'], loop['b.rpy'])) for name, loop in loops.items()))
    return build_structure(description, base, tool, drives, closures, home, poses,
                           keys.below(dict(own), keys.LOCKED))


def _require_motors(description: Description, values: Mapping[str, Any]) -> None:
    """Raise ModelError where joints share a transmission, and the file does not say how."""
    drives = set(values[keys.DRIVES_KEY])
    mapped = {joint for turns in keys.blocks_below(values, keys.MOTORS).values() for joint in turns}
    for gear in coupled(description):
        shared = [name for name in gear.joints if name in drives]
        if set(shared) - mapped:
            turns = ', '.join(f'{name}: 1.0' for name in shared)
            raise ModelError(
                keys.DRIVES_KEY, list(gear.joints), 'have a motor each, but share a transmission '
                f'{gear.kind.lower()} in the URDF: write friction: {{motors: {{MOTOR: {{{turns}}}'
                '}}, turns of each motor per turn of its joints')


def coupled(description: Description) -> list[Transmission]:
    """Return the transmissions of a description whose motors do not move one joint each."""
    return [transmission for transmission in description.transmissions
            if any(word in transmission.kind.lower() for word in COUPLED)]


def described_values(structure: Structure, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return keys and values that a description gives where the file is silent, with defaults.

    Raises
    ------
    ModelError
        For what a description holds of a joint that has no place in a model.
    """
    joints = structure.description.joints
    drives = [joints[name] for name in structure.drives]
    found: dict[str, Any] = {
        'robot.gear_ratio': tuple(joint.reduction or 1.0 for joint in drives),
        'robot.gravity': described_gravity(structure),
        'robot.armature': tuple(joint.armature for joint in drives),
        'friction.viscous': tuple(joint.damping for joint in drives),
        'friction.coulomb': tuple(joint.dry for joint in drives)}
    found = {key: described for key, described in found.items() if not values[key]}
    for name in structure.rows:
        joint = joints[name]
        if joint.spring is not None:
            stiffness, relaxed = joint.spring
            block_of_effect = f'{name}: {{stiffness: {stiffness:g}, position: {relaxed:g}}}'
            effect = 'drive_spring' if name in structure.drives else 'joint_spring'
            raise ModelError('robot.mjcf', name, f'have no spring ({stiffness:g}): take its '
                             f'stiffness off, and write effects: {{active: [{effect}], '
                             f'{effect}: {{{block_of_effect}}}}}')
        if name in structure.drives:
            continue
        if joint.armature:
            raise ModelError('robot.mjcf', name, f'have no armature ({joint.armature:g}), as a '
                             'joint without a motor: set its armature to 0')
        given = f'{keys.JOINTS}{name}.'
        if (joint.damping or joint.dry) and not any(key.startswith(given) for key in values):
            found |= {f'{given}viscous': joint.damping, f'{given}torque': joint.dry,
                      f'{given}coulomb': 0.0, f'{given}radius': 0.0}
    return found


def described_gravity(structure: Structure) -> tuple[float, ...]:
    """Return gravity in the base, turned from the frame of the description's root."""
    description = structure.description
    _, frame = structure.links[description.root]
    turned = frame.R @ np.array(description.gravity or STANDARD_GRAVITY)
    return tuple(float(component) for component in turned)


def motor_map(structure: Structure, values: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """Return the turns of motors per turn of each drive, of those that the file names.

    Raises
    ------
    ModelError
        For a joint that is no drive, and a motor that moves fewer than two.
    """
    rows = keys.blocks_below(values, keys.MOTORS)
    for motor, ratios in rows.items():
        for joint in ratios:
            if joint not in structure.drives:
                raise UnknownNameError('drive', joint, structure.drives, f'{keys.MOTORS}{motor}')
        if sum(value != 0 for value in ratios.values()) < 2:
            raise ModelError(f'{keys.MOTORS}{motor}', ratios, 'move two joints or more: one that '
                             'moves one has its friction in friction.viscous and friction.coulomb')
    return {motor: tuple(ratios.get(drive, 0.0) for drive in structure.drives)
            for motor, ratios in rows.items()}


def passive_friction(structure: Structure, values: Mapping[str, Any],
                     ) -> Iterator[ModelJointFriction]:
    """Yield the model's own friction in passive joints and loops, if it has any."""
    blocks, rows = keys.blocks_below(values, keys.JOINTS), structure.friction_rows
    for name in blocks:
        if name not in rows:
            raise UnknownNameError('joint', name, rows, 'friction.joints')
        joint = rows[name][0]
        turns = joint < 0 or structure.tables.turns[joint]
        if turns and blocks[name]['coulomb'] and not blocks[name]['radius']:
            raise ModelError(f'friction.joints.{name}.radius', blocks[name]['radius'],
                             'be greater than 0 with coulomb: the load rubs at it [m]')
    if blocks:
        yield ModelJointFriction(blocks)


def inertial_values(inertial: Array) -> dict[str, tuple[float, ...]]:
    """Return the keys and values in files of inertial parameters (B, 10); see `Mechanism`."""
    return {'links.mass': tuple(inertial[:, 0].tolist()),
            'links.moment': tuple(inertial[:, 1:4].ravel().tolist()),
            'links.inertia': tuple(inertial[:, 4:][:, TO_FILES].ravel().tolist())}


def _with_bodies(structure: Structure, values: Mapping[str, Any]) -> Mechanism:
    """Return the mechanism with its bodies, from the file where it has them."""
    bodies = np.flatnonzero(structure.inertial.any(axis=1))
    inertial = structure.inertial[bodies]
    for key, first, size in (('links.mass', 0, 1), ('links.moment', 1, 3),
                             ('links.inertia', 4, 6)):
        if not values[key]:
            continue
        if len(values[key]) != size * len(bodies):
            names = ', '.join(structure.moved_by[int(row)] for row in bodies)
            raise ModelError(key, list(values[key]), f'contain {size * len(bodies)} numbers, '
                             f'{size} for each of {names}')
        given = np.reshape(values[key], (-1, size))
        inertial[:, first:first + size] = given[:, FROM_FILES] if size == 6 else given
    for row, (mass, *moment) in zip(bodies, inertial[:, :4], strict=True):
        if mass < 0 or (mass == 0 and any(moment)):
            name = next(name for name, at in structure.rows.items() if at == row)
            raise ModelError('links.mass', float(mass), f'be greater than 0 for what {name} moves')
    robot = Mechanism(structure, bodies, inertial, np.array(values['robot.armature']),
                      gravity_in_efforts(values, 'robot.gravity'),
                      {name: block['radius'] for name, block in
                       keys.blocks_below(values, keys.JOINTS).items() if block['radius']},
                      motor_map(structure, values))
    _require_driven_bodies(robot)
    return robot


def _require_driven_bodies(robot: Mechanism) -> None:
    """Raise ModelError for a drive that moves no mass at home."""
    structure, count = robot.structure, len(robot.drives)
    pushed = np.eye(count + 1, count)  # one drive after the other, and none
    home = np.tile(structure.home[structure.tables.drives], (count + 1, 1))
    with not_compiling_yet():
        efforts = robot.torques(home, np.zeros_like(home), pushed)
    felt = np.diag(efforts[:-1] - efforts[-1]) + robot.armature
    for name, inertia in zip(structure.drives, felt, strict=True):
        if not inertia > 0:
            raise ModelError(keys.DRIVES_KEY, name,
                             'move a body: no link that it moves has a mass')
