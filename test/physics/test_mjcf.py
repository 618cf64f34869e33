# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robots from MJCF: what a file says is in the model or refused by name, as `mj_inverse` judges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.errors import PprsError

mujoco = pytest.importorskip('mujoco')

ARM = '''<mujoco>
  <option gravity="1.5 -2 -9"/>
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body name="column" pos="0.1 0.2 0.3" euler="0.2 -0.1 0.4">
      <joint name="turn" axis="0.1 0.2 1" pos="0.02 0.03 0.01" ref="0.7" range="-2 2.5"
        armature="0.3" damping="1.5" actuatorfrcrange="-40 50"{more}/>
      <inertial pos="0.1 0.05 0.2" mass="2" fullinertia="0.03 0.04 0.05 0.001 0.002 -0.003"/>
      <body name="beam" pos="0.3 0 0.1">
        <joint name="reach" type="slide" axis="1 0.3 0" ref="-0.2" range="-1 1" armature="0.5"
          damping="4" frictionloss="{dry}"/>
        <joint name="swing" axis="0 1 0" ref="0.4" damping="0.2"/>
        <inertial pos="0.2 0.1 0" mass="1.5" diaginertia="0.02 0.03 0.04"/>
        <body name="tool" pos="0.2 0 0"><inertial pos="0 0 0.1" mass="0.4"
          diaginertia="0.001 0.002 0.002"/></body>
      </body>
    </body>
  </worldbody>{end}
</mujoco>'''


def write(folder: Path, text: str, drives: str, tool: str, more: str = '') -> Path:
    (folder / 'robot.xml').write_text(text)
    path = folder / 'robot.yaml'
    path.write_text('/**:\n  ros__parameters:\n    robot: {mjcf: robot.xml, base: world, '
                    f'tool: {tool}, drives: [{drives}]{more}}}\n')
    return path


def arm(folder: Path, dry: float = 0.0, more: str = '', end: str = '') -> Path:
    return write(folder, ARM.format(dry=dry, more=more, end=end), 'turn, reach, swing', 'tool')


@pytest.mark.parametrize('dry', [0.0, 3.0])
def test_an_arm_is_that_of_mj_inverse_with_ref_rotor_friction_and_gravity(
    tmp_path: Path, dry: float,
) -> None:
    model = DriveModel.load(arm(tmp_path, dry))
    engine = mujoco.MjModel.from_xml_path(str(tmp_path / 'robot.xml'))
    engine.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    data = mujoco.MjData(engine)
    q, v, a = np.random.default_rng(1).normal(size=(3, 20, 3))
    v = np.sign(v) * (0.5 + np.abs(v))  # beyond where the sign of a velocity turns over
    found = model.drive_forces(JointMotion(q, v, a)).total
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
        mujoco.mj_inverse(engine, data)
        # The engine's dry friction is a soft constraint: its bound is what slides.
        expected = data.qfrc_inverse + data.qfrc_constraint + np.array([0, dry, 0]) * np.sign(v[k])
        assert found[k] == pytest.approx(expected, abs=1e-9)
    structure = model.robot.structure
    assert structure.lower == pytest.approx([-2, -1, -np.inf])
    assert structure.effort == pytest.approx([40, np.inf, np.inf])


def test_what_the_model_file_says_goes_before_the_description(tmp_path: Path) -> None:
    path = arm(tmp_path, 3.0)
    content = yaml.safe_load(path.read_text())
    content['/**']['ros__parameters']['friction'] = {'viscous': [0.0, 0.0, 0.0]}
    path.write_text(yaml.safe_dump(content))
    values = DriveModel.load(path).values
    assert values['friction.viscous'] == (0.0, 0.0, 0.0)
    assert values['friction.coulomb'] == (0.0, 3.0, 0.0)
    assert values['robot.armature'] == (0.3, 0.5, 0.0)
    assert values['robot.gravity'] == pytest.approx((1.5, -2.0, -9.0))


LOOP = '''<mujoco><compiler angle="radian"/><option gravity="0 -9.81 0"/><worldbody>
  <body name="crank" pos="0 0 0"><joint name="a" axis="0 0 1" ref="{ref}"/>
    <inertial pos="0.05 0 0" mass="0.5" diaginertia="0.001 0.002 0.003"/>
    <body name="rod" pos="0.1 0 0"><joint name="b" axis="0 0 1" damping="0.05"/>
      <inertial pos="0.1 0.02 0" mass="0.3" diaginertia="0.001 0.002 0.002"/></body></body>
  <body name="rocker" pos="0.3 -0.1 0"><joint name="c" axis="0 0 1" frictionloss="0"/>
    <inertial pos="0 0.05 0" mass="0.4" diaginertia="0.001 0.002 0.003"/>
    <body name="pin" pos="0 0.1 0"><joint name="d" axis="0 0 1"/>
      <inertial pos="0.01 0 0" mass="0.1" diaginertia="0.001 0.002 0.003"/></body></body>
  </worldbody><equality>
    <weld name="tip" body1="rod" body2="pin" anchor="{anchor}"/></equality></mujoco>'''


