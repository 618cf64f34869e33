# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS as a tree of bodies with closures: three chains and a platform."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
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
from pprs_dynamics.physics.three_pprs.geometry import Geometry, Masses

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
