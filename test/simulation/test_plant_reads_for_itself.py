# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated robot has MuJoCo's own reading of a description: it exposes faults of ours."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import robots_with_loops as robots

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import ModelError
from pprs_dynamics.simulation.engine import MechanismEngine

BODY = ('<inertial><origin xyz="0.2 0.02 0.1"/><mass value="{}"/><inertia ixx="0.03" iyy="0.04" '
        'izz="0.02" ixy="0.001" ixz="0.002" iyz="-0.001"/></inertial>')
ROTOR = ('<inertial><mass value="0"/><inertia ixx="0" iyy="2e-4" izz="0" ixy="0" ixz="0" iyz="0"/>'
         '</inertial>')
MJCF = '''<mujoco><option gravity="1 2 -9"/><worldbody><body name="plate" euler="40 20 0">
  <body name="l1" pos="0.1 0 0.2"><joint name="j1" axis="0 1 0" pos="0.1 0.05 0" ref="0.4"/>
  <joint name="j2" type="slide" axis="1 0 0"/><inertial pos="0.1 0 0.1" mass="2"
  diaginertia="0.02 0.03 0.04"/><body name="l2" pos="0.3 0 0"><joint name="j3" axis="0 0 1"/>
  <inertial pos="0.1 0.1 0" mass="1" diaginertia="0.02 0.03 0.04"/></body></body></body></worldbody>
  <equality><joint joint1="j3" joint2="j1" polycoef="0.2 -2 0 0 0"/></equality></mujoco>'''


def described(folder: Path) -> Path:
    """Write an arm that hangs on a ceiling, with a gear's rotor, a gripper and a coupled joint."""
    def joint(name: str, kind: str, parent: str, child: str, more: str = '') -> str:
        return (f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child '
                f'link="{child}"/><origin xyz="0.1 0 0.3" rpy="0.2 0.1 0"/><axis xyz="0 1 0"/>'
                f'{more}</joint>')

    limit = '<limit lower="{}" upper="{}" effort="1" velocity="1"/>'
    (folder / 'robot.urdf').write_text(
        '<robot name="r"><link name="world"/><joint name="mount" type="fixed"><parent '
        'link="world"/><child link="plate"/><origin rpy="3 0.2 0"/></joint><link name="plate"/>'
        + joint('j1', 'revolute', 'plate', 'l1', limit.format(-2, 2))
        + f'<link name="l1">{BODY.format(2)}</link>'
        + joint('motor', 'continuous', 'plate', 'rotor', '<mimic joint="j1" multiplier="50"/>')
        + f'<link name="rotor">{ROTOR}</link>'
        + joint('slide', 'prismatic', 'l1', 'l2', limit.format(0.5, 0.9))
        + f'<link name="l2">{BODY.format(1)}</link>'
        + joint('jaw', 'revolute', 'l2', 'l3', limit.format(-2, 2)
                + '<mimic joint="slide" multiplier="-1" offset="1.5"/>')
        + f'<link name="l3">{BODY.format(1.5)}</link></robot>')
    path = folder / 'robot.yaml'
    path.write_text('/**:\n  ros__parameters:\n    robot: {urdf: robot.urdf, base: plate, '
                    'tool: l3, drives: [j1], locked: {slide: 0.5}}\n')
    return path


def test_plant_and_model_agree(tmp_path: Path) -> None:
    MechanismEngine(DriveModel.load(described(tmp_path)))
    for robot in (robots.hexapod, robots.delta, robots.five_bar):
        MechanismEngine(DriveModel.load(robot().write(tmp_path)))
    (tmp_path / 'robot.xml').write_text(MJCF)
    path = tmp_path / 'mjcf.yaml'
    path.write_text('/**:\n  ros__parameters:\n    robot: {mjcf: robot.xml, base: plate, tool: l2, '
                    'drives: [j1, j2]}\n')
    MechanismEngine(DriveModel.load(path))


@pytest.mark.parametrize(('read', 'stands'), [
    ('mass value="2"', 'mass value="2.5"'), ('offset="1.5"', 'offset="0"'),
    ('rpy="3 0.2 0"', 'rpy="0 0.2 0"')], ids=['mass', 'follower', 'gravity'])
def test_another_reading_of_the_description_is_refused(
    tmp_path: Path, read: str, stands: str,
) -> None:
    path = described(tmp_path)
    model, urdf = DriveModel.load(path), tmp_path / 'robot.urdf'
    assert read in urdf.read_text()
    urdf.write_text(urdf.read_text().replace(read, stands))
    with pytest.raises(ModelError, match='in MuJoCo'):
        MechanismEngine(model)


def test_a_loop_that_is_open_in_mujoco_is_refused(tmp_path: Path) -> None:
    model = DriveModel.load(robots.hexapod().write(tmp_path))
    urdf = Path(model.robot.structure.description.path)
    tree = ElementTree.parse(urdf)
    origin = tree.find('joint[@name="leg_1"]/origin')
    assert origin is not None
    origin.set('xyz', '0.01 0 0')
    tree.write(urdf)
    with pytest.raises(ModelError, match='in MuJoCo'):
        MechanismEngine(model)
