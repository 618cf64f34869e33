# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Any model as a mechanism: a tree of bodies with closures, for files of simulators."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.structure_effect import BodyEffect, StructureEffect
from pprs_dynamics.physics.mechanism import description
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.tree_equations import constraint_jacobian
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import APPROACHES, EQUATIONS, JOINTS, ROBOT
from pprs_dynamics.physics.model.robot_block import STANDARD_GRAVITY
from pprs_dynamics.physics.three_pprs.robot import HINGES
from pprs_dynamics.simulation.engine_state import quaternion

MJCF, URDF = 'mjcf', 'urdf'
FORMATS = (URDF, MJCF)
DAMPING, FRICTION, ARMATURE, STIFFNESS = 'damping', 'frictionloss', 'armature', 'stiffness'
SPRINGREF = 'springref'
# What joints of a format have.
HELD = {URDF: {DAMPING, FRICTION}, MJCF: {DAMPING, FRICTION, ARMATURE, STIFFNESS, SPRINGREF}}
# Of effects on drives: their parameters as a joint's.
OF_DRIVES = {
    'viscous_friction': {'coefficient': DAMPING},
    'coulomb_friction': {'force': FRICTION},
    'drive_inertia': {'mass': ARMATURE},
    'drive_spring': {'stiffness': STIFFNESS, 'position': SPRINGREF},
}
IN_JOINTS = 'joint_friction', 'joint_spring'
OF_PASSIVE = {'viscous': DAMPING, 'torque': FRICTION, 'stiffness': STIFFNESS, 'position': SPRINGREF}
OF_KEYS = {'friction.drives.viscous': DAMPING, 'friction.viscous': DAMPING,
           'friction.coulomb': FRICTION, 'robot.armature': ARMATURE}
# By joint and name in a format.
Numbers = dict[tuple[str, str], float]


def export_robot(model: DriveModel, kind: str) -> ExportedRobot:
    """Return the parts of a model that a format can express.

    Parameters
    ----------
    model : DriveModel
    kind : {'urdf', 'mjcf'}

    Raises
    ------
    ModelError
        For bodies that no real ones are, and closures that no format has.
    """
    taken: Numbers = {}
    left = [key for key, numbers in _of_model(model) if not _take(taken, numbers, HELD[kind])]
    # Joints of a format that passive joints of the model are; those without do not turn alone.
    passive = {joint.name: joint.joints for joint in model.robot.passive_joints
               if joint.has_position}
    robot = model.robot
    for effect in model.effects:
        if effect.name not in model.values.get('effects.active', ()):
            continue
        if _is_body(effect, kind, robot):
            assert isinstance(effect, BodyEffect)
            robot = effect.changed(robot)
        elif not _take(taken, _of_effect(effect, passive), HELD[kind]):
            left.append(effect.name)
    if kind == URDF:
        if tuple(model.robot.gravity) != STANDARD_GRAVITY:
            left.append(next(key for key in ('gravity', 'robot.gravity') if key in model.values))
        robot = replace(robot, gravity=STANDARD_GRAVITY)
        left += [loop.name for loop in model.robot.structure.loops]
    return ExportedRobot(robot, taken, tuple(left))


def _take(taken: Numbers, numbers: Numbers | None, held: set[str]) -> bool:
    """Add numbers to others; False, with nothing added, where the format cannot hold them."""
    added = {key: value + taken.get(key, 0.0) for key, value in (numbers or {}).items() if value}
    # No simulator takes a joint that gives power without end.
    if numbers is None or any(name not in held or (value < 0 and name != SPRINGREF)
                              for (_, name), value in added.items()):
        return False
    taken.update(added)
    return True


