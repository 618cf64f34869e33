# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Description of a robot as files have it: links, joints that make a tree, and closures."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array

REVOLUTE, CONTINUOUS, PRISMATIC = 'revolute', 'continuous', 'prismatic'
FIXED, FLOATING = 'fixed', 'floating'
TURNING = (REVOLUTE, CONTINUOUS)
PARAMETERS = 10  # m, m c (3), I about the frame's origin (xx xy yy xz yz zz): inertia of a body


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame in another one.

    Parameters
    ----------
    R : (3, 3) array
    p : (3,) array
        [m]
    """

    R: Array = field(default_factory=lambda: np.eye(3))
    p: Array = field(default_factory=lambda: np.zeros(3))

    def __matmul__(self, other: Frame) -> Frame:
        return Frame(self.R @ other.R, self.R @ other.p + self.p)

    @property
    def inverse(self) -> Frame:
        """The other frame in this one."""
        return Frame(self.R.T, -self.R.T @ self.p)

    @property
    def matrix(self) -> Array:
        """The homogeneous matrix, (4, 4)."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.R, self.p
        return T

    @classmethod
    def of(cls, xyz: tuple[float, ...], rpy: tuple[float, ...]) -> Frame:
        """Return the frame at xyz [m], turned by roll, pitch and yaw about fixed axes [rad]."""
        return cls(rotation_of(rpy), np.array(xyz, dtype=float))


def rotation_of(rpy: tuple[float, ...]) -> Array:
    """Return the rotation matrix of roll, pitch and yaw about fixed axes [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])


@dataclass(frozen=True, eq=False)
class Mimic:
    """A linear coupling: position = ratio times that of `joint` + offset."""

    joint: str
    ratio: float
    offset: float


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of the tree.

    Parameters
    ----------
    name, kind, parent, child : str
        Kind as in URDF; parent and child are links.
    frame : Frame
        Of the child in the parent's, at position 0.
    axis : (3,) array
        Of unit length, in the child's frame.
    lower, upper, speed, effort : float
        Limits, infinite where there are none.
    mimic : Mimic, optional
    start : float, optional
        Position in which the file places it, where that is not 0.
    armature, damping, dry : float
        Inertia of the rotor, viscous and dry friction, of a format that has them.
    reduction : float, optional
        Turns of the motor per turn of the joint.
    spring : (float, float), optional
        Stiffness, and where it is relaxed.
    """

    name: str
    kind: str
    parent: str
    child: str
    frame: Frame
    axis: Array
    lower: float = -np.inf
    upper: float = np.inf
    speed: float = np.inf
    effort: float = np.inf
    mimic: Mimic | None = None
    start: float | None = None
    armature: float = 0.0
    damping: float = 0.0
    dry: float = 0.0
    reduction: float | None = None
    spring: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Loop:
    """A closure: a joint that the tree lacks.

    Parameters
    ----------
    name, kind : str
        Kind: spherical, revolute, universal, cylindrical, prismatic or fixed.
    a, b : str
        Links.
    frame_a, frame_b : Frame
        In them.
    """

    name: str
    kind: str
    a: str
    frame_a: Frame
    b: str
    frame_b: Frame


@dataclass(frozen=True, eq=False)
class Transmission:
    """A gear between motors and joints; `reduction`, motor over joint, of a simple one."""

    name: str
    kind: str
    joints: tuple[str, ...]
    reduction: float | None


@dataclass(frozen=True, eq=False)
class Description:
    """Description of a robot: links, joints, closures.

    Parameters
    ----------
    path : str
    links : dict of str to (10,) array
        Inertial parameters in the link's frame, about its origin.
    joints : dict of str to Joint
    digest : str
        SHA-256 of the file.
    loops : tuple of Loop
        Of a format that has them.
    gravity : (3,) tuple, optional
        In the frame of its root, of a format that has it [m/s^2].
    remarks : tuple of str
        Sentences on what it holds that is not used.
    faults : tuple of str
        Sentences on bodies in it that cannot be.
    transmissions : tuple of Transmission
    """

    path: str
    links: dict[str, Array]
    joints: dict[str, Joint]
    digest: str
    loops: tuple[Loop, ...] = ()
    gravity: tuple[float, float, float] | None = None
    remarks: tuple[str, ...] = ()
    transmissions: tuple[Transmission, ...] = ()
    faults: tuple[str, ...] = ()

    @cached_property
    def hung(self) -> dict[str, Joint]:
        """The joint that each link hangs on, by link."""
        return {joint.child: joint for joint in self.joints.values()}

    @property
    def root(self) -> str:
        """The link that hangs on no other."""
        return next(link for link in self.links if link not in self.hung)


def moved_along(joint: Joint, position: float) -> Frame:
    """Return the frame of a joint at a position in its frame at 0."""
    if joint.kind == PRISMATIC:
        return Frame(p=position * joint.axis)
    return Frame(rotation_about(joint.axis, position))


def rotation_about(axis: Array, angle: float) -> Array:
    """Return the rotation matrix of a turn about an axis of unit length."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    R: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)
    return R


def inertial_in(frame: Frame, parameters: Array) -> Array:
    """Return inertial parameters (10,) of a body in the frame that its own frame stands in."""
    return from_pseudo_inertia(frame.matrix @ pseudo_inertia(parameters) @ frame.matrix.T)


def pseudo_inertia(parameters: Array) -> Array:
    """Return the pseudo-inertia matrix of inertial parameters (10,): second moments, (4, 4)."""
    mass, x, y, z, xx, xy, yy, xz, yz, zz = parameters
    half = (xx + yy + zz) / 2
    return np.array([[half - xx, -xy, -xz, x], [-xy, half - yy, -yz, y],
                     [-xz, -yz, half - zz, z], [x, y, z, mass]])


def from_pseudo_inertia(P: Array) -> Array:
    """Return the inertial parameters of a pseudo-inertia matrix, (10,)."""
    trace = P[0, 0] + P[1, 1] + P[2, 2]
    return np.array([P[3, 3], P[0, 3], P[1, 3], P[2, 3], trace - P[0, 0], -P[0, 1],
                     trace - P[1, 1], -P[0, 2], -P[1, 2], trace - P[2, 2]])


def about_centre(parameters: Array) -> tuple[float, Array, Array]:
    """Return mass, centre and inertia about it, (3, 3), of a body (10,).

    A body without mass, as of a rotor that only turns, has its centre at the origin.
    """
    mass = float(parameters[0])
    centre = parameters[1:4] / mass if mass else np.zeros(3)
    xx, xy, yy, xz, yz, zz = parameters[4:]
    about = (np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
             - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre)))
    return mass, centre, about


def principal_inertia(parameters: Array) -> tuple[float, Array, Array, Array]:
    """Return mass, centre, principal moments about it and their axes as columns, of a body (10,).

    The axes are right-handed.
    """
    mass, centre, about = about_centre(parameters)
    moments, axes = np.linalg.eigh(about)
    axes[:, 0] *= np.linalg.det(axes)
    return mass, centre, moments, axes


def body_at(mass: float, centre: ArrayLike, inertia: Array) -> Array:
    """Return the parameters (10,) of a body with an inertia (3, 3) about its centre of mass."""
    c = np.array(centre, dtype=float)
    about = inertia + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([mass, *(mass * c), about[0, 0], about[0, 1], about[1, 1], about[0, 2],
                     about[1, 2], about[2, 2]])
