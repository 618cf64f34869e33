# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Descriptions as they are in circulation, against Pinocchio and MuJoCo."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.errors import PprsError, UnreadableFileError
from pprs_dynamics.physics.effects.catalogue import find_effect
from pprs_dynamics.physics.mechanism.description import Description
from pprs_dynamics.physics.mechanism.mjcf import read_mjcf
from pprs_dynamics.physics.mechanism.urdf import read_urdf

pinocchio = pytest.importorskip('pinocchio')
pytest.importorskip('mujoco')


STEP = 1e-5  # of a parameter; inertia is quadratic in the place of a mass
LIMIT = '<limit lower="-3" upper="3" effort="10" velocity="2"/>'
BODY = ('<inertial pos="0.1 0.02 0.03" mass="1" '
        'fullinertia="0.03 0.04 0.05 0.001 0.002 -0.003"/>')


def link(name: str, mass: float = 1.0, centre: str = '0.2 0.02 0.1') -> str:
    return (f'<link name="{name}"><inertial><origin xyz="{centre}" rpy="0.1 0.2 0.3"/>'
            f'<mass value="{mass}"/><inertia ixx="0.03" iyy="0.04" izz="0.02" ixy="0.001" '
            'ixz="0.002" iyz="-0.001"/></inertial></link>')


def joint(name: str, parent: str, child: str, axis: str = '0 1 0', kind: str = 'revolute',
          more: str = '', limit: str = LIMIT) -> str:
    return (f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0.3 0.1 0.2" rpy="0.3 0.1 0.2"/><axis xyz="{axis}"/>{limit}{more}'
            '</joint>')


def load(folder: Path, urdf: str, block: str) -> DriveModel:
    (folder / 'robot.urdf').write_text(f'<robot name="robot">{urdf}</robot>')
    return _load(folder, 'robot.urdf', block)


def load_mjcf(folder: Path, mjcf: str, block: str) -> DriveModel:
    (folder / 'robot.xml').write_text(f'<mujoco>{mjcf}</mujoco>')
    return _load(folder, 'robot.xml', block)


def _load(folder: Path, name: str, block: str) -> DriveModel:
    kind = 'urdf' if name.endswith('urdf') else 'mjcf'
    path = folder / 'robot.yaml'
    path.write_text('/**:\n  ros__parameters:\n    '
                    + block.replace('{', f'{{{kind}: {name}, ', 1) + '\n')
    model = DriveModel.load(path)
    return model


def efforts(model: DriveModel, *motion: Any) -> Any:
    return model.drive_forces(JointMotion(*(np.atleast_2d(values) for values in motion))).total


def rnea(folder: Path, q: Any, v: Any, a: Any) -> Any:
    """Return the efforts of all joints of the URDF, by Pinocchio."""
    model = pinocchio.buildModelFromUrdf(str(folder / 'robot.urdf'))
    return pinocchio.rnea(model, model.createData(), *(np.array(row, float) for row in (q, v, a)))


def random_motion(drives: int) -> Any:
    return np.random.default_rng(drives).normal(size=(3, drives))


def test_a_body_without_mass_has_all_ten_columns(tmp_path: Path) -> None:
    model = load(tmp_path, '<link name="base"/>' + joint('j1', 'base', 'l1', '0 0 1') + link('l1')
                 + joint('j2', 'l1', 'l2') + link('l2') + '<link name="flange"/>'
                 + joint('turn', 'l2', 'flange', '1 0 0', more='<mimic joint="j2"/>'),
                 'robot: {base: base, tool: flange, drives: [j1, j2]}')
    rng = np.random.default_rng(0)
    state = model.mechanism(JointMotion(*rng.normal(size=(3, 50, 2))))
    effect = model.bound(find_effect('payload_mass'))
    body = {'mass': 1.0}
    for coefficient in effect.coefficients:
        alone = effect.at({coefficient.name: STEP}).force(state)
        both = {**body, coefficient.name: body.get(coefficient.name, 0.0) + STEP}
        added = effect.at(both).force(state) - effect.at(body).force(state)
        assert np.abs(added).max() > STEP / 10, coefficient.name
        assert alone == pytest.approx(added, abs=1e-3 * STEP), coefficient.name


