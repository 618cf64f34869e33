# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robot descriptions from URDF: links with their inertia, joints with their limits."""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.physics.mechanism.description import (
    CONTINUOUS,
    FIXED,
    FLOATING,
    PARAMETERS,
    PRISMATIC,
    REVOLUTE,
    Description,
    Frame,
    Joint,
    Mimic,
    body_at,
    rotation_of,
)
from pprs_dynamics.system.input_files import require_file

LARGEST_FILE = 20_000_000  # bytes; descriptions of robots without meshes have some 100 kB
Item = TypeVar('Item')
KINDS = (REVOLUTE, CONTINUOUS, PRISMATIC, FIXED, FLOATING)


def read_content(path: str) -> bytes:
    """Return the content of a file of a description, or raise UnreadableFileError."""
    file = Path(path)
    require_file(file)
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise UnreadableFileError(path, f'more than {LARGEST_FILE / 1e6:.0f} MB: no URDF')
        return file.read_bytes()
    except OSError as error:
        if isinstance(error, UnreadableFileError):
            raise
        raise UnreadableFileError(path, error.strerror or str(error)) from None


def read_urdf(path: str) -> Description:
    """Return what a URDF says.

    Raises
    ------
    UnreadableFileError
        Where the file is missing, no URDF, or does not make a tree.
    """
    return _described(read_content(path), str(path))


@lru_cache(maxsize=16)
def _described(content: bytes, path: str) -> Description:
    try:
        robot = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise UnreadableFileError(path, f'not XML: {error}') from None
    if robot.tag != 'robot':
        raise UnreadableFileError(path, f'not a URDF: its root is <{robot.tag}>, must be <robot>')
    links = _read(path, robot.findall('link'), _inertial)
    joints = _read(path, robot.findall('joint'), _joint)
    _require_tree(path, links, joints)
    return Description(path, links, joints, hashlib.sha256(content).hexdigest())


def transmissions(path: str) -> list[tuple[str, list[str]]]:
    """Return the kinds of the transmissions of a URDF in lower case, and their joints."""
    robot = ElementTree.fromstring(read_content(path))
    return [((each.findtext('type') or each.get('type') or '').lower(),
             [joint.get('name', '') for joint in each.findall('joint')])
            for each in robot.findall('transmission')]


def _read(path: str, elements: list[ElementTree.Element],
          reader: Callable[[ElementTree.Element], Item]) -> dict[str, Item]:
    """Return what a reader makes of links or joints, by name."""
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
        return np.zeros(PARAMETERS)
    origin, inertia = inertial.find('origin'), inertial.find('inertia')
    if inertial.find('mass[@value]') is None:
        raise ValueError('<inertial> is without a <mass value="...">, must have one [kg]')
    mass = _number(inertial.find('mass'), 'value', 0.0)
    xx, xy, xz, yy, yz, zz = (_number(inertia, f'i{axes}', 0.0)
                              for axes in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz'))
    if mass < 0 or min(xx, yy, zz) < 0:
        raise ValueError(f'its mass is {mass:g} kg, its moments of inertia {xx:g}, {yy:g}, '
                         f'{zz:g} kg m^2: none may be negative')
    R = rotation_of(_numbers(origin, 'rpy', '0 0 0'))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return body_at(mass, _numbers(origin, 'xyz', '0 0 0'), R @ tensor @ R.T)


def _joint(joint: ElementTree.Element) -> Joint:
    name, kind = joint.get('name', ''), joint.get('type', '')
    if kind not in KINDS:
        raise ValueError(f'its type is "{kind}", must be one of {", ".join(KINDS)}')
    parent, child, origin = joint.find('parent'), joint.find('child'), joint.find('origin')
    if parent is None or child is None:
        raise ValueError('it is without <parent> or <child>, must have both')
    axis = np.array(_numbers(joint.find('axis'), 'xyz', '1 0 0'))
    length = float(np.linalg.norm(axis))
    if kind not in (FIXED, FLOATING) and not length > 0:
        raise ValueError('its axis has no length')
    limit, mimic = joint.find('limit'), joint.find('mimic')
    lower, upper = _number(limit, 'lower', 0.0), _number(limit, 'upper', 0.0)
    if lower > upper and kind != CONTINUOUS:
        raise ValueError(f'its lower limit is {lower:g}, must be below its upper one, {upper:g}')
    if not lower < upper:  # a URDF may leave them out
        lower, upper = -np.inf, np.inf
    speed, effort = (_number(limit, key, 0.0) or np.inf for key in ('velocity', 'effort'))
    if min(speed, effort) < 0:
        raise ValueError(f'its limits are {speed:g} of velocity and {effort:g} of effort, must be '
                         'at least 0')
    return Joint(
        name, kind, parent.get('link', ''), child.get('link', ''),
        Frame.of(_numbers(origin, 'xyz', '0 0 0'), _numbers(origin, 'rpy', '0 0 0')),
        axis / length if length > 0 else axis, lower, upper, speed, effort,
        None if mimic is None else Mimic(mimic.get('joint', ''),
                                         _number(mimic, 'multiplier', 1.0),
                                         _number(mimic, 'offset', 0.0)))


def _require_tree(path: str, links: dict[str, np.ndarray], joints: dict[str, Joint]) -> None:
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
    if ring := _ring(hanging):
        raise UnreadableFileError(
            path, f'{", ".join(ring[:6])} hang on one another: a URDF is a tree, close loops by '
            'robot.loops')
    if ring := _ring({name: joint.mimic.joint for name, joint in joints.items()
                      if joint.mimic is not None}):
        raise UnreadableFileError(path, f'{", ".join(ring[:6])}: a joint must mimic none that '
                                  'mimics it')


def _ring(following: dict[str, str]) -> list[str]:
    """Return names of which each follows the next and the last the first, [] for none."""
    done: set[str] = set()
    for start in following:
        path: list[str] = []
        name: str | None = start
        while name is not None and name not in done:
            done.add(name)
            path.append(name)
            name = following.get(name)
        if name in path:
            return path[path.index(name):]
    return []