@pytest.mark.parametrize('anchor', ['0 0 0', '0.03 -0.02 0'])
def test_a_weld_closes_at_its_anchor_and_passive_joints_rub(tmp_path: Path, anchor: str) -> None:
    model = DriveModel.load(write(tmp_path, LOOP.format(ref=0.3, anchor=anchor), 'a', 'rod'))
    engine = mujoco.MjModel.from_xml_path(str(tmp_path / 'robot.xml'))
    engine.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(engine)
    q = np.linspace(0.1, 0.6, 7)[:, None]
    v, a = np.random.default_rng(0).normal(size=(2, 7, 1))
    motion = JointMotion(q, v, a)
    found, m = model.drive_forces(motion).total, model.mechanism(motion).links.motion
    s = model.robot.structure
    order = [s.tables.coordinate[s.rows[name]] for name in 'abcd']
    assert s.home[order[0]] == pytest.approx(0.3)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:] = m.q[k, order], m.v[k, order]
        mujoco.mj_forward(engine, data)
        assert np.max(np.abs(data.efc_pos)) < 1e-9
        data.qacc[:] = m.a[k, order]
        constraint = data.efc_J.reshape(-1, 4).copy()
        engine.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        mujoco.mj_inverse(engine, data)
        engine.opt.disableflags = 0
        columns = np.column_stack((np.eye(4)[:, :1], constraint.T))
        expected = np.linalg.lstsq(columns, data.qfrc_inverse, rcond=1e-9)[0][0]
        assert found[k, 0] == pytest.approx(expected, abs=1e-9)
    assert 'friction.joints.b.viscous' in model.values


def test_a_coupling_counts_from_where_bodies_are_placed(tmp_path: Path) -> None:
    text = '''<mujoco><compiler angle="radian"/><worldbody>
      <body name="one"><joint name="a" axis="0 0 1" ref="0.5"/><inertial pos="0.1 0 0" mass="1"
        diaginertia="0.1 0.1 0.1"/></body>
      <body name="two" pos="0 1 0"><joint name="b" axis="0 1 0" ref="-0.2"/><inertial
        pos="0.2 0 0" mass="2" diaginertia="0.1 0.1 0.1"/></body></worldbody>
      <equality><joint joint1="b" joint2="a" polycoef="0.1 3 0 0 0"/></equality></mujoco>'''
    model = DriveModel.load(write(tmp_path, text, 'a', 'one'))
    q = np.array([[0.3]])
    state = model.mechanism(JointMotion(q, 0 * q, 0 * q)).links.motion
    s = model.robot.structure
    row = s.rows['b']
    angle = s.tables.ratio[row] * state.q[0, s.tables.coordinate[row]] + s.tables.offset[row]
    engine = mujoco.MjModel.from_xml_path(str(tmp_path / 'robot.xml'))
    data = mujoco.MjData(engine)
    data.qpos[:] = q[0, 0], angle
    mujoco.mj_forward(engine, data)
    assert abs(data.efc_pos[0]) < 1e-12
    assert state.R[0, row] == pytest.approx(data.body('two').xmat.reshape(3, 3), abs=1e-12)


@pytest.mark.parametrize(('more', 'end', 'told'), [
    (' stiffness="7" springref="0.2"', '', 'drive_spring: {turn: {stiffness: 7, position: 0.2}}'),
    ('', '<tendon><fixed name="cord"><joint joint="turn" coef="1"/></fixed></tendon>', 'tendons'),
    ('', '<option density="1.2"/>', 'density 1.2')])
def test_what_a_mechanism_cannot_have_is_refused_by_name(
    tmp_path: Path, more: str, end: str, told: str,
) -> None:
    with pytest.raises(PprsError) as error:
        DriveModel.load(arm(tmp_path, more=more, end=end))
    assert told in str(error.value)
    assert '\n' not in str(error.value)


def test_a_body_that_does_not_weigh_what_it_weighs_is_refused(tmp_path: Path) -> None:
    text = ARM.format(dry=0, more='', end='').replace('<body name="beam"',
                                                      '<body name="beam" gravcomp="1"')
    with pytest.raises(PprsError, match=r'beam.*gravcomp'):
        DriveModel.load(write(tmp_path, text, 'turn, reach, swing', 'tool'))
