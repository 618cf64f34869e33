# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robots with loops as URDF text and blocks of a model file, made from their dimensions.

`python test/support/robots_with_loops.py` writes config/hexapod.* and config/delta.* anew.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

NO_LIMIT = (-3.1, 3.1, 20.0, 200.0)


def words(values: Any) -> str:
    """Return numbers as a file has them, in full: comparisons reach beyond 12 digits."""
    return ' '.join(f'{float(value):.17g}' for value in np.asarray(values).ravel() + 0.0)


def rpy_of(R: np.ndarray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a rotation matrix."""
    return (float(np.arctan2(R[2, 1], R[2, 2])),
            float(np.arctan2(-R[2, 0], np.hypot(R[2, 1], R[2, 2]))),
            float(np.arctan2(R[1, 0], R[0, 0])))


def frame_with_z(z: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return a rotation matrix whose third column is z, its first near x."""
    z = z / np.linalg.norm(z)
    y = np.cross(z, x)
    y /= np.linalg.norm(y)
    return np.column_stack((np.cross(y, z), y, z))


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
              R: np.ndarray | None = None, axis: Any = (0, 0, 1), limit: Any = NO_LIMIT,
              more: str = '') -> None:
        """Add a joint."""
        rpy = rpy_of(np.eye(3) if R is None else R)
        moves = '' if kind in ('fixed', 'floating') else (
            f'\n    <axis xyz="{words(axis)}"/>')
        if kind in ('revolute', 'prismatic'):
            lower, upper, speed, effort = limit
            moves += (f'\n    <limit lower="{lower:g}" upper="{upper:g}" velocity="{speed:g}" '
                      f'effort="{effort:g}"/>')
        self.parts.append(
            f'  <joint name="{name}" type="{kind}">\n    <parent link="{parent}"/>\n'
            f'    <child link="{child}"/>\n    <origin xyz="{words(xyz)}" rpy="{words(rpy)}"/>'
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

    def write(self, folder: Path, friction: dict[str, Any] | None = None, comment: str = '',
              **more: Any) -> Path:
        """Write URDF and model file, and return the latter."""
        (folder / f'{self.name}.urdf').write_text(self.urdf)

        def block(values: dict[str, Any], indent: int) -> str:
            lines = []
            for key, value in values.items():
                if isinstance(value, dict) and (indent < 8 or any(
                        isinstance(one, dict) for one in value.values())):
                    lines.append(' ' * indent + f'{key}:\n' + block(value, indent + 2))
                else:
                    lines.append(' ' * indent + f'{key}: {flow(value)}')
            return '\n'.join(lines)

        robot = {'urdf': f'{self.name}.urdf', 'base': self.base, 'tool': self.tool,
                 'drives': self.drives, **({'home': self.home} if self.home else {}),
                 **({'loops': self.loops} if self.loops else {})}
        values = {'robot': robot, **({'friction': friction} if friction else {}), **more}
        path = folder / f'{self.name}.yaml'
        path.write_text(comment + '/**:\n  ros__parameters:\n' + block(values, 4) + '\n')
        return path


def flow(value: Any) -> str:
    """Return a value in YAML's flow style."""
    if isinstance(value, dict):
        return '{' + ', '.join(f'{key}: {flow(one)}' for key, one in value.items()) + '}'
    if isinstance(value, (list, tuple)):
        return '[' + ', '.join(flow(one) for one in value) + ']'
    return repr(value) if isinstance(value, float) else str(value)


def hexapod() -> RobotText:
    """Return a 6-UPS Gough platform whose platform is a floating branch."""
    robot = RobotText('hexapod')
    robot.link('base')
    height = 0.45
    robot.link('platform', 3.0, (0.0, 0.0, 0.01), (0.02, 0.02, 0.04))
    robot.joint('free', 'floating', 'base', 'platform')
    robot.home['platform_pose'] = [0.0, 0.0, height, 0.0, 0.0, 0.0, 1.0]
    for k in range(6):
        side, pair = (1 if k % 2 else -1), k // 2
        at = 2 * np.pi * pair / 3 + side * np.radians(15)
        on = 2 * np.pi * pair / 3 + side * np.radians(45)
        foot = 0.30 * np.array([np.cos(at), np.sin(at), 0.0])
        ball = 0.16 * np.array([np.cos(on), np.sin(on), 0.0])
        along = ball + np.array([0, 0, height]) - foot
        length = float(np.linalg.norm(along))
        R = frame_with_z(along, np.array([-np.sin(at), np.cos(at), 0.0]))
        n = k + 1
        robot.link(f'cross_{n}')
        robot.link(f'cylinder_{n}', 0.8, (0, 0, 0.12), (0.004, 0.004, 0.0005))
        robot.link(f'rod_{n}', 0.4, (0, 0, -0.15), (0.003, 0.003, 0.0001))
        robot.joint(f'hinge_{n}', 'continuous', 'base', f'cross_{n}', foot, R, (1, 0, 0))
        robot.joint(f'fork_{n}', 'continuous', f'cross_{n}', f'cylinder_{n}', axis=(0, 1, 0))
        robot.joint(f'leg_{n}', 'prismatic', f'cylinder_{n}', f'rod_{n}', axis=(0, 0, 1),
                    limit=(0.40, 0.66, 0.5, 300.0))
        robot.drives.append(f'leg_{n}')
        robot.home[f'leg_{n}'] = round(length, 4)
        robot.loop(f'ball_{n}', 'spherical', f'rod_{n}', (0, 0, 0), 'platform', ball)
    return robot


def delta() -> RobotText:
    """Return a delta robot with all six rods, its platform a floating branch."""
    robot = RobotText('delta')
    radius, upper, lower, small, spread = 0.20, 0.20, 0.46, 0.05, 0.04
    robot.link('base')
    arm_angle = np.radians(20)
    reach = radius + upper * np.cos(arm_angle) - small
    drop = upper * np.sin(arm_angle) + np.sqrt(lower ** 2 - reach ** 2)
    robot.link('platform', 0.4, (0, 0, -0.01), (0.0004, 0.0004, 0.0007))
    robot.joint('free', 'floating', 'base', 'platform')
    robot.home['platform_pose'] = [0.0, 0.0, round(-float(drop), 4), 0.0, 0.0, 0.0, 1.0]
    for k in range(3):
        n, angle = k + 1, 2 * np.pi * k / 3
        R = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0],
                      [0, 0, 1.0]])
        robot.link(f'arm_{n}', 0.5, (0.08, 0, 0), (0.0003, 0.0025, 0.0025))
        # Positive is down: about the tangent.
        robot.joint(f'shoulder_{n}', 'revolute', 'base', f'arm_{n}', R @ [radius, 0, 0], R,
                    (0, 1, 0), limit=(-0.6, 1.3, 8.0, 25.0))
        robot.drives.append(f'shoulder_{n}')
        robot.home[f'shoulder_{n}'] = round(float(arm_angle), 4)
        elbow = np.array([radius + upper * np.cos(arm_angle), 0, -upper * np.sin(arm_angle)])
        wrist = np.array([small, 0, -drop])
        along = wrist - elbow
        turn = np.array([[np.cos(arm_angle), 0, np.sin(arm_angle)], [0, 1, 0],
                         [-np.sin(arm_angle), 0, np.cos(arm_angle)]])
        for side, sign in (('l', 1), ('r', -1)):
            rod = f'{n}{side}'
            robot.link(f'cross_{rod}')
            robot.link(f'rod_{rod}', 0.08, (0, 0, lower / 2), (0.0014, 0.0014, 0.00001))
            robot.joint(f'elbow_{rod}', 'continuous', f'arm_{n}', f'cross_{rod}',
                        (upper, sign * spread, 0),
                        turn.T @ frame_with_z(along, np.array([0, 1.0, 0])), (1, 0, 0))
            robot.joint(f'swing_{rod}', 'continuous', f'cross_{rod}', f'rod_{rod}', axis=(0, 1, 0))
            robot.loop(f'ball_{rod}', 'spherical', f'rod_{rod}', (0, 0, lower), 'platform',
                       R @ [small, sign * spread, 0])
    return robot


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


