# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robots with loops as URDF text and blocks of a model file: from `config`, or from dimensions."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

CONFIG = Path(__file__).parents[2] / 'config'
NO_LIMIT = (-3.1, 3.1, 20.0, 200.0)


def words(values: Any) -> str:
    """Return numbers as a file has them, in full: comparisons reach beyond 12 digits."""
    return ' '.join(f'{float(value):.17g}' for value in np.asarray(values).ravel() + 0.0)


@dataclass
class RobotText:
    """A robot under construction: URDF, loops, drives, home."""

    name: str
    base: str = 'base'
    tool: str = 'platform'
    parts: list[str] = field(default_factory=list)
    loops: dict[str, dict[str, Any]] = field(default_factory=dict)
    drives: list[str] = field(default_factory=list)
    home: dict[str, Any] = field(default_factory=dict)

    def link(self, name: str, mass: float = 0.0, centre: Any = (0, 0, 0),
             inertia: Any = (0, 0, 0)) -> None:
        """Add a link; `inertia` is that about the centre: xx yy zz."""
        if not mass:
            self.parts.append(f'  <link name="{name}"/>')
            return
        xx, yy, zz = inertia
        self.parts.append(
            f'  <link name="{name}">\n    <inertial>\n      <origin xyz="{words(centre)}"/>\n'
            f'      <mass value="{mass:.17g}"/>\n      <inertia ixx="{xx:.17g}" iyy="{yy:.17g}" '
            f'izz="{zz:.17g}" ixy="0" ixz="0" iyz="0"/>\n    </inertial>\n  </link>')

    def joint(self, name: str, kind: str, parent: str, child: str, xyz: Any = (0, 0, 0),
              axis: Any = (0, 0, 1), limit: Any = NO_LIMIT, more: str = '') -> None:
        """Add a joint."""
        moves = '' if kind in ('fixed', 'floating') else (f'\n    <axis xyz="{words(axis)}"/>')
        if kind in ('revolute', 'prismatic'):
            lower, upper, speed, effort = limit
            moves += (f'\n    <limit lower="{lower:g}" upper="{upper:g}" velocity="{speed:g}" '
                      f'effort="{effort:g}"/>')
        self.parts.append(
            f'  <joint name="{name}" type="{kind}">\n    <parent link="{parent}"/>\n'
            f'    <child link="{child}"/>\n    <origin xyz="{words(xyz)}"/>'
            f'{moves}{more}\n  </joint>')

    def loop(self, name: str, kind: str, a: str, xyz_a: Any, b: str, xyz_b: Any,
             rpy_a: Any = None, rpy_b: Any = None) -> None:
        """Add a closure."""
        sides = {}
        for side, link, xyz, rpy in (('a', a, xyz_a, rpy_a), ('b', b, xyz_b, rpy_b)):
            sides[side] = {'link': link, 'xyz': [float(x) for x in xyz]}
            if rpy is not None:
                sides[side]['rpy'] = [float(x) for x in rpy]
        self.loops[name] = {'type': kind, **sides}

    @property
    def urdf(self) -> str:
        """The URDF."""
        return '\n'.join(('<?xml version="1.0"?>', f'<robot name="{self.name}">', *self.parts,
                          '</robot>', ''))

    def write(self, folder: Path, friction: dict[str, Any] | None = None) -> Path:
        """Write URDF and model file, and return the latter."""
        (folder / f'{self.name}.urdf').write_text(self.urdf)
        robot = {'urdf': f'{self.name}.urdf', 'base': self.base, 'tool': self.tool,
                 'drives': self.drives, **({'home': self.home} if self.home else {}),
                 **({'loops': self.loops} if self.loops else {})}
        path = folder / f'{self.name}.yaml'
        path.write_text(yaml.safe_dump({'/**': {'ros__parameters': {
            'robot': robot, **({'friction': friction} if friction else {})}}}))
        return path


def hexapod() -> RobotText:
    """Return the 6-UPS Gough platform of `config`."""
    return _of_config('hexapod')


def delta() -> RobotText:
    """Return the delta robot of `config`, with all six rods."""
    return _of_config('delta')


def _of_config(name: str) -> RobotText:
    """Return a robot of `config` without its friction."""
    block = yaml.safe_load((CONFIG / f'{name}.yaml').read_text())['/**']['ros__parameters']['robot']
    head = (CONFIG / f'{name}.urdf').read_text().partition('</robot>')[0]
    parts = re.split(r'\n(?=  <(?:link|joint) )', head.rstrip())[1:]
    return RobotText(name, parts=parts, **{key: block[key] for key in (
        'base', 'tool', 'loops', 'drives', 'home')})


def five_bar() -> RobotText:
    """Return a planar five-bar whose loop is one revolute joint: three of five rows count."""
    robot = RobotText('five_bar', tool='right_rod')
    robot.link('base')
    outer, half = 0.3, 0.14
    height = 0.15 + np.sqrt(outer ** 2 - (half + 0.1) ** 2)
    for side, sign in (('left', -1), ('right', 1)):
        bend = np.arctan2(0.15, sign * 0.1)
        length = float(np.hypot(0.1, 0.15))
        end = np.array([sign * (half + 0.1), 0.15])
        rod = np.arctan2(height - end[1], -end[0])
        robot.link(f'{side}_arm', 0.6, (length / 2, 0.01, 0), (0.0004, 0.003, 0.0032))
        robot.link(f'{side}_rod', 0.4, (outer / 2, 0, 0.01), (0.0002, 0.004, 0.0042))
        robot.joint(f'{side}', 'revolute', 'base', f'{side}_arm', (sign * half, 0, 0))
        robot.joint(f'{side}_elbow', 'continuous', f'{side}_arm', f'{side}_rod', (length, 0, 0))
        robot.drives.append(side)
        robot.home[side] = round(float(bend), 3)
        robot.home[f'{side}_elbow'] = round(float(rod - bend), 3)
    robot.loop('tip', 'revolute', 'left_rod', (outer, 0, 0), 'right_rod', (outer, 0, 0))
    return robot
