# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Arms whose axes are all parallel: what their recordings cannot tell."""

from __future__ import annotations

from pathlib import Path

from pprs_dynamics.physics.model.drive_model import DriveModel

LINK = '''<link name="{name}"><inertial><origin xyz="0 0 -0.25"/><mass value="0.6"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j{number}" type="revolute"><parent link="{parent}"/><child link="{name}"/>
<origin xyz="0 0 {at}"/><axis xyz="0 1 0"/><limit lower="-20" upper="20" effort="80"
velocity="30"/></joint>'''


def planar_arm(folder: Path, joints: int) -> DriveModel:
    """Return an arm whose axes are all parallel; its tool frame is on the last of them."""
    names = ['base', *(f'rod_{k}' for k in range(1, joints + 1))]
    links = ''.join(LINK.format(name=names[k], number=k, parent=names[k - 1],
                                at=0 if k == 1 else -0.5) for k in range(1, joints + 1))
    (folder / 'arm.urdf').write_text(f'<robot name="arm"><link name="base"/>{links}</robot>')
    listed = ', '.join(f'j{k}' for k in range(1, joints + 1))
    (folder / 'arm.yaml').write_text(f'''/**:
  ros__parameters:
    robot: {{urdf: arm.urdf, base: base, tool: {names[-1]}, drives: [{listed}]}}
    friction:
      viscous: [{", ".join(["0.1"] * joints)}]
      coulomb: [{", ".join(["0.3"] * joints)}]
      reversal_velocity: 0.01
''')
    return DriveModel.load(folder / 'arm.yaml')
