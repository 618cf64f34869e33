# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Any model as a mechanism: a tree of bodies with closures, for files of simulators."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.laws.coulomb_friction import CoulombFriction
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.laws.drive_spring import DriveSpring
from pprs_dynamics.physics.effects.laws.joint_friction import JointFrictionEffect
from pprs_dynamics.physics.effects.laws.joint_spring import JointSpring
from pprs_dynamics.physics.effects.laws.viscous_friction import ViscousFriction
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.description import FLOATING, Frame, principal_inertia
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.tree_evaluation import constraint_jacobian
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


FREE, HINGE, SLIDE = 'free', 'hinge', 'slide'
# Simulators want some mass of everything that moves [kg, kg m^2]; ten decimals below real ones.
LEAST = 1e-12
SOUND = 1e-9  # of the largest moment of inertia, by which others may break the triangle's rule


@dataclass(frozen=True)
class Body:
    """A body and the joint that it hangs on.

    Parameters
    ----------
    row : int
        Of the mechanism's tables.
    name, joint : str
    kind : {'free', 'hinge', 'slide'}
    parent : int
        Row, 0 for the base.
    frame : Frame
        In the parent's, at position 0; of a free one at home.
    axis : (3,) array
        In the body's frame.
    mass : float
        [kg]
    centre : (3,) array
        [m]
    moments : (3,) array
        Principal moments of inertia about the centre [kg m^2].
    axes : (3, 3) array
        Their axes as columns.
    home : float
        Position of the joint.
    """

    row: int
    name: str
    joint: str
    kind: str
    parent: int
    frame: Frame
    axis: Array
    mass: float
    centre: Array
    moments: Array
    axes: Array
    home: float

    @property
    def tensor(self) -> Array:
        """Inertia about the centre in the body's axes, (3, 3) [kg m^2]."""
        return self.axes @ np.diag(self.moments) @ self.axes.T


@dataclass(frozen=True)
class ExportedRobot:
    """A robot as it stands in a file.

    Parameters
    ----------
    name : str
    mechanism : Mechanism
    joints : mapping of str to mapping
        See `Expressed`.
    bodies : tuple of Body
        Parents first.
    """

    name: str
    mechanism: Mechanism
    joints: Mapping[str, Mapping[str, float]]
    bodies: tuple[Body, ...]

    @property
    def frames(self) -> Iterator[tuple[str, int, Frame]]:
        """Links without a joint of their own: name, row and frame there."""
        structure = self.mechanism.structure
        own = {body.name for body in self.bodies} | {structure.moved_by[0]}
        for name, (row, frame) in structure.links.items():
            if name not in own:
                yield name, row, frame


def export_robot(expressed: Expressed) -> ExportedRobot:
    """Return the robot that a file describes.

    Raises
    ------
    ModelError
        For bodies that no real ones are, and closures that no format has.
    """
    model, robot = expressed.model, expressed.robot
    if model.moves_joints:
        return described(model.block, robot, expressed.joints)
    return described('three_pprs', robot.as_mechanism(model.limits.strokes, model.limits.efforts),
                     expressed.joints)


def described(name: str, mechanism: Mechanism, joints: Mapping[str, Mapping[str, float]] = {},
              ) -> ExportedRobot:
    """Return a mechanism as files of simulators describe it; `joints` as of `Expressed`."""
    return ExportedRobot(name, mechanism, joints, tuple(_bodies(mechanism)))


def _bodies(mechanism: Mechanism) -> Iterator[Body]:
    structure, t = mechanism.structure, mechanism.structure.tables
    _, _, home = constraint_jacobian(t, structure.home, np.arange(len(structure.home)))
    found: dict[int, tuple[str, str, int]] = {}
    for joint in structure.description.joints.values():
        row = structure.links[joint.child][0]
        if joint.kind == FLOATING and structure.moved_by[row] == joint.child:
            parent = structure.links[joint.parent][0]
            if parent:
                raise ModelError('robot.urdf', joint.name, 'hang on the base: a free body on a '
                                 'moving one cannot be exported')
            found[row] = (joint.name, FREE, parent)
        elif structure.rows.get(joint.name) is not None:
            row = structure.rows[joint.name]
            found[row] = (joint.name, HINGE if t.turns[row] else SLIDE, int(t.parent[row]))
    for row in sorted(found):
        joint_name, kind, parent = found[row]
        c = int(t.coordinate[row])
        frame = (Frame(home.R[0, row], home.p[0, row]) if kind == FREE
                 else Frame(t.place_R[row], t.place_p[row]))
        name = structure.moved_by[row]
        yield Body(row, name, joint_name, kind, parent, frame, t.axis[row],
                   *_inertia(name, mechanism.by_joint[row]),
                   float(t.ratio[row] * structure.home[c] + t.offset[row]))


def _inertia(name: str, parameters: Array) -> tuple[float, Array, Array, Array]:
    """Return mass, centre, principal moments and their axes."""
    if not parameters.any():
        return LEAST, np.zeros(3), np.full(3, LEAST), np.eye(3)
    mass, centre, moments, axes = principal_inertia(parameters)
    slack = SOUND * max(float(np.abs(parameters[4:]).max()), LEAST)
    if moments[0] < -slack or moments[0] + moments[1] < moments[2] - slack:
        raise ModelError(f'inertia of {name}', tuple(float(value) for value in moments),
                         'be principal moments of a real body, of which none is negative and each '
                         'two sum to at least the third: no simulator takes another')
    moments = np.maximum(moments, LEAST)
    # What rounding left of the triangle's rule, which simulators take to the letter.
    moments[2] = min(moments[2], moments[0] + moments[1])
    return max(mass, LEAST), centre, moments, axes


class TreePose(NamedTuple):
    """Where the parts of an exported robot are.

    Parameters
    ----------
    joints : (J,) array
        Positions [rad, m].
    bodies : (F, 7) array
        Of free bodies, on the base: place [m] and quaternion, x y z w.
    """

    joints: Array
    bodies: Array


class TreePositions:
    """The joints of a model's URDF, and its free bodies, which are no joints of a message.

    Parameters
    ----------
    model : DriveModel

    Attributes
    ----------
    names : tuple of J str
        Joints.
    base : str
        The link to which free bodies are attached.
    bodies : tuple of F str
        Links of the free bodies.

    Raises
    ------
    ModelError
        As `export_robot`.
    """

    def __init__(self, model: DriveModel) -> None:
        robot = export_robot(express(model, URDF))
        self._mechanism = robot.mechanism
        joints = [body for body in robot.bodies if body.kind != FREE]
        free = [body for body in robot.bodies if body.kind == FREE]
        self.names = tuple(body.joint for body in joints)
        self.base = robot.mechanism.structure.moved_by[0]
        self.bodies = tuple(body.name for body in free)
        self._rows = np.array([body.row for body in joints])
        self._free = tuple(body.row for body in free)

    def at(self, position: Array) -> TreePose:
        """Return where all is, for the positions of the drives, (D,).

        Raises
        ------
        WorkspaceError, SingularityError
            See `Mechanism.at`.
        """
        given = np.array(position, dtype=float)[None]
        still = np.zeros_like(given)
        state = self._mechanism.at(given, still, still)
        t, rows, q = self._mechanism.structure.tables, self._rows, state.motion.q[0]
        bodies = np.empty((len(self._free), 7))
        for k, row in enumerate(self._free):
            bodies[k, :3] = state.motion.p[0, row]
            bodies[k, 3:] = Rotation.from_matrix(state.motion.R[0, row]).as_quat()
        return TreePose(t.ratio[rows] * q[t.coordinate[rows]] + t.offset[rows], bodies)
