# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What of a model a simulator's format can hold: a model with no more than that, and the rest.

A joint of URDF has viscous and dry friction; one of MJCF a rotor's inertia and a spring, too. Dry
friction turns over at once there: with `sgn` for tanh(v / width).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.three_pprs.passive_friction import WholeMechanismFriction

MJCF, URDF = 'mjcf', 'urdf'
FORMATS = (URDF, MJCF)
DAMPING, FRICTION, ARMATURE, STIFFNESS = 'damping', 'frictionloss', 'armature', 'stiffness'
SPRINGREF = 'springref'
ACTIVE = 'effects.active'
# What joints of a format have.
HELD = {URDF: {DAMPING, FRICTION}, MJCF: {DAMPING, FRICTION, ARMATURE, STIFFNESS, SPRINGREF}}
STANDARD_GRAVITY = (0.0, 0.0, -9.81)  # what is assumed of a format that does not say
AT_ONCE = 1e-9  # [m/s, rad/s], a width of turning over above rounding and below any motion
HINGES = ('hinge_1', 'hinge_2', 'hinge_3')  # C_i of the 3-PPRS
# Of effects on drives: their parameters as a joint's.
OF_DRIVES: Mapping[type[Effect], Mapping[str, str]] = {
    ViscousFriction: {'coefficient': DAMPING},
    CoulombFriction: {'force': FRICTION},
    DriveInertia: {'mass': ARMATURE},
    DriveSpring: {'stiffness': STIFFNESS, 'position': SPRINGREF},
}
OF_PASSIVE = {'viscous': DAMPING, 'torque': FRICTION, 'stiffness': STIFFNESS,
              'position': SPRINGREF}


@dataclass(frozen=True)
class Expressed:
    """A model as far as a format can hold it.

    Parameters
    ----------
    model : DriveModel
        With no more than the format holds; dry friction turns over at once.
    joints : dict of str to dict of str to float
        Of each joint `damping`, `frictionloss`, `armature`, `stiffness` and `springref`, where
        it has them.
    not_expressed : tuple of str
        Keys of the model file and names of effects; of robots with loops in URDF, their loops.
    """

    model: DriveModel
    joints: dict[str, dict[str, float]]
    not_expressed: tuple[str, ...]


class _Sorting:
    """Sorts what a model has into what a format holds and what it does not."""

    def __init__(self, model: DriveModel, kind: str) -> None:
        self.model, self.kind, self.held = model, kind, HELD[kind]
        self.loops = [loop.name for loop in model.robot.structure.loops] if (
            model.moves_joints) else []
        # Joints of a format that passive joints of the model are; those without do not turn alone.
        self.passive = {
            one.name: (one.name,) if model.moves_joints else HINGES
            for one in model.robot.passive_joints if one.has_position}
        self.joints: dict[str, dict[str, float]] = {}
        self.left: list[str] = []
        self.values = dict(model.values)

    def take(self, joints: Mapping[str, Mapping[str, float]]) -> bool:
        """Add numbers to joints; False, with nothing added, where the format cannot hold them."""
        after = {name: dict(numbers) for name, numbers in self.joints.items()}
        for name, numbers in joints.items():
            own = after.setdefault(name, {})
            for key, value in numbers.items():
                if value and key not in self.held:
                    return False
                own[key] = own.get(key, 0.0) + value
                # No simulator takes a joint that gives power without end.
                if key != SPRINGREF and own[key] < 0:
                    return False
        self.joints = after
        return True

    def keep(self, key: str, joints: Sequence[str], number: str) -> None:
        """Take the numbers of a key of the model file as joints have them, or drop them."""
        spread = np.broadcast_to(np.asarray(self.values[key], dtype=float), len(joints)).tolist()
        if not self.take({name: {number: value}
                          for name, value in zip(joints, spread, strict=True)}):
            self.drop(key)

    def drop(self, key: str) -> None:
        """Set the numbers of a key to 0, and note it where they were not."""
        if np.any(self.values[key]):
            self.exchange(key, np.multiply(self.values[key], 0.0).tolist())

    def exchange(self, key: str, value: Any) -> None:
        """Give a key another value, and note it where that changes anything."""
        if self.values[key] != value:
            self.values[key] = value
            self.left.append(key)

    def add(self, effect: Effect) -> None:
        """Sort an added effect."""
        if not self._holds(effect):
            self.left.append(effect.name)
            self.values = {key: value for key, value in self.values.items()
                           if not key.startswith(f'effects.{effect.name}.')}
            self.values[ACTIVE] = [name for name in self.values[ACTIVE] if name != effect.name]

    def _holds(self, effect: Effect) -> bool:
        if type(effect) in OF_DRIVES:
            assert isinstance(effect, DriveEffect)
            names = OF_DRIVES[type(effect)]
            return self.take({drive: {names[key]: value for key, value in values.items()}
                              for drive, values in effect.drives.items()})
        if isinstance(effect, (JointFrictionEffect, JointSpring)):
            return self._holds_in_joints(effect.values)
        # A change of bodies and no force beside them; in URDF, which has none, not of gravity.
        return isinstance(effect, BodyEffect) and (
            type(effect).load is BodyEffect.load and type(effect).apply is BodyEffect.apply) and (
                self.kind == MJCF or not self._turns_gravity(effect))

    def _turns_gravity(self, effect: BodyEffect) -> bool:
        robot = self.model.robot
        return bool(np.any(np.subtract(effect.changed(robot).gravity, robot.gravity)))

    def _holds_in_joints(self, values: Mapping[str, float]) -> bool:
        """Sort what is in passive joints, by `<joint>.<parameter>`: all of it or none."""
        joints: dict[str, dict[str, float]] = {}
        for key, value in values.items():
            joint, _, parameter = key.rpartition('.')
            if value and (joint not in self.passive or parameter not in OF_PASSIVE):
                return False
            for one in self.passive.get(joint, ()) if value else ():
                joints.setdefault(one, {})[OF_PASSIVE[parameter]] = value
        return self.take(joints)


