# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robot descriptions from URDF: links with their inertia, joints with their limits.

Gears are read from `<transmission>`.
"""

from __future__ import annotations

import hashlib
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import TypeVar

import numpy as np

from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.physics.mechanism import description
from pprs_dynamics.system.files import readable, require_file
from pprs_dynamics.system.plain_text import first_of

WORLD = 'world'
LARGEST_FILE = 20_000_000  # bytes; descriptions of robots without meshes have some 100 kB
Item = TypeVar('Item')
KINDS = (description.REVOLUTE, description.CONTINUOUS, description.PRISMATIC, description.FIXED,
         description.FLOATING)
# Macros, and expressions in attributes, as xacro has them.
# Its output keeps the comments, with what was commented out.
COMMENT = re.compile(rb'<!--.*?-->', re.DOTALL)
XACRO = re.compile(rb'<xacro:|=["\'][^"\']*\$[{(]')
REDUCTIONS = ('mechanicalReduction', 'mechanical_reduction')
DYNAMICS = ('damping', 'friction')
ROUNDED = 0.01  # by which moments of inertia may break a rule: files give two digits
TINY = 1e-9  # [kg m^2] of it, whatever the size
# Radius of gyration over the length of all links in a row: beyond it a body would be ten times as
# long as its robot, while a wrong unit, mm^2 for m^2, makes it a thousand times as large.
LARGEST_GYRATION = 3.0
LARGEST_BODY = 1e9  # [kg, kg m^2]
MOST_NAMES = 8  # in a sentence


def read_content(path: str) -> bytes:
    """Return the content of a file of a description, or raise UnreadableFileError."""
    file = Path(path)
    require_file(file)
    with readable(path):
        if file.stat().st_size > LARGEST_FILE:
            raise UnreadableFileError(path, f'more than {LARGEST_FILE / 1e6:.0f} MB: no URDF')
        return file.read_bytes()


def read_urdf(path: str) -> description.Description:
    """Return the description in a URDF file.

    Raises
    ------
    UnreadableFileError
        Where the file is missing, no URDF, or does not make a tree.
    """
    return _described(urdf_content(path), str(path))


def urdf_content(path: str) -> bytes:
    """Return the URDF in a file.

    Raises
    ------
    UnreadableFileError
        Where the file cannot be read, or holds xacro.
    """
    content = read_content(path)
    if b'<robot' in content and XACRO.search(COMMENT.sub(b'', content)):
        raise UnreadableFileError(path, 'holds xacro, which is no URDF yet: run `xacro '
                                  f'{Path(path).name} > robot.urdf` and name that')
    return content


@lru_cache(maxsize=16)
def _described(content: bytes, path: str) -> description.Description:
    try:
        robot = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise UnreadableFileError(path, f'not XML: {error}') from None
    if robot.tag != 'robot':
        raise UnreadableFileError(path, f'not a URDF: its root is <{robot.tag}>, must be <robot>')
    links = _read(path, robot.findall('link'), _inertial)
    joints = _read(path, robot.findall('joint'), _joint)
    if any(joint.parent == WORLD for joint in joints.values()):
        # Drake reads it without a link of its own.
        links.setdefault(WORLD, np.zeros(description.PARAMETERS))
    _require_tree(path, links, joints)
    try:
        transmissions = tuple(map(_transmission, robot.findall('transmission')))
    except ValueError as error:
        raise UnreadableFileError(path, str(error)) from None
    for gear in transmissions:
        for name in gear.joints if gear.reduction else ():
            if name in joints and joints[name].kind in description.TURNING:
                joints[name] = replace(joints[name], reduction=gear.reduction)
    if (loop := robot.find('constraint')) is not None:
        raise UnreadableFileError(path, f'holds <constraint name="{loop.get("name", "")}">, which '
                                  'no URDF has: write it under robot.loops of the model file')
    return description.Description(
        path, links, joints, hashlib.sha256(content).hexdigest(),
        remarks=tuple(_unused(robot, joints, transmissions)), transmissions=transmissions,
        faults=tuple(_impossible_bodies(links, joints)))


def _transmission(element: ElementTree.Element) -> description.Transmission:
    kind = next((text.strip() for text in (element.findtext('type'), element.get('type'),
                                           element.findtext('plugin')) if text), '')
    reductions = [found.text or '' for side in ('joint', 'actuator') for tag in REDUCTIONS
                  for found in element.findall(f'{side}/{tag}')]
    reduction = None
    if reductions and 'simple' in kind.lower():
        try:
            reduction = abs(float(reductions[0]))
        except ValueError:
            reduction = 0.0
        if not 0 < reduction < np.inf:
            raise ValueError(f'the reduction of transmission {element.get("name", "")} is '
                             f'"{reductions[0]}", must be a number other than 0')
    return description.Transmission(element.get('name', ''), kind, tuple(
        joint.get('name', '') for joint in element.findall('joint')), reduction)


def _impossible_bodies(links: dict[str, np.ndarray], joints: dict[str, description.Joint],
                       ) -> Iterator[str]:
    """Yield sentences on bodies whose inertia no body can have."""
    strokes = [joint.upper - joint.lower for joint in joints.values() if joint.kind == 'prismatic']
    reach = (sum(float(np.linalg.norm(joint.frame.p)) for joint in joints.values()) + sum(strokes)
             + max((float(np.linalg.norm(p[1:4])) / p[0] for p in links.values() if p[0] > 0),
                   default=0.0))
    for name, parameters in links.items():
        if not parameters[0] > 0:
            if np.any(parameters):
                yield f'link {name} has inertia without mass: no body has'
            continue
        mass, _, moments, _ = description.principal_inertia(parameters)
        low, middle, high = np.sort(moments)
        listed = ', '.join(f'{value:.3g}' for value in (low, middle, high))
        if low < -ROUNDED * high or high > (1 + ROUNDED) * (low + middle) + TINY:
            yield (f'link {name} is no body: its principal moments of inertia are {listed} '
                   'kg m^2, of which none may be negative, nor greater than the sum of the others')
        gyration = float(np.sqrt(max(high, 0.0) / mass))
        if reach > 0 and gyration > LARGEST_GYRATION * reach:
            yield (f'link {name} has {high:.3g} kg m^2 in {mass:.3g} kg, a radius of gyration of '
                   f'{gyration:.3g} m in a robot that reaches {reach:.3g} m: is it in kg mm^2 '
                   f'({1e-6 * high:.3g} kg m^2), or g mm^2?')


def _unused(robot: ElementTree.Element, joints: dict[str, description.Joint],
            transmissions: tuple[description.Transmission, ...]) -> Iterator[str]:
    """Yield sentences on elements of the file that the model does not use."""
    carried = {joint.child for joint in joints.values()}
    hollow = [link.get('name', '') for link in robot.findall('link')
              if link.get('name') in carried and link.find('inertial') is None
              and link.find('collision') is not None]
    if hollow:
        yield ('links with a shape and no <inertial>, which weigh nothing here: '
               f'{first_of(hollow, MOST_NAMES)}')
    rubbing = [joint.get('name', '') for joint in robot.findall('joint')
               if any(_number(joint.find('dynamics'), key, 0.0) for key in DYNAMICS)]
    if rubbing:
        yield (f'<dynamics> of {first_of(rubbing, MOST_NAMES)} is not used: friction is that of '
               'the model file, or of pprs fit')
    used = {name for name, joint in joints.items() if joint.reduction}
    left = [unused.name or unused.kind for unused in transmissions
            if not unused.joints or not used & set(unused.joints)]
    if left:
        yield (f'<transmission> {first_of(left, MOST_NAMES)} is not used: only a simple one with '
               'a reduction, of a joint that turns, is; write gear_ratio')


def _read(path: str, elements: list[ElementTree.Element],
          reader: Callable[[ElementTree.Element], Item]) -> dict[str, Item]:
    """Return links or joints by name, each made by a reader."""
    found: dict[str, Item] = {}
    for element in elements:
        name = element.get('name')
        if not name:
            raise UnreadableFileError(path, f'a <{element.tag}> has no name')
        if name in found:
            raise UnreadableFileError(path, f'has two {element.tag}s {name}, must name each once')
        try:
            found[name] = reader(element)
        except ValueError as error:
            raise UnreadableFileError(path, f'{element.tag} {name}: {error}') from None
    return found


def _numbers(element: ElementTree.Element | None, key: str, default: str) -> tuple[float, ...]:
    text = default if element is None else element.get(key, default)
    try:
        numbers = tuple(float(word) for word in text.split())
    except ValueError:
        numbers = ()
    count = len(default.split())
    if len(numbers) != count or not np.all(np.isfinite(numbers)):
        asked = 'a finite number' if count == 1 else f'{count} finite numbers'
        tag = '' if element is None else f' of <{element.tag}>'
        raise ValueError(f'{key}{tag} is "{text}", must be {asked}')
    return numbers


def _number(element: ElementTree.Element | None, key: str, default: float) -> float:
    return default if element is None or element.get(key) is None else _numbers(
        element, key, '0')[0]


def _inertial(link: ElementTree.Element) -> np.ndarray:
    inertial = link.find('inertial')
    if inertial is None:
        return np.zeros(description.PARAMETERS)
    origin, inertia = inertial.find('origin'), inertial.find('inertia')
    if inertial.find('mass[@value]') is None:
        raise ValueError('<inertial> is without a <mass value="...">, must have one [kg]')
    mass = _number(inertial.find('mass'), 'value', 0.0)
    xx, xy, xz, yy, yz, zz = (_number(inertia, f'i{axes}', 0.0)
                              for axes in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz'))
    if not 0 <= min(mass, xx, yy, zz) <= max(mass, xx, yy, zz) <= LARGEST_BODY:
        raise ValueError(f'its mass is {mass:g} kg, its moments of inertia {xx:g}, {yy:g}, '
                         f'{zz:g} kg m^2: none may be negative, or above {LARGEST_BODY:g}')
    R = description.rotation_of(_numbers(origin, 'rpy', '0 0 0'))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return description.body_at(mass, _numbers(origin, 'xyz', '0 0 0'), R @ tensor @ R.T)


def _joint(joint: ElementTree.Element) -> description.Joint:
    name, kind = joint.get('name', ''), joint.get('type', '')
    if kind not in KINDS:
        raise ValueError(f'its type is "{kind}", must be one of {", ".join(KINDS)}')
    parent, child, origin = joint.find('parent'), joint.find('child'), joint.find('origin')
    if parent is None or child is None:
        raise ValueError('it is without <parent> or <child>, must have both')
    axis = np.array(_numbers(joint.find('axis'), 'xyz', '1 0 0'))
    length = float(np.linalg.norm(axis))
    if kind not in (description.FIXED, description.FLOATING) and not length > 0:
        raise ValueError('its axis has no length')
    limit, mimic = joint.find('limit'), joint.find('mimic')
    lower, upper = _number(limit, 'lower', 0.0), _number(limit, 'upper', 0.0)
    if lower > upper and kind != description.CONTINUOUS:
        raise ValueError(f'its lower limit is {lower:g}, must be below its upper one, {upper:g}')
    if not lower < upper or kind == description.CONTINUOUS:  # a URDF may omit them
        lower, upper = -np.inf, np.inf
    speed, effort = (_number(limit, key, 0.0) or np.inf for key in ('velocity', 'effort'))
    if min(speed, effort) < 0:
        raise ValueError(f'its limits are {speed:g} of velocity and {effort:g} of effort, must be '
                         'at least 0')
    return description.Joint(
        name, kind, parent.get('link', ''), child.get('link', ''),
        description.Frame.of(_numbers(origin, 'xyz', '0 0 0'), _numbers(origin, 'rpy', '0 0 0')),
        axis / length if length > 0 else axis, lower, upper, speed, effort,
        None if mimic is None else description.Mimic(
            mimic.get('joint', ''), _number(mimic, 'multiplier', 1.0),
            _number(mimic, 'offset', 0.0)))


def _require_tree(path: str, links: dict[str, np.ndarray], joints: dict[str, description.Joint],
                  ) -> None:
    """Raise UnreadableFileError where joints do not make one tree of the links.

    Nor may joints mimic one another in a ring.
    """
    children: dict[str, str] = {}
    for joint in joints.values():
        for link in (joint.parent, joint.child):
            if link not in links:
                raise UnreadableFileError(path, f'{joint.name} is on {link}, which is no link')
        if joint.child in children:
            raise UnreadableFileError(
                path, f'{joint.child} hangs on {children[joint.child]} and on {joint.name}: a '
                'URDF is a tree, close loops by robot.loops')
        children[joint.child] = joint.name
        if joint.mimic is not None and joint.mimic.joint not in joints:
            raise UnreadableFileError(
                path, f'{joint.name} mimics {joint.mimic.joint}, which is no joint')
    roots = [link for link in links if link not in children]
    if len(roots) != 1:
        raise UnreadableFileError(
            path, f'has {len(roots)} links that hang on none '
            f'({", ".join(roots[:6]) or "a ring"}), must have one')
    hanging = {joint.child: joint.parent for joint in joints.values()}
    if found := ring(hanging):
        raise UnreadableFileError(
            path, f'{", ".join(found[:6])} hang on one another: a URDF is a tree, close loops by '
            'robot.loops')
    if found := ring({name: joint.mimic.joint for name, joint in joints.items()
                      if joint.mimic is not None}):
        raise UnreadableFileError(path, f'{", ".join(found[:6])}: a joint must mimic none that '
                                  'mimics it')


def ring(following: dict[str, str]) -> list[str]:
    """Return names of which each follows the next and the last the first, [] for none."""
    try:
        TopologicalSorter({name: (next_one,) for name, next_one in following.items()}).prepare()
    except CycleError as error:
        names: list[str] = error.args[1][:0:-1]
        first = min(range(len(names)), key=lambda k: [*following].index(names[k]))
        return names[first:] + names[:first]
    return []
