# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What URDFs hold beside a tree: gears, xacro, packages, and bodies that cannot be."""

from __future__ import annotations

from pathlib import Path

import made_up_arm as arm
import pytest

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import PprsError, UnreadableFileError
from pprs_dynamics.physics.mechanism.description import Description
from pprs_dynamics.physics.mechanism.urdf import read_urdf

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


def test_loops_that_only_a_model_file_can_have_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFileError, match=r'"hinge".* under robot.loops'):
        one_link(tmp_path, (0.01, 0.08, 0.08), '<constraint name="hinge" type="revolute"/>')


XACRO = '''<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:property name="m" value="3"/><link name="x"><inertial><mass value="${2*m}"/></inertial>
</link></robot>'''


def test_the_real_xacro_is_run_as_such(tmp_path: Path) -> None:
    pytest.importorskip('xacro')
    path = tmp_path / 'robot.urdf.xacro'
    path.write_text(XACRO)
    assert read_urdf(str(path)).links['x'][0] == 6


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
