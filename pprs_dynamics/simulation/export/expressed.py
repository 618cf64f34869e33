# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What of a model a simulator's format can hold: a model with no more than that, and the rest.

A joint of URDF has viscous and dry friction; one of MJCF a rotor's inertia and a spring, too. Dry
friction turns over at once there: with `sgn` for tanh(v / width).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.laws.active_friction import ActiveFriction
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.physics.effects.laws.coulomb_friction import CoulombFriction
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.laws.drive_spring import DriveSpring
from pprs_dynamics.physics.effects.laws.joint_friction import JointFrictionEffect, LinkageFriction
from pprs_dynamics.physics.effects.laws.passive_friction import (
    JointCoefficients,
    PassiveFriction,
    WholeMechanismFriction,
)
from pprs_dynamics.physics.effects.laws.revolute_friction import RevoluteFriction
from pprs_dynamics.physics.effects.laws.revolute_stiffness import RevoluteStiffness
from pprs_dynamics.physics.effects.laws.viscous_friction import ViscousFriction
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.model.arm_model import ArmModel
from pprs_dynamics.physics.model.axis_model import AxisModel
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.model_file import Model

MJCF, URDF = 'mjcf', 'urdf'
FORMATS = (URDF, MJCF)
DAMPING, FRICTION, ARMATURE, STIFFNESS = 'damping', 'frictionloss', 'armature', 'stiffness'
SPRINGREF = 'springref'
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
OF_PASSIVE = {'viscous': DAMPING, 'torque': FRICTION}
OF_HINGES: Mapping[type[Effect], Mapping[str, str]] = {
    RevoluteFriction: {'viscous': DAMPING, 'torque': FRICTION},
    RevoluteStiffness: {'stiffness': STIFFNESS, 'angle': SPRINGREF},
}


@dataclass(frozen=True)
class Expressed:
    """A model as far as a format can hold it.

    Parameters
    ----------
    model : Model
        With no more than the format holds; dry friction turns over at once.
    joints : dict of str to dict of str to float
        Of each joint `damping`, `frictionloss`, `armature`, `stiffness` and `springref`, where
        it has them.
    not_expressed : tuple of str
        Keys of the model file and names of effects; of robots with loops in URDF, their loops.
    """

    model: Model
    joints: dict[str, dict[str, float]]
    not_expressed: tuple[str, ...]


class _Sorting:
    """Sorts what a model has into what a format holds and what it does not."""

    def __init__(self, kind: str, loops: frozenset[str]) -> None:
        self.held, self.loops = HELD[kind], loops
        self.joints: dict[str, dict[str, float]] = {}
        self.left: list[str] = []
        self.effects: list[Effect] = []

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

    def keep(self, key: str, joints: Mapping[str, Mapping[str, float]]) -> bool:
        """Take numbers of the model file, or note their key."""
        taken = self.take(joints)
        if not taken:
            self.left.append(key)
        return taken

    def drop(self, key: str, value: Any) -> None:
        """Note a key whose number is not zero."""
        if np.any(value):
            self.left.append(key)

    def add(self, effect: Effect) -> None:
        """Sort an added effect."""
        if self._holds(effect):
            self.effects.append(effect)
        else:
            self.left.append(effect.name)

    def _holds(self, effect: Effect) -> bool:
        if type(effect) in OF_DRIVES:
            assert isinstance(effect, DriveEffect)
            names = OF_DRIVES[type(effect)]
            return self.take({drive: {names[key]: value for key, value in values.items()}
                              for drive, values in effect.drives.items()})
        if type(effect) in OF_HINGES:
            values = effect.values  # type: ignore[attr-defined]
            names = OF_HINGES[type(effect)]
            return self.take({hinge: {names[key]: value for key, value in values.items()}
                              for hinge in HINGES})
        if isinstance(effect, JointFrictionEffect):
            return self._holds_friction(effect.values)
        # A change of bodies and no force beside them.
        return isinstance(effect, BodyEffect) and (
            type(effect).load is BodyEffect.load and type(effect).apply is BodyEffect.apply)

    def _holds_friction(self, values: Mapping[str, float]) -> bool:
        """Sort friction of passive joints, by `<joint>.<parameter>`: all of it or none."""
        joints: dict[str, dict[str, float]] = {}
        for key, value in values.items():
            joint, _, parameter = key.rpartition('.')
            if value and (joint in self.loops or parameter not in OF_PASSIVE):
                return False
            if value:
                joints.setdefault(joint, {})[OF_PASSIVE[parameter]] = value
        return self.take(joints)


def express(model: ForceModel, kind: str) -> Expressed:
    """Return what a format can hold of a model.

    Parameters
    ----------
    model : ForceModel
    kind : {'urdf', 'mjcf'}
    """
    sorting = _Sorting(kind, frozenset(
        loop.name for loop in model.robot.structure.loops) if isinstance(
            model, ArmModel) else frozenset())
    own: tuple[Effect, ...]
    changed: Model
    if isinstance(model, DriveModel):
        own, changed = _of_platform(model, sorting)
    elif isinstance(model, ArmModel):
        own, changed = _of_arm(model, sorting)
    else:
        assert isinstance(model, AxisModel)
        own, changed = _of_axis(model, sorting)
    first = len(own)
    for effect in model.effects:
        if isinstance(effect, (ActiveFriction, PassiveFriction, AxisFriction, AxisOffset,
                               LinkageFriction)):
            continue
        sorting.add(effect)
    reduced: Model = replace(changed, effects=(*own, *sorting.effects),
                             reversal=Reversal(AT_ONCE, AT_ONCE))
    if kind == URDF:
        reduced = _under_standard_gravity(reduced, sorting, first)
        sorting.left += _loops(model)
    return Expressed(reduced, {name: {key: value for key, value in numbers.items() if value}
                               for name, numbers in sorting.joints.items()},
                     tuple(sorting.left))


