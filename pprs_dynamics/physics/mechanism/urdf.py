# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robot descriptions from URDF: links with their inertia, joints with their limits."""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from pathlib import Path

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
KINDS = (REVOLUTE, CONTINUOUS, PRISMATIC, FIXED, FLOATING)


def read_content(path: str, largest: int = LARGEST_FILE) -> bytes:
    """Return the content of a file of a description, or raise UnreadableFileError."""
    file = Path(path)
    require_file(file)
    try:
        if file.stat().st_size > largest:
            raise UnreadableFileError(path, f'more than {largest / 1e6:.0f} MB: no URDF')
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
    try:
        links = {_named(link): _inertial(link) for link in robot.findall('link')}
        joints = {_named(joint): _joint(joint) for joint in robot.findall('joint')}
    except (KeyError, ValueError) as error:
        raise UnreadableFileError(path, f'not a URDF that can be read: {error}') from None
    _require_tree(path, links, joints)
    return Description(path, links, joints, hashlib.sha256(content).hexdigest())


def transmissions(path: str) -> list[tuple[str, list[str]]]:
    """Return the kinds of the transmissions of a URDF in lower case, and their joints."""
    robot = ElementTree.fromstring(read_content(path))
    return [((each.findtext('type') or each.get('type') or '').lower(),
             [joint.get('name', '') for joint in each.findall('joint')])
            for each in robot.findall('transmission')]


def _named(element: ElementTree.Element) -> str:
    name = element.get('name')
    if not name:
        raise ValueError(f'a <{element.tag}> without a name')
    return name


def _numbers(element: ElementTree.Element | None, key: str, default: str) -> tuple[float, ...]:
    text = default if element is None else element.get(key, default)
    numbers = tuple(float(word) for word in text.split())
    if len(numbers) != len(default.split()) or not np.all(np.isfinite(numbers)):
        raise ValueError(f'{key}="{text}" is not {len(default.split())} finite numbers')
    return numbers


def _number(element: ElementTree.Element | None, key: str, default: float) -> float:
    return default if element is None or element.get(key) is None else _numbers(
        element, key, '0')[0]


def _inertial(link: ElementTree.Element) -> np.ndarray:
    inertial = link.find('inertial')
    if inertial is None:
        return np.zeros(PARAMETERS)
    origin, inertia = inertial.find('origin'), inertial.find('inertia')
    mass = _number(inertial.find('mass'), 'value', 0.0)
    xx, xy, xz, yy, yz, zz = (_number(inertia, f'i{axes}', 0.0)
                              for axes in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz'))
    if mass < 0 or min(xx, yy, zz) < 0:
        raise ValueError(f'the mass of {_named(link)} is {mass:g} kg, its moments of inertia '
                         f'{xx:g}, {yy:g}, {zz:g} kg m^2: none may be negative')
    R = rotation_of(_numbers(origin, 'rpy', '0 0 0'))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return body_at(mass, _numbers(origin, 'xyz', '0 0 0'), R @ tensor @ R.T)


def _joint(joint: ElementTree.Element) -> Joint:
    name, kind = _named(joint), joint.get('type', '')
    if kind not in KINDS:
        raise ValueError(f'{name} is of the type {kind}, must be one of {", ".join(KINDS)}')
    parent, child, origin = joint.find('parent'), joint.find('child'), joint.find('origin')
    if parent is None or child is None:
        raise ValueError(f'{name} has no parent or no child')
    axis = np.array(_numbers(joint.find('axis'), 'xyz', '1 0 0'))
    length = float(np.linalg.norm(axis))
    if kind not in (FIXED, FLOATING) and not length > 0:
        raise ValueError(f'the axis of {name} has no length')
    limit, mimic = joint.find('limit'), joint.find('mimic')
    lower, upper = _number(limit, 'lower', 0.0), _number(limit, 'upper', 0.0)
    if not lower < upper:  # a URDF may leave them out
        lower, upper = -np.inf, np.inf
    speed, effort = (_number(limit, key, 0.0) or np.inf for key in ('velocity', 'effort'))
    return Joint(
        name, kind, parent.get('link', ''), child.get('link', ''),
        Frame.of(_numbers(origin, 'xyz', '0 0 0'), _numbers(origin, 'rpy', '0 0 0')),
        axis / length if length > 0 else axis, lower, upper, speed, effort,
        None if mimic is None else Mimic(mimic.get('joint', ''),
                                         _number(mimic, 'multiplier', 1.0),
                                         _number(mimic, 'offset', 0.0)))


def _require_tree(path: str, links: dict[str, np.ndarray], joints: dict[str, Joint]) -> None:
    """Raise UnreadableFileError where joints do not make one tree of the links."""
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
