# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Geometry and masses of the 3-PPRS, and its tree of bodies with closures."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.mechanism.description import (
    FLOATING,
    PARAMETERS,
    PRISMATIC,
    REVOLUTE,
    Description,
    Frame,
    Joint,
    Loop,
    body_at,
)
from pprs_dynamics.physics.mechanism.structure import Structure, build_structure

ELBOWS = ('up', 'down')


@dataclass(frozen=True)
class Geometry:
    """Lengths and angles of the mechanism.

    Parameters
    ----------
    base_radius, platform_radius, rod_length : float
        R, r and l [m].
    chain_angles, platform_angles : 3 floats
        delta_i on the base and delta'_i on the platform [rad].
    elbow : {'up', 'down'}
        Branch of the inverse kinematics: 'up' has sin u_i > 0, the carriage below the platform.
    """

    base_radius: float
    platform_radius: float
    rod_length: float
    chain_angles: tuple[float, float, float]
    platform_angles: tuple[float, float, float]
    elbow: str = 'up'

    def __post_init__(self) -> None:
        for name in ('chain_angles', 'platform_angles'):
            angles = np.asarray(getattr(self, name), dtype=float)
            distance = np.abs(np.exp(1j * angles) - np.exp(1j * np.roll(angles, 1)))
            _require(f'geometry.{name}', getattr(self, name), bool(np.all(distance > 1e-6)),
                     'hold three different directions')
        turned = np.subtract(self.platform_angles, self.chain_angles)
        span = np.abs(self.base_radius - self.platform_radius * np.cos(turned)).max()
        _require('geometry.rod_length', self.rod_length, bool(span < self.rod_length),
                 f'be greater than {span:.6g} m, for the platform to stand unturned above the '
                 'base')

    @property
    def elbow_sign(self) -> float:
        """Sign of sin u_i."""
        return 1.0 if self.elbow == 'up' else -1.0


@dataclass(frozen=True)
class Masses:
    """Masses and the inertia of the platform with its payload.

    Parameters
    ----------
    platform, payload : float
        M and m [kg].
    slides, lifts, rods : 3 floats each
        m_1..m_3, m_4..m_6 and m_b of each chain [kg].
    centre : 3 floats
        Centre of mass of platform and payload from o, in `platform` [m].
    inertia : 6 floats
        Elements xx, yy, zz, xy, xz, yz of the inertia tensor of both about that centre, in
        `platform` [kg m^2]; products as tensor elements (-integral of x y dm), as in a URDF.
    """

    platform: float
    payload: float
    slides: tuple[float, float, float]
    lifts: tuple[float, float, float]
    rods: tuple[float, float, float]
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]

    def __post_init__(self) -> None:
        _require('masses.platform', self.platform, self.total > 0,
                 'with masses.payload be greater than 0 kg')
        # A body's tensor has principal moments that satisfy the triangle inequality; a point
        # mass has none at all. Tolerance: a thin disc lies exactly on the border.
        moments = np.linalg.eigvalsh(self.inertia_tensor)
        slack = 1e-9 * max(float(moments[2]), 1e-300)
        _require('masses.inertia', self.inertia, bool(moments[0] >= -slack),
                 'be a positive semi-definite tensor')
        triangle = bool(moments[0] + moments[1] >= moments[2] - slack)
        _require('masses.inertia', self.inertia, triangle,
                 'have principal moments of which each two sum to at least the third')

    @property
    def total(self) -> float:
        """M + m [kg]."""
        return self.platform + self.payload

    @property
    def inertia_tensor(self) -> Array:
        """Inertia tensor about the centre of mass, in `platform`, (3, 3) [kg m^2]."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _require(key: str, value: Any, condition: bool, rule: str) -> None:
    if not condition:
        raise ModelError(key, value, rule)


HOME_HEIGHT = 0.5  # [m], of the platform at home
UNLOADED = Masses(1.0, 0.0, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 6)


@lru_cache
def structure_of(geometry: Geometry) -> Structure:
    """Return the joints and closures of a 3-PPRS, whose platform is a free body.

    Raises
    ------
    ModelError
        Where the drives do not determine the platform's motion at home.
    """
    return tree_structure(geometry, UNLOADED, (np.full(6, -np.inf), *np.full((2, 6), np.inf)))


def tree_structure(geometry: Geometry, masses: Masses, limits: tuple[Array, Array, Array],
                   ) -> Structure:
    """Return the joints, closures and bodies of a 3-PPRS, whose platform is a free body.

    Parameters
    ----------
    geometry : Geometry
    masses : Masses
    limits : tuple of three (6,) arrays
        Lowest and highest position of each drive [m], and its largest force [N].
    """
    R, r, l = geometry.base_radius, geometry.platform_radius, geometry.rod_length  # noqa: E741
    platform = body_at(masses.total, masses.centre, masses.inertia_tensor)
    links = {'base': np.zeros(PARAMETERS)}
    joints: dict[str, Joint] = {}
    loops: list[Loop] = []
    home: dict[str, float] = {}
    e_x, e_y, e_z = np.eye(3)

    def hang(joint: str, joint_kind: str, parent: str, child: str, frame: Frame, axis: Array,
             ) -> None:
        joints[joint] = Joint(joint, joint_kind, parent, child, frame, axis)

    for i in range(3):
        delta, beta = geometry.chain_angles[i], geometry.platform_angles[i]
        n = i + 1
        mass = masses.rods[i]
        across = mass * l ** 2 / 12
        links[f'slide_{n}'] = body_at(masses.slides[i], (0.0,) * 3, np.zeros((3, 3)))
        links[f'lift_{n}'] = body_at(masses.lifts[i], (0.0,) * 3, np.zeros((3, 3)))
        links[f'rod_{n}'] = body_at(mass, (-l / 2, 0.0, 0.0), np.diag([0.0, across, across]))
        foot = Frame.of((R * math.cos(delta), R * math.sin(delta), 0.0), (0.0, 0.0, delta))
        hang(f'slide_{n}', PRISMATIC, 'base', f'slide_{n}', foot, e_y)
        hang(f'lift_{n}', PRISMATIC, f'slide_{n}', f'lift_{n}', Frame(), e_z)
        hang(f'hinge_{n}', REVOLUTE, f'lift_{n}', f'rod_{n}', Frame(), e_y)
        cos_u = (R - r * math.cos(beta - delta)) / l
        u = geometry.elbow_sign * math.acos(cos_u)
        home |= {f'slide_{n}': r * math.sin(beta - delta),
                 f'lift_{n}': HOME_HEIGHT - l * math.sin(u), f'hinge_{n}': u}
        end = Frame(p=np.array([r * math.cos(beta), r * math.sin(beta), 0.0]))
        loops.append(Loop(f'ball_{n}', 'spherical', f'rod_{n}', Frame(p=np.array([-l, 0.0, 0.0])),
                          'platform', end))
    links['platform'] = platform
    hang('platform', FLOATING, 'base', 'platform', Frame(), e_x)
    poses = {'platform': Frame(p=np.array([0.0, 0.0, HOME_HEIGHT]))}
    for drive, lower, upper, effort in zip(DRIVES, *limits, strict=True):
        joints[drive] = replace(joints[drive], lower=float(lower), upper=float(upper),
                                effort=float(effort))
    description = Description('', links, joints, '')
    return build_structure(description, 'base', 'platform', DRIVES, tuple(loops), home, poses)