def _of_model(model: DriveModel) -> Iterator[tuple[str, Numbers | None]]:
    """Yield keys of rotors and friction, also of passive joints; None for those of no format.

    No format has loads that friction follows.
    """
    values, loops = model.values, {loop.name for loop in model.robot.structure.loops}
    for key, number in OF_KEYS.items():
        if key in values:
            yield key, {(drive, number): value for drive, value in zip(
                model.drives, values[key], strict=True)}
    if viscous := values.get('friction.revolute.viscous'):
        yield 'friction.revolute.viscous', {(name, DAMPING): viscous for name in HINGES}
    for key in ('friction.offset', 'friction.drives.coulomb', *(
            f'friction.{joint}.coulomb' for joint in ('revolute', 'spherical')
            if values.get(f'friction.{joint}.diameter')), 'friction.spherical.viscous'):
        if np.any(values.get(key, 0.0)):
            yield key, None
    for key, usual in (('friction.approach', APPROACHES[0]), ('equations', EQUATIONS[0])):
        if values.get(key, usual) != usual:
            yield key, None
    for key, value in values.items():
        name, _, parameter = key.removeprefix(JOINTS).rpartition('.')
        if key.startswith(JOINTS) and parameter != 'radius' and value:
            of_passive = None if name in loops else OF_PASSIVE.get(parameter)
            yield key, None if of_passive is None else {(name, of_passive): value}


def _of_effect(effect: Effect, passive: Mapping[str, Sequence[str]]) -> Numbers | None:
    """Return the numbers of an effect in drives or passive joints, None where it has others."""
    if isinstance(effect, DriveEffect) and effect.name in OF_DRIVES:
        names = OF_DRIVES[effect.name]
        return {(drive, names[key]): value for drive, values in effect.drives.items()
                for key, value in values.items()}
    if not isinstance(effect, StructureEffect) or effect.name not in IN_JOINTS:
        return None
    numbers: Numbers = {}
    for key, value in effect.values.items():
        joint, _, parameter = key.rpartition('.')
        if value and (joint not in passive or parameter not in OF_PASSIVE):
            return None
        for name in passive.get(joint, ()) if value else ():
            numbers[name, OF_PASSIVE[parameter]] = value
    return numbers


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
    name : str
    joint : Joint
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
    joint: description.Joint
    kind: str
    parent: int
    frame: description.Frame
    axis: Array
    mass: float
    centre: Array
    moments: Array
    axes: Array
    home: float

    @property
    def limits(self) -> tuple[float, float] | None:
        """Range of the joint, None where it is not limited."""
        found = self.joint.lower, self.joint.upper
        return found if np.all(np.isfinite(found)) else None


