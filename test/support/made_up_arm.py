# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A made-up arm of two revolute joints and a prismatic one, its model file, and recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden.motions import joint_motion
from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.recording import Recording

JOINTS = ('turn', 'swing', 'reach')
BODIES = {  # mass, centre, moments and products of inertia about it
    'column': (6.0, (0.02, 0.01, 0.15), (0.09, 0.08, 0.03, 0.004, 0.002, -0.003)),
    'beam': (4.0, (0.2, 0.03, -0.02), (0.02, 0.11, 0.1, 0.003, -0.002, 0.001)),
    'slider': (1.5, (0.05, -0.02, 0.04), (0.01, 0.012, 0.009, 0.001, 0.0, 0.0005))}
FRICTION = {'friction.viscous': (8.0, 5.0, 20.0), 'friction.coulomb': (6.0, 4.0, 9.0),
            'friction.offset': (0.3, -0.2, 0.5)}
motion = joint_motion


def urdf(kind: str = 'revolute', more: str = '', mimic: str = '') -> str:
    """Return the arm's description; `kind` is the first joint's, `mimic` stands in the second."""
    links = ''.join(
        f'<link name="{name}"><inertial><mass value="{mass}"/>'
        f'<origin xyz="{x} {y} {z}" rpy="0 0 0"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="{xz}" iyz="{yz}"/>'
        '</inertial></link>'
        for name, (mass, (x, y, z), (xx, yy, zz, xy, xz, yz)) in BODIES.items())
    limit = '<limit lower="-3" upper="3" velocity="4" effort="200"/>'
    return f'''<?xml version="1.0"?><robot name="made_up">
<link name="stand"/>{links}<link name="flange"/>
<joint name="turn" type="{kind}"><parent link="stand"/><child link="column"/>
  <origin xyz="0 0 0.2" rpy="0 0 0.4"/><axis xyz="0 0 1"/>{limit}</joint>
<joint name="swing" type="revolute"><parent link="column"/><child link="beam"/>
  <origin xyz="0.05 0 0.3" rpy="0.1 0 0"/><axis xyz="0 1 0"/>{limit}{mimic}</joint>
<joint name="reach" type="prismatic"><parent link="beam"/><child link="slider"/>
  <origin xyz="0.4 0 0" rpy="0 0.2 0"/><axis xyz="1 0 0"/>{limit}</joint>
<joint name="mount" type="fixed"><parent link="slider"/><child link="flange"/>
  <origin xyz="0.1 0.02 0.03" rpy="0.3 -0.2 0.5"/></joint>{more}</robot>'''


def write_arm(folder: Path, text: str = '', joints: tuple[str, ...] = JOINTS,
              **values: Any) -> Path:
    """Write URDF and model file, and return the latter."""
    (folder / 'made_up.urdf').write_text(text or urdf())
    blocks = ''.join(f'    {key.replace("__", ".")}: {value}\n' for key, value in values.items())
    path = folder / 'arm.yaml'
    locked = ', '.join(f'{name}: 0.0' for name in JOINTS if name not in joints)
    path.write_text('/**:\n  ros__parameters:\n    robot:\n      urdf: made_up.urdf\n'
                    '      base: stand\n      tool: flange\n'
                    f'      drives: [{", ".join(joints)}]\n'
                    + (f'      locked: {{{locked}}}\n' if locked else '') + blocks)
    return path


def real_arm(folder: Path, **changes: Any) -> DriveModel:
    """Return the arm with friction, and with other values."""
    model = DriveModel.load(write_arm(folder))
    real = DriveModel.from_parameters({**model.values, **FRICTION, **changes}, model.source)
    return real


def record(model: DriveModel, moved: JointMotion, noise: float = 0.2, seed: int = 0) -> Recording:
    """Return what a recording of the arm would hold, with white noise of the efforts."""
    forces = model.measured(model.drive_forces(moved))
    random = np.random.default_rng(100 + seed)
    effort: Array = forces.total + noise * random.normal(size=forces.total.shape)
    assert moved.time is not None
    return Recording.from_arrays(f'run{seed}', moved.time, moved.position, moved.velocity, effort,
                                 model.drives)