def test_a_rotor_without_mass_on_a_gear_has_its_inertia(tmp_path: Path) -> None:
    rotor = ('<link name="rotor"><inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="2e-6" '
             'ixy="0" ixz="0" iyz="0"/></inertial></link>')
    model = load(tmp_path, '<link name="base"/>' + joint('j1', 'base', 'l1', '0 0 1') + link('l1')
                 + rotor + joint('motor', 'base', 'rotor', '0 0 1', 'continuous',
                                 '<mimic joint="j1" multiplier="100"/>', ''),
                 'robot: {base: base, tool: l1, drives: [j1]}')
    q, v, a = random_motion(1)
    gear = np.array([1.0, 100.0])
    found = pinocchio.buildModelFromUrdf(str(tmp_path / 'robot.urdf'))
    assert list(found.names[1:]) == ['j1', 'motor']
    # The rotor turns continuously: Pinocchio takes cosine and sine.
    place = [q[0], np.cos(100 * q[0]), np.sin(100 * q[0])]
    expected = gear @ rnea(tmp_path, place, gear * v[0], gear * a[0])
    assert efforts(model, q, v, a)[0, 0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(('more', 'kind', 'own', 'at'), [
    ('<mimic joint="leader" multiplier="-1" offset="1.2"/>', 'revolute', '', 1.0),
    ('<mimic joint="leader" multiplier="-1" offset="0.2"/>', 'prismatic', '', 0.0),
    ('', 'prismatic', ', locked: 0.5', 0.5)])
def test_a_locked_joint_is_where_the_file_says_and_its_followers_with_it(
    tmp_path: Path, more: str, kind: str, own: str, at: float,
) -> None:
    model = load(tmp_path, '<link name="base"/>' + joint('j1', 'base', 'l1') + link('l1')
                 + joint('leader', 'l1', 'l2', '1 0 1') + link('l2')
                 + joint('locked', 'l2', 'l3', '0 1 1', kind, more) + link('l3'),
                 f'robot: {{base: base, tool: l3, drives: [j1], locked: {{leader: 0.2{own}}}}}')
    q, v, a = random_motion(1)
    expected = rnea(tmp_path, [q[0], 0.2, at], [v[0], 0, 0], [a[0], 0, 0])
    assert efforts(model, q, v, a)[0, 0] == pytest.approx(expected[0], rel=1e-9)
    assert model.robot.structure.locked == pytest.approx({'leader': 0.2, 'locked': at})


@pytest.mark.parametrize(('lower', 'upper', 'at'), [
    (0.5, 0.9, 0.5), (-3.0, 3.0, 0.0)])
def test_without_loops_a_joint_without_a_drive_is_locked_within_its_limits(
    tmp_path: Path, lower: float, upper: float, at: float,
) -> None:
    limit = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'
    model = load(tmp_path, '<link name="base"/>' + joint('j1', 'base', 'l1') + link('l1')
                 + joint('slide', 'l1', 'l2', '1 0 1', 'prismatic', '', limit) + link('l2'),
                 'robot: {base: base, tool: l2, drives: [j1]}')
    q, v, a = random_motion(1)
    expected = rnea(tmp_path, [q[0], at], [v[0], 0], [a[0], 0])
    assert efforts(model, q, v, a)[0, 0] == pytest.approx(expected[0], rel=1e-9)
    assert model.robot.structure.locked == {'slide': at}


@pytest.mark.parametrize('base', ['world', 'plate'])
@pytest.mark.parametrize('angle', ['3.141592653589793 0 0', '0.4 1.2 0.3'])
def test_gravity_is_in_the_frame_of_the_root(tmp_path: Path, base: str, angle: str) -> None:
    model = load(
        tmp_path, '<link name="world"/><link name="plate"/><joint name="mount" type="fixed">'
        '<parent link="world"/><child link="plate"/>'
        f'<origin xyz="0 0 2" rpy="{angle}"/></joint>'
        + joint('j1', 'plate', 'l1') + link('l1'),
        f'robot: {{base: {base}, tool: l1, drives: [j1]}}')
    q, v, a = random_motion(1)
    assert efforts(model, q, v, a)[0] == pytest.approx(rnea(tmp_path, q, v, a), rel=1e-9)


def test_a_continuous_joint_can_be_a_drive(tmp_path: Path) -> None:
    model = load(tmp_path, '<link name="base"/>' + joint('j1', 'base', 'l1', kind='continuous',
                                                         limit='<limit effort="39" velocity="2"/>')
                 + link('l1'), 'robot: {base: base, tool: l1, drives: [j1]}')
    q, v, a = random_motion(1)
    expected = rnea(tmp_path, [np.cos(q[0]), np.sin(q[0])], v, a)
    assert efforts(model, q, v, a)[0] == pytest.approx(expected, rel=1e-9)
    structure = model.robot.structure
    assert model.robot.turning == ('j1',)
    assert (structure.lower[0], structure.upper[0]) == (-np.inf, np.inf)
    assert (structure.effort[0], structure.speed[0]) == (39, 2)


THREE = (f'<worldbody><body name="t0"><joint name="a" axis="0 1 0"/>{BODY}'
         f'<body name="t" pos="0.3 0 0"><joint name="b" axis="0 0 1"/>{BODY}'
         f'<body name="u" pos="0.3 0 0"><joint name="c" axis="0 0 1"/>{BODY}</body></body></body>'
         '</worldbody>')


@pytest.mark.parametrize(('equalities', 'words'), [
    ('<joint joint1="b" joint2="c"/><joint joint1="c" joint2="b"/>', 'b, c'),
    ('<joint joint1="b" joint2="b"/>', 'b'),
    ('<joint name="x" joint1="c" joint2="a"/><joint name="y" joint1="c" joint2="b"/>', 'x.*y')])
def test_joints_of_mjcf_that_follow_one_another_or_two_are_refused(
    tmp_path: Path, equalities: str, words: str,
) -> None:
    with pytest.raises(PprsError, match=words):
        load_mjcf(tmp_path, f'{THREE}<equality>{equalities}</equality>',
                  'robot: {base: world, tool: u, drives: [a]}')


def test_motors_have_the_effort_that_their_control_allows(tmp_path: Path) -> None:
    motors = ('<actuator><motor joint="a" gear="50" ctrlrange="-1 2"/>'
              '<general joint="b" gear="5" gainprm="3" ctrlrange="-2 2" forcerange="-4 4"/>'
              '<position name="servo" joint="c" kp="100" kv="10" ctrlrange="-3 3"/></actuator>')
    model = load_mjcf(tmp_path, THREE + motors, 'robot: {base: world, tool: u, drives: [a, b, c]}')
    assert model.robot.structure.effort == pytest.approx([50, 20, np.inf])
    remarks = model.robot.structure.description.remarks
    assert any('servo' in remark and 'controller' in remark for remark in remarks)


@pytest.mark.parametrize(('flag', 'lost'), [
    ('damper', {'damping'}), ('frictionloss', {'dry'}), ('spring', {'spring'}),
    ('equality', {'mimic'}), ('constraint', {'dry', 'mimic'}), ('contact', set())])
def test_what_a_flag_of_mjcf_disables_is_not_in_the_model(tmp_path: Path, flag: str,
                                                          lost: set[str]) -> None:
    (tmp_path / 'r.xml').write_text(
        f'<mujoco><option><flag {flag}="disable"/></option>'
        + THREE.replace('name="b"', 'name="b" damping="2" frictionloss="3" stiffness="4"')
        + '<equality><joint joint1="c" joint2="a"/></equality></mujoco>')
    joints = read_mjcf(str(tmp_path / 'r.xml')).joints
    present = {name for name in ('damping', 'dry', 'spring') if getattr(joints['b'], name)}
    present |= {'mimic'} if joints['c'].mimic else set()
    assert present == {'damping', 'dry', 'spring', 'mimic'} - lost


def test_masses_and_joints_suffice_where_mesh_files_are_missing(tmp_path: Path) -> None:
    shape = '<geom type="mesh" mesh="shell" pos="0.1 0 0"/>'
    assets = ('<compiler meshdir="elsewhere" texturedir="elsewhere"/><asset>'
              '<mesh name="shell" file="shell.stl"/><texture name="t" type="2d" file="t.png"/>'
              '<material name="m" texture="t"/></asset>')
    block = 'robot: {base: world, tool: u, drives: [a, b, c]}'
    motion = random_motion(3)
    plain = efforts(load_mjcf(tmp_path, THREE, block), *motion)
    shaped = efforts(load_mjcf(tmp_path, assets + THREE.replace(BODY, BODY + shape), block),
                     *motion)
    assert shaped == pytest.approx(plain, rel=1e-12)
    with pytest.raises(PprsError, match=r'shell\.stl.*t0, t, u have no'):
        load_mjcf(tmp_path, assets + THREE.replace(BODY, shape), block)


# What URDFs hold beside a tree: gears, xacro, packages, and bodies that cannot be.

INERTIA = '<inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/>'


def one_link(folder: Path, inertia: tuple[float, float, float], more: str = '') -> Description:
    """Return a robot of 0.4 m with a body of 5 kg."""
    path = folder / 'one.urdf'
    path.write_text(f'''<robot name="one"><link name="base"/><link name="upper"><inertial>
      <origin xyz="0.2 0 0"/><mass value="5"/>{INERTIA.format(*inertia)}</inertial></link>
      <joint name="turn" type="revolute"><parent link="base"/><child link="upper"/>
      <origin xyz="0 0 0.2"/><axis xyz="0 0 1"/></joint>{more}</robot>''')
    return read_urdf(str(path))


def test_bodies_that_cannot_be_are_told_and_those_that_can_are_not(tmp_path: Path) -> None:
    assert one_link(tmp_path, (0.01, 0.08, 0.08)).faults == ()
    assert one_link(tmp_path, (0.0, 0.08, 0.0801)).faults == ()  # a thin rod, rounded
    (triangle,) = one_link(tmp_path, (0.005, 0.03, 0.08)).faults
    assert 'upper is no body: its principal moments of inertia are 0.005, 0.03, 0.08' in triangle
    (millimetres,) = one_link(tmp_path, (1e4, 8e4, 8e4)).faults
    assert 'upper has 8e+04 kg m^2 in 5 kg' in millimetres
    assert '126 m in a robot that reaches 0.4 m' in millimetres
    assert '0.08 kg m^2' in millimetres
    slide = ('<link name="carriage"/><joint name="slide" type="prismatic"><parent link="upper"/>'
             '<child link="carriage"/><limit lower="0" upper="4" effort="9" velocity="1"/></joint>')
    assert one_link(tmp_path, (1.0, 80.0, 80.0)).faults
    assert one_link(tmp_path, (1.0, 80.0, 80.0), slide).faults == ()


def test_loops_that_only_a_model_file_can_have_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFileError, match=r'"hinge".* under robot.loops'):
        one_link(tmp_path, (0.01, 0.08, 0.08), '<constraint name="hinge" type="revolute"/>')


