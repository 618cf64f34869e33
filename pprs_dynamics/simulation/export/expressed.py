# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The parts of a model that a simulator's format can hold, and names of the others.

A joint of URDF has viscous and dry friction; one of MJCF a rotor's inertia and a spring, too. Dry
friction turns over at once there: with `sgn` for tanh(v / width).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.laws.coulomb_friction import CoulombFriction
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.laws.drive_spring import DriveSpring
from pprs_dynamics.physics.effects.laws.joint_friction import JointFrictionEffect
from pprs_dynamics.physics.effects.laws.joint_spring import JointSpring
from pprs_dynamics.physics.effects.laws.viscous_friction import ViscousFriction
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import APPROACHES

MJCF, URDF = 'mjcf', 'urdf'
FORMATS = (URDF, MJCF)
DAMPING, FRICTION, ARMATURE, STIFFNESS = 'damping', 'frictionloss', 'armature', 'stiffness'
SPRINGREF = 'springref'
# What joints of a format have.
HELD = {URDF: {DAMPING, FRICTION}, MJCF: {DAMPING, FRICTION, ARMATURE, STIFFNESS, SPRINGREF}}
STANDARD_GRAVITY = (0.0, 0.0, -9.81)  # what is assumed of a format that does not say
HINGES, BALLS, RODS = (tuple(f'{part}_{n}' for n in (1, 2, 3)) for part in ('hinge', 'ball', 'rod'))
# Of effects on drives: their parameters as a joint's.
OF_DRIVES: Mapping[type[Effect], Mapping[str, str]] = {
    ViscousFriction: {'coefficient': DAMPING},
    CoulombFriction: {'force': FRICTION},
    DriveInertia: {'mass': ARMATURE},
    DriveSpring: {'stiffness': STIFFNESS, 'position': SPRINGREF},
}
OF_PASSIVE = {'viscous': DAMPING, 'torque': FRICTION, 'stiffness': STIFFNESS,
              'position': SPRINGREF}
# By joint, the numbers that a format names.
Joints = dict[str, dict[str, float]]


@dataclass(frozen=True)
class Expressed:
    """A model as far as a format can hold it.

    Parameters
    ----------
    model : DriveModel
        The whole one.
    robot : Mechanism or ThreePprs
        With the bodies and the gravity that the format holds.
    joints : dict of str to dict of str to float
        Of each joint `damping`, `frictionloss`, `armature`, `stiffness` and `springref`, where
        it has them.
    not_expressed : tuple of str
        Keys of the model file and names of effects; of robots with loops in URDF, their loops.
    """

    model: DriveModel
    robot: Any
    joints: Joints
    not_expressed: tuple[str, ...]


def express(model: DriveModel, kind: str) -> Expressed:
    """Return what a format can hold of a model.

    Parameters
    ----------
    model : DriveModel
    kind : {'urdf', 'mjcf'}
    """
    joints: Joints = {}
    left = [key for key, numbers in (_of_arm if model.moves_joints else _of_platform)(model)
            if not _take(joints, numbers, HELD[kind])]
    # Joints of a format that passive joints of the model are; those without do not turn alone.
    passive = {one.name: (one.name,) if model.moves_joints else HINGES
               for one in model.robot.passive_joints if one.has_position}
    robot = model.robot
    for effect in model.effects:
        if effect.name not in model.values.get('effects.active', ()):
            continue
        if _is_body(effect, kind, robot):
            assert isinstance(effect, BodyEffect)
            robot = effect.changed(robot)
        elif not _take(joints, _of_effect(effect, passive), HELD[kind]):
            left.append(effect.name)
    if kind == URDF:
        if tuple(model.robot.gravity) != STANDARD_GRAVITY:
            left.append('robot.gravity' if model.moves_joints else 'gravity')
        robot = replace(robot, gravity=STANDARD_GRAVITY)
        left += ([loop.name for loop in model.robot.structure.loops] if model.moves_joints
                 else list(BALLS))
    return Expressed(model, robot, {
        name: {key: value for key, value in numbers.items() if value}
        for name, numbers in joints.items()}, tuple(left))