def three_pprs(model: Any, home: Any) -> RobotText:
    """Return a 3-PPRS of a `DriveModel` as a tree with loops; `home` is its state at one pose."""
    geometry, masses = model.robot.geometry, model.robot.masses
    robot = RobotText('three_pprs')
    robot.link('base')
    xx, yy, zz, *products = masses.inertia
    assert not any(products)
    robot.link('platform', masses.platform + masses.payload, masses.centre, (xx, yy, zz))
    robot.joint('free', 'floating', 'base', 'platform')
    robot.home['platform_pose'] = [*map(float, home.motion.position[0]),
                                   *map(float, home.motion.orientation[0])]
    length = geometry.rod_length
    for i, angle in enumerate(geometry.chain_angles):
        n = i + 1
        foot = geometry.base_radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        along = np.array([-np.sin(angle), np.cos(angle), 0.0])
        on = geometry.platform_angles[i]
        ball = geometry.platform_radius * np.array([np.cos(on), np.sin(on), 0.0])
        robot.link(f'slider_{n}', masses.slides[i])
        robot.link(f'carriage_{n}', masses.lifts[i])
        across = masses.rods[i] * length ** 2 / 12
        robot.link(f'rod_{n}', masses.rods[i], (0, 0, length / 2), (across, across, 0.0))
        robot.joint(f'slide_{n}', 'prismatic', 'base', f'slider_{n}', foot, axis=along)
        robot.joint(f'lift_{n}', 'prismatic', f'slider_{n}', f'carriage_{n}')
        robot.joint(f'hinge_{n}', 'continuous', f'carriage_{n}', f'rod_{n}', axis=along)
        robot.loop(f'ball_{n}', 'spherical', f'rod_{n}', (0, 0, length), 'platform', ball)
        chains = home.links.chains
        robot.home[f'hinge_{n}'] = float(np.arctan2(-chains.cos_u[0, i], chains.sin_u[0, i]))
        for kind, at in (('slide', i), ('lift', 3 + i)):
            robot.home[f'{kind}_{n}'] = float(home.position[0, at])
    robot.drives = [f'{kind}_{n}' for kind in ('slide', 'lift') for n in (1, 2, 3)]
    return robot