@dataclass(frozen=True)
class ExportedRobot:
    """A robot in the format of a file.

    Parameters
    ----------
    mechanism : Mechanism
    numbers : mapping of (str, str) to float
        By joint and name: `damping`, `frictionloss`, `armature`, `stiffness` and `springref`, where
        it has them.
    not_expressed : tuple of str
        Keys of the model file and names of effects; of robots with loops in URDF, their loops.
    """

    mechanism: Mechanism
    numbers: Mapping[tuple[str, str], float] = field(default_factory=dict)
    not_expressed: tuple[str, ...] = ()

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Bodies, each before what hangs on it, as they stand in MJCF."""
        return tuple(_bodies(self.mechanism))

    def of_joint(self, joint: str) -> dict[str, float]:
        """Return the numbers of a joint by name."""
        return {name: value for (of, name), value in self.numbers.items() if of == joint}

    @property
    def frames(self) -> Iterator[tuple[str, int, description.Frame]]:
        """Links without a joint of their own: name, row and frame there."""
        structure = self.mechanism.structure
        own = {body.name for body in self.bodies} | {structure.moved_by[0]}
        for name, (row, frame) in structure.links.items():
            if name not in own:
                yield name, row, frame


def _bodies(mechanism: Mechanism) -> Iterator[Body]:
    structure, t = mechanism.structure, mechanism.structure.tables
    _, _, home = constraint_jacobian(t, structure.home, np.arange(len(structure.home)))
    found: dict[int, tuple[description.Joint, str, int]] = {}
    for joint in structure.description.joints.values():
        row = structure.links[joint.child][0]
        if joint.kind == description.FLOATING and structure.moved_by[row] == joint.child:
            parent = structure.links[joint.parent][0]
            if parent:
                raise ModelError('robot.urdf', joint.name, 'hang on the base: a free body on a '
                                 'moving one cannot be exported')
            found[row] = joint, FREE, parent
        elif structure.rows.get(joint.name) is not None:
            row = structure.rows[joint.name]
            found[row] = joint, HINGE if t.turns[row] else SLIDE, int(t.parent[row])

    def way(row: int) -> tuple[int, ...]:
        """Return the rows from the base to a body."""
        return (*way(found[row][2]), row) if row else ()

    for row in sorted(found, key=way):
        joint, kind, parent = found[row]
        frame = (description.Frame(home.R[0, row], home.p[0, row]) if kind == FREE
                 else description.Frame(t.place_R[row], t.place_p[row]))
        name = structure.moved_by[row]
        yield Body(row, name, joint, kind, parent, frame, t.axis[row],
                   *_inertia(name, mechanism.by_joint[row]),
                   float(t.ratio[row] * structure.home[int(t.coordinate[row])] + t.offset[row]))


def _inertia(name: str, parameters: Array) -> tuple[float, Array, Array, Array]:
    """Return mass, centre, principal moments and their axes."""
    if not parameters.any():
        return LEAST, np.zeros(3), np.full(3, LEAST), np.eye(3)
    mass, centre, moments, axes = description.principal_inertia(parameters)
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
    """Poses of the parts of an exported robot.

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
        robot = export_robot(model, URDF)
        self._mechanism, structure = robot.mechanism, robot.mechanism.structure
        self.names, self.base = tuple(structure.rows), structure.moved_by[0]
        self._free = {body.name: body.row for body in robot.bodies if body.kind == FREE}
        self.bodies = tuple(self._free)

    def at(self, position: Array) -> TreePose:
        """Return where all is, for the positions of the drives, (D,).

        Raises
        ------
        WorkspaceError, SingularityError
            See `Mechanism.at`.
        """
        given = np.array(position, dtype=float)[None]
        still = np.zeros_like(given)
        links = self._mechanism.at(given, still, still)
        bodies = np.empty((len(self._free), 7))
        for k, row in enumerate(self._free.values()):
            bodies[k, :3] = links.motion.p[0, row]
            bodies[k, 3:] = Rotation.from_matrix(links.motion.R[0, row]).as_quat()
        return TreePose(np.array([links.joint_position(name)[0] for name in self.names]), bodies)


# --- files ---------------------------------------------------------------------------------------

THICKNESS = 0.02  # of the mechanism's size, of what is drawn
UNLIMITED = 1e3  # [m, m/s, rad/s, N, N m], where URDF wants a limit and the model has none
URDF_KINDS = {FREE: 'floating', HINGE: 'revolute', SLIDE: 'prismatic'}
Element = ElementTree.Element


def written(robot: ExportedRobot, kind: str) -> str:
    """Return the text of a file.

    Raises
    ------
    ModelError
        For closures that MJCF does not have.
    """
    root = _mjcf(robot) if kind == MJCF else _urdf(robot)
    ElementTree.indent(root)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _words(values: Any) -> str:
    # + 0.0: no minus zeros.
    return ' '.join(repr(float(value)) for value in np.asarray(values, dtype=float).ravel() + 0.0)


def _add(parent: Element, tag: str, **attributes: Any) -> Element:
    """Add an element; numbers become words, and what is None is left out."""
    return ElementTree.SubElement(parent, tag, {
        key: value if isinstance(value, str) else _words(value)
        for key, value in attributes.items() if value is not None})