def _take(joints: Joints, numbers: Joints | None, held: set[str]) -> bool:
    """Add numbers to joints; False, with nothing added, where the format cannot hold them."""
    if numbers is None:
        return False
    added = {name: {key: value + joints.get(name, {}).get(key, 0.0)
                    for key, value in own.items() if value} for name, own in numbers.items()}
    # No simulator takes a joint that gives power without end.
    if any(key not in held or (value < 0 and key != SPRINGREF)
           for own in added.values() for key, value in own.items()):
        return False
    for name, own in added.items():
        joints.setdefault(name, {}).update(own)
    return True


def _of_platform(model: DriveModel) -> Iterator[tuple[str, Joints | None]]:
    """Yield keys of the paper's friction and their numbers; None for loads, which no format has."""
    values = model.values
    yield 'friction.drives.viscous', _spread(model, 'friction.drives.viscous', DAMPING)
    yield ('friction.revolute.viscous',
           {name: {DAMPING: values['friction.revolute.viscous']} for name in HINGES})
    for key in ('friction.drives.coulomb', *(
            f'friction.{joint}.coulomb' for joint in ('revolute', 'spherical')
            if values[f'friction.{joint}.diameter']), 'friction.spherical.viscous'):
        if np.any(values[key]):
            yield key, None
    if values['friction.approach'] != APPROACHES[0]:
        yield 'friction.approach', None
    if values['equations'] != 'corrected':
        yield 'equations', None


def _of_arm(model: DriveModel) -> Iterator[tuple[str, Joints | None]]:
    """Yield keys of rotors and friction, also of passive joints; None for those of no format."""
    yield 'friction.viscous', _spread(model, 'friction.viscous', DAMPING)
    yield 'friction.coulomb', _spread(model, 'friction.coulomb', FRICTION)
    if np.any(model.values['friction.offset']):
        yield 'friction.offset', None
    yield 'robot.armature', _spread(model, 'robot.armature', ARMATURE)
    loops = {loop.name for loop in model.robot.structure.loops}
    for key, value in model.values.items():
        name, _, parameter = key.removeprefix('friction.joints.').rpartition('.')
        if key.startswith('friction.joints.') and parameter != 'radius' and value:
            number = None if name in loops else OF_PASSIVE.get(parameter)
            yield key, None if number is None else {name: {number: value}}


def _spread(model: DriveModel, key: str, number: str) -> Joints:
    """Return the numbers of all drives, or the number that is the same in all."""
    values = np.broadcast_to(np.asarray(model.values[key], dtype=float), len(model.drives))
    return {drive: {number: value}
            for drive, value in zip(model.drives, values.tolist(), strict=True)}


def _of_effect(effect: Effect, passive: Mapping[str, Sequence[str]]) -> Joints | None:
    """Return the numbers of an effect in drives or passive joints, None where it has others."""
    if isinstance(effect, DriveEffect) and type(effect) in OF_DRIVES:
        names = OF_DRIVES[type(effect)]
        return {drive: {names[key]: value for key, value in values.items()}
                for drive, values in effect.drives.items()}
    if not isinstance(effect, (JointFrictionEffect, JointSpring)):
        return None
    joints: Joints = {}
    for key, value in effect.values.items():
        joint, _, parameter = key.rpartition('.')
        if value and (joint not in passive or parameter not in OF_PASSIVE):
            return None
        for name in passive.get(joint, ()) if value else ():
            joints.setdefault(name, {})[OF_PASSIVE[parameter]] = value
    return joints


def _is_body(effect: Effect, kind: str, robot: Any) -> bool:
    """Return whether an effect changes bodies and adds no force; in URDF, not gravity either."""
    return (isinstance(effect, BodyEffect) and type(effect).load is BodyEffect.load
            and type(effect).apply is BodyEffect.apply
            and (kind == MJCF or effect.changed(robot).gravity == robot.gravity))