def _write_examples(folder: Path) -> None:
    licence = ('# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders\n'
               '# SPDX-License-Identifier: Apache-2.0\n')
    legs = hexapod()
    joints: dict[str, Any] = {}
    for n in range(1, 7):
        for kind in ('hinge', 'fork'):
            joints[f'{kind}_{n}'] = {'viscous': 0.02, 'coulomb': 0.05, 'radius': 0.008}
        joints[f'ball_{n}'] = {'viscous': 0.02, 'coulomb': 0.05, 'radius': 0.01}
    legs.write(folder, {'viscous': [20.0] * 6, 'coulomb': [3.0] * 6, 'offset': [0.0] * 6,
                        'reversal_velocity': 0.002, 'reversal_rate': 0.005, 'joints': joints},
               licence + '# A 6-UPS Gough platform: six legs on universal joints carry a platform '
               'on balls.\n# docs/robots.md goes through it.\n')
    arms = delta()
    joints = {}
    for n in '123':
        for side in 'lr':
            for kind in ('elbow', 'swing', 'ball'):
                joints[f'{kind}_{n}{side}'] = {'viscous': 0.001, 'coulomb': 0.08,
                                               'radius': 0.005}
    arms.write(folder, {'viscous': [0.05] * 3, 'coulomb': [0.1] * 3, 'offset': [0.0] * 3,
                        'reversal_velocity': 0.02, 'reversal_rate': 0.02, 'joints': joints},
               licence + '# A delta robot with all six rods: three driven arms, a platform that '
               'keeps its attitude.\n')


if __name__ == '__main__':
    _write_examples(Path(__file__).parents[2] / 'config')
