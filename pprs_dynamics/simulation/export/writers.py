# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robots as text: MJCF, which MuJoCo reads, and URDF, which everything else does."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.mechanism.description import Frame, Loop
from pprs_dynamics.physics.mechanism.structure import Structure
from pprs_dynamics.simulation.export.exported_robot import (
    ARMATURE,
    DAMPING,
    FREE,
    FRICTION,
    HINGE,
    MJCF,
    SLIDE,
    SPRINGREF,
    STIFFNESS,
    Body,
    ExportedRobot,
)

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
    for k in range(len(structure.loops)):
        points[int(t.loop_a[k])].append(t.a_p[k])
        points[int(t.loop_b[k])].append(t.b_p[k])
    width = THICKNESS * structure.size
    return {row: [point for point in those if np.linalg.norm(point) > width]
            for row, those in points.items()}


def _quaternion(R: Array) -> Array:
    """Return w x y z."""
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(R).as_quat(), 1)


def _rpy(R: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw about fixed axes."""
    return (math.atan2(R[2, 1], R[2, 2]), math.atan2(-R[2, 0], math.hypot(R[2, 1], R[2, 2])),
            math.atan2(R[1, 0], R[0, 0]))


def _mjcf(robot: ExportedRobot) -> Element:
    structure = robot.mechanism.structure
    root = Element('mujoco', model=robot.name)
    _add(root, 'compiler', angle='radian', autolimits='true')
    _add(root, 'option', gravity=robot.mechanism.gravity, jacobian='dense',
         integrator='implicitfast')
    world = _add(root, 'worldbody')
    _add(world, 'light', pos='0 0 3', dir='0 0 -1')
    elements = {0: world}
    drawn, width = _drawn(robot), THICKNESS * structure.size
    drives = dict(zip(structure.drives, structure.effort, strict=True))
    for body in robot.bodies:
        own = elements[body.row] = _add(elements[body.parent], 'body', name=body.name,
                                        pos=body.frame.p, quat=_quaternion(body.frame.R))
        _add(own, 'inertial', pos=body.centre, quat=_quaternion(body.axes), mass=body.mass,
             diaginertia=body.moments)
        if body.kind == FREE:
            _add(own, 'freejoint', name=body.joint)
        else:
            joint = structure.description.joints[body.joint]
            numbers = robot.joints.get(body.joint, {})
            limited = math.isfinite(joint.lower) and math.isfinite(joint.upper)
            _add(own, 'joint', name=body.joint, type=body.kind, axis=body.axis,
                 range=(joint.lower, joint.upper) if limited else None,
                 **{key: numbers.get(key) for key in (DAMPING, FRICTION, ARMATURE, STIFFNESS,
                                                      SPRINGREF)})
        for point in drawn[body.row]:
            _add(own, 'geom', type='capsule', fromto=(0, 0, 0, *point), size=width / 2,
                 contype='0', conaffinity='0', group='1')
        if not drawn[body.row]:
            _add(own, 'geom', type='sphere', size=width, contype='0', conaffinity='0', group='1')
    for name, row, frame in robot.frames:
        _add(elements[row], 'site', name=name, pos=frame.p, quat=_quaternion(frame.R))
    _close(robot, elements, _add(root, 'equality'))
    actuators = _add(root, 'actuator')
    for name, effort in drives.items():
        _add(actuators, 'motor', name=name, joint=name,
             ctrlrange=(-effort, effort) if math.isfinite(effort) else None)
    _add(_add(root, 'keyframe'), 'key', name='home', qpos=_home(robot.bodies))
    return root


def _home(bodies: tuple[Body, ...]) -> list[float]:
    """Return positions of all joints, in the order in which the bodies stand in the file."""
    below: dict[int, list[Body]] = {}
    for body in bodies:
        below.setdefault(body.parent, []).append(body)
    positions: list[float] = []

    def visit(row: int) -> None:
        for body in below.get(row, []):
            positions.extend((*body.frame.p, *_quaternion(body.frame.R)) if body.kind == FREE
                             else (body.home,))
            visit(body.row)

    visit(0)
    return positions


def _close(robot: ExportedRobot, elements: Mapping[int, Element], equality: Element) -> None:
    """Add sites and constraints for loops and couplings."""
    structure = robot.mechanism.structure
    for name, sites, weld in closures(structure):
        for site, row, frame in sites:
            _add(elements[row], 'site', name=site, pos=frame.p, quat=_quaternion(frame.R))
        _add(equality, 'weld' if weld else 'connect', name=name, site1=sites[0][0],
             site2=sites[1][0])
    for name, leader, ratio, offset in structure.couplings:
        _add(equality, 'joint', name=f'{name}_mimic', joint1=name, joint2=leader,
             polycoef=(offset, ratio, 0, 0, 0))


def closures(structure: Structure) -> list[tuple[str, list[tuple[str, int, Frame]], bool]]:
    """Return MuJoCo's constraints for the loops: name, two sites by row and frame, is a weld.

    A hinge is two points on its axis that stay together.

    Raises
    ------
    ModelError
        For a loop that is neither spherical nor revolute nor fixed.
    """
    found = []
    t = structure.tables
    for k, loop in enumerate(structure.loops):
        sides = (('a', int(t.loop_a[k]), Frame(t.a_R[k], t.a_p[k])),
                 ('b', int(t.loop_b[k]), Frame(t.b_R[k], t.b_p[k])))
        for name, along in _points(loop, structure.size):
            at = Frame(p=np.array([0.0, 0.0, along]))
            found.append((name, [(f'{name}_{side}', row, frame @ at)
                                 for side, row, frame in sides], loop.kind == 'fixed'))
    return found


def _points(loop: Loop, size: float) -> list[tuple[str, float]]:
    if loop.kind in ('spherical', 'fixed'):
        return [(loop.name, 0.0)]
    if loop.kind == 'revolute':
        return [(loop.name, 0.0), (f'{loop.name}_axis', size / 10)]
    raise ModelError(f'robot.loops.{loop.name}.type', loop.kind,
                     'be spherical, revolute or fixed: MuJoCo closes no other loops')


def _urdf(robot: ExportedRobot) -> Element:
    structure = robot.mechanism.structure
    root = Element('robot', name=robot.name)
    base = structure.moved_by[0]
    names = {0: base, **{body.row: body.name for body in robot.bodies}}
    drawn, width = _drawn(robot), THICKNESS * structure.size
    _add(root, 'link', name=base)
    mimics = {name: coupling for name, *coupling in structure.couplings}
    for body in robot.bodies:
        link = _add(root, 'link', name=body.name)
        inertial = _add(link, 'inertial')
        tensor = body.tensor
        _add(inertial, 'origin', xyz=body.centre, rpy='0 0 0')
        _add(inertial, 'mass', value=body.mass)
        _add(inertial, 'inertia', ixx=tensor[0, 0], ixy=tensor[0, 1], ixz=tensor[0, 2],
             iyy=tensor[1, 1], iyz=tensor[1, 2], izz=tensor[2, 2])
        for point in drawn[body.row]:
            _draw_rod(link, point, width)
        if not drawn[body.row]:
            _add(_add(_add(link, 'visual'), 'geometry'), 'sphere', radius=width)
        _urdf_joint(root, robot, body, names[body.parent], mimics.get(body.joint))
    for name, row, frame in robot.frames:
        _add(root, 'link', name=name)
        joint = _add(root, 'joint', name=f'{name}_fixed', type='fixed')
        _add(joint, 'parent', link=names[row])
        _add(joint, 'child', link=name)
        _add(joint, 'origin', xyz=frame.p, rpy=_rpy(frame.R))
    return root


def _urdf_joint(root: Element, robot: ExportedRobot, body: Body, parent: str,
                mimic: list[Any] | None) -> None:
    joint = _add(root, 'joint', name=body.joint, type=URDF_KINDS[body.kind])
    _add(joint, 'parent', link=parent)
    _add(joint, 'child', link=body.name)
    _add(joint, 'origin', xyz=body.frame.p, rpy=_rpy(body.frame.R))
    if body.kind == FREE:
        return
    _add(joint, 'axis', xyz=body.axis)
    said = robot.mechanism.structure.description.joints[body.joint]
    limited = math.isfinite(said.lower) and math.isfinite(said.upper)
    if not limited and body.kind == HINGE and mimic is None:
        joint.set('type', 'continuous')
    speed, effort = (value if math.isfinite(value) else UNLIMITED
                     for value in (said.speed, said.effort))
    _add(joint, 'limit', lower=said.lower if limited else -UNLIMITED,
         upper=said.upper if limited else UNLIMITED, velocity=speed, effort=effort)
    numbers = robot.joints.get(body.joint, {})
    if numbers:
        _add(joint, 'dynamics', damping=numbers.get(DAMPING, 0.0),
             friction=numbers.get(FRICTION, 0.0))
    if mimic is not None:
        leader, ratio, offset = mimic
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