def _by_joint(drives: tuple[str, ...], key: str, values: object) -> dict[str, dict[str, float]]:
    spread = np.broadcast_to(np.asarray(values, dtype=float), len(drives)).tolist()
    return {name: {key: value} for name, value in zip(drives, spread, strict=True)}


def _of_platform(model: DriveModel, sorting: _Sorting) -> tuple[tuple[Effect, ...], DriveModel]:
    """Return the paper's friction without its loads, and the model by its exact equations."""
    values = model.values
    zero = (0.0,) * 6
    damped = sorting.keep('friction.drives.viscous', _by_joint(
        model.drives, DAMPING, values['friction.drives.viscous']))
    hinged = sorting.keep('friction.revolute.viscous', _by_joint(
        HINGES, DAMPING, values['friction.revolute.viscous']))
    sorting.drop('friction.drives.coulomb', values['friction.drives.coulomb'])
    for joint in ('revolute', 'spherical'):
        sorting.drop(f'friction.{joint}.coulomb', values[f'friction.{joint}.coulomb']
                     * values[f'friction.{joint}.diameter'])
    sorting.drop('friction.spherical.viscous', values['friction.spherical.viscous'])
    if values['friction.approach'] != WholeMechanismFriction.approach:
        sorting.left.append('friction.approach')
    if model.equations != 'corrected':
        sorting.left.append('equations')
    hinges = values['friction.revolute.viscous'] if hinged else 0.0
    return ((ActiveFriction(values['friction.drives.viscous'] if damped else zero, zero),
             WholeMechanismFriction(JointCoefficients(hinges, 0.0, 0.0),
                                    JointCoefficients(0.0, 0.0, 0.0), False)),
            replace(model, equations='corrected'))


def _of_axis(model: AxisModel, sorting: _Sorting) -> tuple[tuple[Effect, ...], AxisModel]:
    sorting.drop('axis.offset', model.values['axis.offset'])
    return (_drive_friction(model, sorting, 'axis'),), model


def _of_arm(model: ArmModel, sorting: _Sorting) -> tuple[tuple[Effect, ...], ArmModel]:
    """Return the friction of the drives and of passive joints that no load changes."""
    own: list[Effect] = [_drive_friction(model, sorting, 'friction')]
    sorting.drop('friction.offset', model.values['friction.offset'])
    robot = model.robot
    if not sorting.keep(f'{model.block}.armature', _by_joint(
            model.drives, ARMATURE, robot.armature)):
        robot = replace(robot, armature=np.zeros_like(robot.armature))
    for effect in model.effects:
        if isinstance(effect, LinkageFriction):
            own.append(_passive(effect, sorting))
    return tuple(own), replace(model, robot=robot)


def _drive_friction(model: ForceModel, sorting: _Sorting, block: str) -> AxisFriction:
    kept: dict[str, object] = {}
    for key, number in (('viscous', DAMPING), ('coulomb', FRICTION)):
        value = model.values[f'{block}.{key}']
        taken = sorting.keep(f'{block}.{key}', _by_joint(model.drives, number, value))
        kept[key] = value if taken else 0.0
    return AxisFriction(**kept)  # type: ignore[arg-type]


def _passive(effect: LinkageFriction, sorting: _Sorting) -> LinkageFriction:
    kept: dict[str, dict[str, float]] = {}
    for name, numbers in effect.blocks.items():
        kept[name] = {}
        for key, value in numbers.items():
            number = OF_PASSIVE.get(key)
            if key == 'radius' or not value:
                continue
            if name not in sorting.loops and number and sorting.take({name: {number: value}}):
                kept[name][key] = value
            else:
                sorting.left.append(f'friction.joints.{name}.{key}')
    return LinkageFriction(effect.structure, kept)


def _under_standard_gravity(model: Model, sorting: _Sorting, first: int) -> Model:
    """Return the model in the gravity that is assumed where a file has none."""
    effects = model.effects
    for effect in effects[first:]:
        if isinstance(effect, BodyEffect) and isinstance(model, (DriveModel, ArmModel)):
            turned: Array = np.subtract(effect.changed(model.robot).gravity, model.robot.gravity)
            if np.any(turned):
                sorting.left.append(effect.name)
                effects = tuple(each for each in effects if each is not effect)
    model = replace(model, effects=effects)
    if isinstance(model, AxisModel):
        # The axis is put at a slope that gives its share of it.
        most = -STANDARD_GRAVITY[2]
        if abs(model.gravity) > most:
            sorting.left.append('axis.gravity')
        return replace(model, gravity=min(max(model.gravity, -most), most))
    if tuple(model.robot.gravity) != STANDARD_GRAVITY:
        sorting.left.append('gravity' if isinstance(model, DriveModel)
                            else f'{model.block}.gravity')
    robot: Any = replace(model.robot, gravity=STANDARD_GRAVITY)
    return replace(model, robot=robot)


def _loops(model: ForceModel) -> list[str]:
    """Return the loops that a tree lacks."""
    if isinstance(model, DriveModel):
        return ['ball_2', 'ball_3']
    return [loop.name for loop in model.robot.structure.loops] if isinstance(
        model, ArmModel) else []
