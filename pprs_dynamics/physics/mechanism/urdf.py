# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Serial arms from URDF, by Pinocchio; what it cannot carry is refused."""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MISSING, MissingLibraryError, ModelError, UnreadableFileError
from pprs_dynamics.system.input_files import require_file

LARGEST_FILE = 20_000_000  # bytes; descriptions of robots without meshes have some 100 kB
TURNING, SLIDING = 'revolute', 'prismatic'
# Joints whose motors do not move one joint each.
COUPLED = ('differential', 'fourbar')
PARAMETERS = 10  # m, m c (3), I about the joint's origin (xx xy yy xz yz zz): inertia of a body


@dataclass(frozen=True, eq=False)
class ArmTree:
    """What a URDF says of the arm that a model is of, joints in the model's order.

    Parameters
    ----------
    model : pinocchio.Model
        With only these joints; all others stand at zero.
    joints : tuple of n str
    kinds : tuple of n str
        `revolute` or `prismatic`.
    order : (n,) int array
        Each joint's place in Pinocchio's vectors.
    tool, base : int
        Frames.
    inertial : (n, 10) array
        Inertial parameters of the links, about the joints' origins.
    lower, upper, speed, effort : (n,) arrays
        The URDF's limits; infinite where it has none.
    digest : str
        SHA-256 of the file.
    """

    model: Any
    joints: tuple[str, ...]
    kinds: tuple[str, ...]
    order: np.typing.NDArray[np.int_]
    tool: int
    base: int
    inertial: Array
    lower: Array
    upper: Array
    speed: Array
    effort: Array
    digest: str

    @property
    def carrier(self) -> int:
        """Number of the joint whose link carries the tool."""
        return self.joints.index(self.model.names[self.model.frames[self.tool].parentJoint])


def pinocchio() -> Any:
    """Return the library Pinocchio.

    Raises
    ------
    MissingLibraryError
        Where it is not installed.
    """
    try:
        import pinocchio as library
    except ImportError:
        raise MissingLibraryError('pin', 'a model of an arm', 'arm') from None
    return library


def read_arm(path: str, base: str, tool: str, joints: tuple[str, ...]) -> ArmTree:
    """Return the arm of a URDF that the joints make.

    Parameters
    ----------
    path : str
    base, tool : str
        Links: the one that stands, and the one that carries the load.
    joints : tuple of str

    Raises
    ------
    ModelError
        Where the URDF lacks what is named, or a joint is of a kind that is not covered.
    UnreadableFileError
        Where the file is missing or no URDF.
    MissingLibraryError
        Without Pinocchio.
    """
    file = Path(path)
    require_file(file)
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise UnreadableFileError(path, f'more than {LARGEST_FILE / 1e6:.0f} MB: no URDF')
        content = file.read_bytes()
    except OSError as error:
        if isinstance(error, UnreadableFileError):
            raise
        raise UnreadableFileError(path, error.strerror or str(error)) from None
    return _tree(content, str(path), base, tool, joints)


@lru_cache(maxsize=16)
def _tree(content: bytes, path: str, base: str, tool: str, joints: tuple[str, ...]) -> ArmTree:
    kinds = _kinds(content, path, joints)
    library = pinocchio()
    try:
        whole = library.buildModelFromXML(content.decode())
    except (ValueError, RuntimeError, UnicodeDecodeError) as error:
        raise UnreadableFileError(path, f'not a URDF that can be read: {error}') from None
    others = [k for k, name in enumerate(whole.names) if k and name not in joints]
    model = library.buildReducedModel(whole, others, library.neutral(whole))
    frames = {key: _frame(model, key, name) for key, name in (('base', base), ('tool', tool))}
    if model.frames[frames['base']].parentJoint:
        raise ModelError('arm.base', base, 'be a link that none of arm.joints moves')
    if not model.frames[frames['tool']].parentJoint:
        raise ModelError('arm.tool', tool, 'be a link that arm.joints move')
    ids = [model.getJointId(name) for name in joints]
    order = np.array([model.joints[k].idx_v for k in ids])
    inertial = np.array([model.inertias[k].toDynamicParameters() for k in ids])
    return ArmTree(
        model, joints, kinds, order, frames['tool'], frames['base'], inertial,
        model.lowerPositionLimit[order], model.upperPositionLimit[order],
        _limit(model.velocityLimit[order]), _limit(model.effortLimit[order]),
        hashlib.sha256(content).hexdigest())


def _limit(values: Array) -> Array:
    """Return limits, where a URDF's 0 is none."""
    return np.where(values > 0, values, np.inf)


def _frame(model: Any, key: str, name: str) -> int:
    links = [frame.name for frame in model.frames if 'BODY' in str(frame.type)]
    if name not in links:
        raise ModelError(f'arm.{key}', name, f'be a link of the URDF: {", ".join(links[:40])}')
    return int(model.getFrameId(name))


def _kinds(content: bytes, path: str, joints: tuple[str, ...]) -> tuple[str, ...]:
    """Return the joints' kinds, or raise ModelError for those that are not covered."""
    try:
        robot = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise UnreadableFileError(path, f'not XML: {error}') from None
    if robot.tag != 'robot':
        raise UnreadableFileError(path, f'not a URDF: its root is <{robot.tag}>, must be <robot>')
    found = {one.get('name', ''): one for one in robot.findall('joint')}
    moving = [name for name, one in found.items() if one.get('type') != 'fixed']
    if len(set(joints)) < len(joints):
        raise ModelError('arm.joints', list(joints), 'name each joint once')
    for name, one in found.items():
        if one.get('type') in ('floating', 'planar'):
            raise ModelError('arm.urdf', path, 'be of a robot with a fixed base, of revolute and '
                             f'prismatic joints: {name} is {one.get("type")}')
    kinds = []
    for name in joints:
        if name not in found:
            raise ModelError('arm.joints', name,
                             f'be joints of the URDF: {", ".join(moving[:40]) or MISSING}')
        kind = found[name].get('type', '')
        if kind not in (TURNING, SLIDING):
            hint = ' (give it limits and the type revolute)' if kind == 'continuous' else ''
            raise ModelError('arm.joints', name, 'be revolute or prismatic, but is of the type '
                             f'{kind} in the URDF{hint}')
        kinds.append(kind)
    for name, one in found.items():
        mimic = one.find('mimic')
        if mimic is not None and (name in joints or mimic.get('joint') in joints):
            raise ModelError('arm.joints', name, f'move by itself, but mimics '
                             f'{mimic.get("joint")} in the URDF: coupled joints are not covered')
    for transmission in robot.findall('transmission'):
        kind = (transmission.findtext('type') or transmission.get('type') or '').lower()
        coupled = [one.get('name', '') for one in transmission.findall('joint')]
        if any(word in kind for word in COUPLED) and set(coupled) & set(joints):
            raise ModelError('arm.joints', coupled, 'have a motor each, but share a transmission '
                             f'{kind} in the URDF: coupled joints are not covered')
    return tuple(kinds)