def express(model: DriveModel, kind: str) -> Expressed:
    """Return what a format can hold of a model.

    Parameters
    ----------
    model : DriveModel
    kind : {'urdf', 'mjcf'}
    """
    sorting = _Sorting(model, kind)
    (_sort_arm if model.moves_joints else _sort_platform)(model, sorting)
    for effect in model.effects:
        if effect.name in model.values.get(ACTIVE, ()):
            sorting.add(effect)
    if kind == URDF:
        _under_standard_gravity(model, sorting)
        sorting.left += sorting.loops if model.moves_joints else ['ball_2', 'ball_3']
    reduced = replace(DriveModel.from_parameters(sorting.values, model.source),
                           reversal=Reversal(AT_ONCE, AT_ONCE, AT_ONCE))
    return Expressed(reduced, {name: {key: value for key, value in numbers.items() if value}
                               for name, numbers in sorting.joints.items()},
                     tuple(sorting.left))


def _sort_platform(model: DriveModel, sorting: _Sorting) -> None:
    """Sort the paper's friction, whose loads no format has, and take the exact equations."""
    sorting.keep('friction.drives.viscous', model.drives, DAMPING)
    sorting.keep('friction.revolute.viscous', HINGES, DAMPING)
    sorting.drop('friction.drives.coulomb')
    for joint in ('revolute', 'spherical'):
        if model.values[f'friction.{joint}.diameter']:
            sorting.drop(f'friction.{joint}.coulomb')
    sorting.drop('friction.spherical.viscous')
    sorting.exchange('friction.approach', WholeMechanismFriction.approach)
    sorting.exchange('equations', 'corrected')


def _sort_arm(model: DriveModel, sorting: _Sorting) -> None:
    """Sort rotors and friction, also of passive joints; of these no loads."""
    sorting.keep('friction.viscous', model.drives, DAMPING)
    sorting.keep('friction.coulomb', model.drives, FRICTION)
    sorting.drop('friction.offset')
    sorting.keep('robot.armature', model.drives, ARMATURE)
    for key in model.values:
        name, _, parameter = key.removeprefix('friction.joints.').rpartition('.')
        if not key.startswith('friction.joints.') or parameter == 'radius':
            continue
        if name in sorting.loops or parameter not in OF_PASSIVE:
            sorting.drop(key)
        else:
            sorting.keep(key, (name,), OF_PASSIVE[parameter])


def _under_standard_gravity(model: DriveModel, sorting: _Sorting) -> None:
    """Take the gravity that is assumed where a file has none."""
    sorting.exchange('robot.gravity' if model.moves_joints else 'gravity', STANDARD_GRAVITY)
