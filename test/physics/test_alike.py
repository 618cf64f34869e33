# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Links and joints that no motion tells apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.physics.effects.laws.joint_friction import JointFrictionEffect
from pprs_dynamics.physics.mechanism.alike import alike_bodies, proportional_joints

# A parallelogram in the vertical plane, and a pointer on its coupler: crank and follower turn
# alike about parallel pins, the coupler only translates.
LINK = ('<link name="{0}"><inertial><origin xyz="{1} 0 {2}"/><mass value="{3}"/><inertia '
        'ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>')
JOINT = ('<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin '
         'xyz="{3} 0 {4}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="50" '
         'velocity="5"/></joint>')
PARALLELOGRAM = '\n'.join([
    '<robot name="parallelogram"><link name="base"/>',
    LINK.format('crank', 0.01, 0.1, 1.0), JOINT.format('crank_pin', 'base', 'crank', 0, 0),
    LINK.format('coupler', 0.2, 0, 0.5), JOINT.format('knee', 'crank', 'coupler', 0, 0.3),
    LINK.format('follower', 0, -0.2, 0.7), JOINT.format('ankle', 'coupler', 'follower', 0.4, 0),
    LINK.format('pointer', 0, 0.1, 0.3), JOINT.format('pivot', 'coupler', 'pointer', 0.5, 0),
    '</robot>'])
MODEL = """
/**:
  ros__parameters:
    robot:
      urdf: parallelogram.urdf
      base: base
      tool: pointer
      drives: [crank_pin, pivot]
      loops:
        rear:
          type: revolute
          a: {link: follower, xyz: [0.0, 0.0, -0.3], rpy: [-1.5707963267949, 0.0, 0.0]}
          b: {link: base, xyz: [0.4, 0.0, 0.0], rpy: [-1.5707963267949, 0.0, 0.0]}
    friction: {viscous: [0.1, 0.1], coulomb: [0.2, 0.2], reversal_velocity: 0.01}
"""


@pytest.fixture(scope='module')
def parallelogram(tmp_path_factory: pytest.TempPathFactory) -> DriveModel:
    """Return its model."""
    folder: Path = tmp_path_factory.mktemp('parallelogram')
    (folder / 'parallelogram.urdf').write_text(PARALLELOGRAM)
    file = folder / 'model.yaml'
    file.write_text(MODEL)
    return DriveModel.load(file)


def test_links_that_turn_alike_are_grouped_and_no_others(parallelogram: DriveModel) -> None:
    robot = parallelogram.robot
    names = [tuple(robot.body_names[k] for k in group) for group in alike_bodies(robot)]
    assert names == [('crank', 'follower'), ('coupler',), ('pointer',)]


def test_a_body_on_one_of_them_is_a_body_on_the_other(parallelogram: DriveModel) -> None:
    """At the same place relative to the pin that stands, whatever the motion."""
    rng = np.random.default_rng(3)
    q, v, a = rng.uniform(-0.5, 0.5, (3, 30, 2))
    body = np.array([0.4, 0.02, 0.0, 0.1, 0.03, 0.0, 0.03, 0.0, 0.0, 0.001])
    # The follower's origin is 0.3 m above its pin: m, m c and I about the pin, moved there.
    m, c, h = body[0], body[1:4] / body[0], 0.3
    shifted = c - [0, 0, h]
    inertia = np.array([[body[4], body[5], body[7]], [body[5], body[6], body[8]],
                        [body[7], body[8], body[9]]])
    about = inertia - m * ((c @ c) * np.eye(3) - np.outer(c, c))
    there = about + m * ((shifted @ shifted) * np.eye(3) - np.outer(shifted, shifted))
    same = np.array([m, *(m * shifted), there[0, 0], there[0, 1], there[1, 1], there[0, 2],
                     there[1, 2], there[2, 2]])
    robot = parallelogram.robot
    on_crank, on_follower = (robot.with_body(link, what).torques(q, v, a)
                             for link, what in (('crank', body), ('follower', same)))
    assert on_crank == pytest.approx(on_follower, abs=1e-9)
    assert np.abs(on_crank - robot.torques(q, v, a)).max() > 0.1


def test_friction_that_turns_with_a_drive_is_left_to_the_drive(
    parallelogram: DriveModel,
) -> None:
    groups = proportional_joints(parallelogram.robot.structure)
    assert groups == (('crank_pin', 'knee', 'ankle'), ('pivot',))
    offered = {names[0] for names in parallelogram.bound(JointFrictionEffect).variants}
    assert not offered & {'knee.viscous', 'ankle.torque'}
    assert 'rear.viscous' in offered  # loops are not looked at
    motion = JointMotion(*np.random.default_rng(1).uniform(-0.5, 0.5, (3, 20, 2)))
    knee = JointFrictionEffect.bound(parallelogram.robot).from_file({'knee.viscous': 0.3})
    forces = knee.force(parallelogram.mechanism(motion))
    assert forces[:, 0] == pytest.approx(0.3 * motion.velocity[:, 0], abs=1e-9)