def _drawn(robot: ExportedRobot) -> Mapping[int, list[Array]]:
    """Return the points to which each body reaches, by row: joints and closures on it."""
    structure = robot.mechanism.structure
    t = structure.tables
    points: dict[int, list[Array]] = {0: [], **{body.row: [] for body in robot.bodies}}
    for body in robot.bodies:
        if body.kind != FREE:
            points[body.parent].append(body.frame.p)
    for row, p in zip((*t.loop_a, *t.loop_b), (*t.a_p, *t.b_p), strict=True):
        points[int(row)].append(p)
    width = THICKNESS * structure.size
    return {row: [point for point in those if np.linalg.norm(point) > width]
            for row, those in points.items()}


def _rpy(R: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw about fixed axes."""
    return (math.atan2(R[2, 1], R[2, 2]), math.atan2(-R[2, 0], math.hypot(R[2, 1], R[2, 2])),
            math.atan2(R[1, 0], R[0, 0]))


def _mjcf(robot: ExportedRobot) -> Element:
    structure = robot.mechanism.structure
    root = Element('mujoco', model=ROBOT)
    _add(root, 'compiler', angle='radian', autolimits='true')
    _add(root, 'option', gravity=robot.mechanism.gravity, jacobian='dense',
         integrator='implicitfast')
    world = _add(root, 'worldbody')
    _add(world, 'light', pos='0 0 3', dir='0 0 -1')
    elements = {0: world}
    drawn, width = _drawn(robot), THICKNESS * structure.size
    for body in robot.bodies:
        own = elements[body.row] = _add(elements[body.parent], 'body', name=body.name,
                                        pos=body.frame.p, quat=quaternion(body.frame.R))
        _add(own, 'inertial', pos=body.centre, quat=quaternion(body.axes), mass=body.mass,
             diaginertia=body.moments)
        if body.kind == FREE:
            _add(own, 'freejoint', name=body.joint.name)
        else:
            _add(own, 'joint', name=body.joint.name, type=body.kind, axis=body.axis,
                 range=body.limits, **robot.of_joint(body.joint.name))
        for point in drawn[body.row]:
            _add(own, 'geom', type='capsule', fromto=(0, 0, 0, *point), size=width / 2,
                 contype='0', conaffinity='0', group='1')
        if not drawn[body.row]:
            _add(own, 'geom', type='sphere', size=width, contype='0', conaffinity='0', group='1')
    for name, row, frame in robot.frames:
        _add(elements[row], 'site', name=name, pos=frame.p, quat=quaternion(frame.R))
    _close(robot, elements, _add(root, 'equality'))
    actuators = _add(root, 'actuator')
    for name, effort in zip(structure.drives, structure.effort, strict=True):
        _add(actuators, 'motor', name=name, joint=name,
             ctrlrange=(-effort, effort) if math.isfinite(effort) else None)
    _add(_add(root, 'keyframe'), 'key', name='home', qpos=np.concatenate([
        (*body.frame.p, *quaternion(body.frame.R)) if body.kind == FREE else (body.home,)
        for body in robot.bodies]))
    return root


def _close(robot: ExportedRobot, elements: Mapping[int, Element], equality: Element) -> None:
    """Add sites and constraints for loops and couplings.

    A hinge is two points on its axis that stay together.

    Raises
    ------
    ModelError
        For a loop that is neither spherical nor revolute nor fixed.
    """
    structure, t = robot.mechanism.structure, robot.mechanism.structure.tables
    for k, loop in enumerate(structure.loops):
        if loop.kind not in ('spherical', 'revolute', 'fixed'):
            raise ModelError(f'robot.loops.{loop.name}.type', loop.kind,
                             'be spherical, revolute or fixed: MuJoCo closes no other loops')
        points = {loop.name: 0.0}
        if loop.kind == 'revolute':
            points[f'{loop.name}_axis'] = structure.size / 10
        for name, along in points.items():
            for side, rows, R, p in (('a', t.loop_a, t.a_R, t.a_p), ('b', t.loop_b, t.b_R, t.b_p)):
                _add(elements[int(rows[k])], 'site', name=f'{name}_{side}',
                     pos=p[k] + along * R[k][:, 2], quat=quaternion(R[k]))
            _add(equality, 'weld' if loop.kind == 'fixed' else 'connect', name=name,
                 site1=f'{name}_a', site2=f'{name}_b')
    for name, leader, ratio, offset in structure.couplings:
        _add(equality, 'joint', name=f'{name}_mimic', joint1=name, joint2=leader,
             polycoef=(offset, ratio, 0, 0, 0))


def _urdf(robot: ExportedRobot) -> Element:
    structure = robot.mechanism.structure
    root = Element('robot', name=ROBOT)
    base = structure.moved_by[0]
    names = {0: base, **{body.row: body.name for body in robot.bodies}}
    drawn, width = _drawn(robot), THICKNESS * structure.size
    _add(root, 'link', name=base)
    for body in robot.bodies:
        link = _add(root, 'link', name=body.name)
        inertial = _add(link, 'inertial')
        tensor = body.axes @ np.diag(body.moments) @ body.axes.T
        _add(inertial, 'origin', xyz=body.centre, rpy='0 0 0')
        _add(inertial, 'mass', value=body.mass)
        _add(inertial, 'inertia', ixx=tensor[0, 0], ixy=tensor[0, 1], ixz=tensor[0, 2],
             iyy=tensor[1, 1], iyz=tensor[1, 2], izz=tensor[2, 2])
        for point in drawn[body.row]:
            _draw_rod(link, point, width)
        if not drawn[body.row]:
            _add(_add(_add(link, 'visual'), 'geometry'), 'sphere', radius=width)
        _urdf_joint(root, robot, body, names[body.parent])
    for name, row, frame in robot.frames:
        _add(root, 'link', name=name)
        joint = _add(root, 'joint', name=f'{name}_fixed', type='fixed')
        _add(joint, 'parent', link=names[row])
        _add(joint, 'child', link=name)
        _add(joint, 'origin', xyz=frame.p, rpy=_rpy(frame.R))
    return root


def _urdf_joint(root: Element, robot: ExportedRobot, body: Body, parent: str) -> None:
    said, mimic = body.joint, [
        coupling for name, *coupling in robot.mechanism.structure.couplings
        if name == body.joint.name]
    is_endless = body.kind == HINGE and body.limits is None and not mimic
    joint = _add(root, 'joint', name=said.name,
                 type='continuous' if is_endless else URDF_KINDS[body.kind])
    _add(joint, 'parent', link=parent)
    _add(joint, 'child', link=body.name)
    _add(joint, 'origin', xyz=body.frame.p, rpy=_rpy(body.frame.R))
    if body.kind == FREE:
        return
    _add(joint, 'axis', xyz=body.axis)
    lower, upper = body.limits or (-UNLIMITED, UNLIMITED)
    speed, effort = (value if math.isfinite(value) else UNLIMITED
                     for value in (said.speed, said.effort))
    _add(joint, 'limit', lower=lower, upper=upper, velocity=speed, effort=effort)
    if numbers := robot.of_joint(said.name):
        _add(joint, 'dynamics', damping=numbers.get(DAMPING, 0.0),
             friction=numbers.get(FRICTION, 0.0))
    for leader, ratio, offset in mimic:
        _add(joint, 'mimic', joint=leader, multiplier=ratio, offset=offset)


def _draw_rod(link: Element, point: Array, width: float) -> None:
    """Draw a rod from the link's origin to a point."""
    length = float(np.linalg.norm(point))
    x, y, z = point / length
    visual = _add(link, 'visual')
    # URDF's cylinders lie along z.
    _add(visual, 'origin', xyz=point / 2, rpy=(0.0, math.acos(max(-1.0, min(1.0, z))),
                                               math.atan2(y, x)))
    _add(_add(visual, 'geometry'), 'cylinder', radius=width / 2, length=length)