def gear(tag: str, kind: str, side: str, number: str) -> str:
    inside = f'<{tag}>{number}</{tag}>'
    return (f'<transmission name="t"><{kind}>transmission_interface/SimpleTransmission</{kind}>'
            f'<joint name="swing">{inside if side == "joint" else ""}</joint>'
            f'<actuator name="m">{inside if side == "actuator" else ""}</actuator></transmission>')


@pytest.mark.parametrize(('tag', 'kind', 'side'), [
    ('mechanicalReduction', 'type', 'actuator'), ('mechanical_reduction', 'plugin', 'joint')])
def test_reductions_are_gear_ratios_unless_the_model_file_has_some(
    tmp_path: Path, tag: str, kind: str, side: str,
) -> None:
    text = arm.urdf(more=gear(tag, kind, side, '-50'))
    model = DriveModel.load(arm.write_arm(tmp_path, text))
    assert model.gear_ratios[model.drives.index('swing')] == 50
    assert sorted(model.gear_ratios) == [1, 1, 50]
    path = arm.write_arm(tmp_path, text)
    path.write_text(path.read_text() + '      gear_ratio: [2.0, 3.0, 4.0]\n')
    assert DriveModel.load(path).gear_ratios == (2.0, 3.0, 4.0)


def test_a_description_is_found_in_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    def place(folder: Path) -> None:
        (folder / 'urdf').mkdir(parents=True)
        (folder / 'urdf' / 'arm.urdf').write_text(arm.urdf())

    for variable in ('AMENT_PREFIX_PATH', 'ROS_PACKAGE_PATH'):
        monkeypatch.delenv(variable, raising=False)
    path = arm.write_arm(tmp_path)
    path.write_text(path.read_text().replace('made_up.urdf', 'package://my_arm/urdf/arm.urdf'))
    with pytest.raises(PprsError, match=r'package my_arm is in none of AMENT_PREFIX_PATH'):
        DriveModel.load(path)
    install = tmp_path / 'ws' / 'install'
    place(install / 'share' / 'my_arm')
    (install / 'share/ament_index/resource_index/packages').mkdir(parents=True)
    (install / 'share/ament_index/resource_index/packages/my_arm').touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{install}')
    assert DriveModel.load(path).values['robot.urdf'] == str(install / 'share/my_arm/urdf/arm.urdf')
    monkeypatch.delenv('AMENT_PREFIX_PATH')
    source = tmp_path / 'src' / 'arms' / 'another_name'
    place(source)
    (source / 'package.xml').write_text('<package><name>my_arm</name></package>')
    monkeypatch.setenv('ROS_PACKAGE_PATH', str(source))
    assert DriveModel.load(path).values['robot.urdf'] == str(source / 'urdf/arm.urdf')
    monkeypatch.delenv('ROS_PACKAGE_PATH')
    place(tmp_path / 'my_arm')
    assert DriveModel.load(path).values['robot.urdf'] == str(tmp_path / 'my_arm/urdf/arm.urdf')
