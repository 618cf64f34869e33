# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Arms and robots with loops in motion under the efforts of their drives, in simulated time."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from itertools import pairwise
from pathlib import Path

import made_up_arm
import numpy as np
import pytest
import robots_with_loops as robots

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.errors import ModelError
from pprs_dynamics.simulation.drive_control import Setpoint
from pprs_dynamics.simulation.engine import MechanismEngine
from pprs_dynamics.simulation.injected_forms import InjectedEffectError
from pprs_dynamics.simulation.injection import draw_motion
from pprs_dynamics.simulation.plant import Plant
from pprs_dynamics.simulation.platform import as_mechanism
from pprs_dynamics.simulation.simulated_robot import SensorSettings, SimulatedRobot

QUIET = SensorSettings(effort_noise=0.0)
TICK = 0.002


def models(tmp_path: Path) -> dict[str, DriveModel]:
    """Return the example robots with friction in every joint, and an arm."""
    return {'platform': as_mechanism(DriveModel.load('config/paper.yaml')),
            'hexapod': DriveModel.load('config/hexapod.yaml'),
            'delta': DriveModel.load('config/delta.yaml'),
            'arm': DriveModel.load(made_up_arm.write_arm(tmp_path, **{
                key.replace('.', '__'): list(value)
                for key, value in made_up_arm.FRICTION.items()}))}


@pytest.mark.parametrize('name', ['platform', 'hexapod', 'delta', 'arm'])
def test_the_model_needs_the_efforts_under_which_the_plant_accelerates(
    tmp_path: Path, name: str,
) -> None:
    model = models(tmp_path)[name]
    plant = Plant(model)
    rng, count = np.random.default_rng(3), len(plant.position)
    scale = np.array([0.1 if unit.turns else 0.02 for unit in model.units])
    q, v = plant.position + scale * rng.uniform(-1, 1, count), scale * rng.normal(size=count)
    effort = plant.largest * rng.uniform(-1, 1, count)
    # Loads of friction are those of the acceleration before: they settle.
    for _ in range(5):
        plant.last_acceleration = plant.acceleration(q, v, effort, v, 0.0)
    needed = model.drive_forces(JointMotion(
        q[None], v[None], plant.last_acceleration[None])).total[0]
    assert needed == pytest.approx(effort, abs=1e-5 * plant.largest.max())


@pytest.mark.parametrize('name', ['platform', 'hexapod', 'delta', 'arm'])
def test_it_follows_with_the_feedforward_and_applies_what_the_model_says(
    tmp_path: Path, name: str,
) -> None:
    model = models(tmp_path)[name]
    motion = draw_motion(model, 8.0, 1, 1 / TICK)[:500]
    forces = model.drive_forces(motion).total
    plant = Plant(model)
    robot = SimulatedRobot(plant, rate=1 / TICK, control=plant.gains(7.0, 0.9), sensors=QUIET)
    points = [Setpoint(*each) for each in zip(motion.position, motion.velocity, forces,
                                              strict=True)]
    measured = []
    for now, following in pairwise(points):
        assert robot.command(now, following)
        measured.append(robot.tick())
    error = np.array([each.position for each in measured]) - motion.position[:-1]
    assert np.abs(error).max() < 1e-3 * np.ptp(motion.position, axis=0).max()
    missed = np.array([each.effort for each in measured]) - forces[:-1]
    assert np.sqrt(np.mean(missed ** 2)) < 0.01 * plant.largest.max()
    assert not robot.notes


def test_the_loop_of_the_drives_is_stable(tmp_path: Path) -> None:
    """After a jump of the setpoint it comes to rest where friction lets it."""
    plant = Plant(DriveModel.load('config/hexapod.yaml'))
    robot = SimulatedRobot(plant, control=plant.gains(7.0, 0.9, command_timeout=np.inf),
                           sensors=QUIET)
    goal = plant.position + np.array([3.0, -3.0, 2.0, 0.0, 1.0, -2.0]) * 1e-3
    robot.command(Setpoint(goal, np.zeros(6), plant.holding(goal)))
    for _ in range(400):
        robot.tick()
    # Friction that turns over within 2 mm/s lets it creep the last of the way.
    assert np.abs(plant.velocity).max() < 5e-4
    assert plant.position == pytest.approx(goal, abs=1e-3)
    assert not robot.notes


def test_it_holds_at_home_saturates_and_refuses(tmp_path: Path) -> None:
    plant = Plant(DriveModel.load('config/hexapod.yaml'))
    robot = SimulatedRobot(plant, control=plant.gains(7.0, 0.9), sensors=QUIET)
    home = plant.position.copy()
    for _ in range(50):
        robot.tick()
    assert plant.position == pytest.approx(home, abs=1e-9)
    assert not robot.command(Setpoint(home + 1.0, np.zeros(6)))
    assert 'leg_1 at 1.4847 m lies outside its stroke' in robot.notes[-1].message
    robot.command(Setpoint(None, None, np.full(6, 1e6)))
    robot.tick()
    assert robot.notes[-1].code == 'SATURATED'
    assert ' N, limits' in robot.notes[-1].message or 'URDF' in robot.notes[-1].message


@pytest.fixture(scope='module')
def platform() -> DriveModel:
    return DriveModel.load('config/paper.yaml')


def test_effects_change_while_it_runs(platform: DriveModel) -> None:
    plant = Plant(platform, ['coulomb_friction:lift_1,lift_2'], seed=3)
    (first,) = plant.injected
    assert first['drives'] == ['lift_1', 'lift_2']
    plant.inject(['payload_mass', 'coulomb_friction:lift_1,lift_2'], 3)
    assert plant.injected[1] == first
    plant.step(plant.holding(plant.position))
    with pytest.raises(InjectedEffectError, match='did you mean'):
        plant.inject(['viscous'])
    with pytest.raises(InjectedEffectError, match="not act in 'lift_1'"):
        plant.inject(['base_tilt:lift_1'])


# The simulated robot has MuJoCo's own reading of a description: it exposes faults of ours.

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
