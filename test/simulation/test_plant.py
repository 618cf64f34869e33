# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Arms and robots with loops in motion under the efforts of their drives, in simulated time."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ElementTree
from itertools import pairwise
from pathlib import Path

import made_up_arm
import numpy as np
import pytest
import robots_with_loops as robots

import pprs_dynamics
from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.errors import ModelError
from pprs_dynamics.simulation.drive_control import (
    LONGEST_LATE,
    ControlSettings,
    DriveControl,
    Setpoint,
)
from pprs_dynamics.simulation.engine import MechanismEngine
from pprs_dynamics.simulation.injection import draw_motion
from pprs_dynamics.simulation.plant import Plant
from pprs_dynamics.simulation.simulated_robot import Measurement, SensorSettings, SimulatedRobot

QUIET = SensorSettings(effort_noise=0.0)
TICK = 0.002


def models(tmp_path: Path) -> dict[str, DriveModel]:
    """Return the example robots with friction in every joint, and an arm."""
    return {'platform': DriveModel.load('config/paper.yaml'),
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


def command(robot: SimulatedRobot, setpoint: Setpoint, following: Setpoint | None = None) -> bool:
    """Command a robot now, and the next tick's where it is known."""
    return robot.control.command(robot.time, setpoint, following,
                                 robot.plant.steps_per_tick * robot.plant.time_step)


@pytest.mark.parametrize('name', ['platform', 'hexapod', 'delta', 'arm'])
def test_it_follows_with_the_feedforward_and_applies_what_the_model_says(
    tmp_path: Path, name: str,
) -> None:
    model = models(tmp_path)[name]
    motion = draw_motion(model, 8.0, 1, 1 / TICK)[:500]
    forces = model.drive_forces(JointMotion(
        motion.position, motion.velocity, motion.acceleration)).total
    plant = Plant(model)
    robot = SimulatedRobot(plant, control=plant.gains(7.0, 0.9), sensors=QUIET)
    points = [Setpoint(*values) for values in zip(motion.position, motion.velocity, forces,
                                              strict=True)]
    measured = []
    for now, following in pairwise(points):
        assert command(robot, now, following)
        measured.append(robot.tick())
    error = np.array([sample.position for sample in measured]) - motion.position[:-1]
    assert np.abs(error).max() < 1e-3 * np.ptp(motion.position, axis=0).max()
    missed = np.array([sample.effort for sample in measured]) - forces[:-1]
    assert np.sqrt(np.mean(missed ** 2)) < 0.01 * plant.largest.max()
    assert not robot.notes


def test_the_loop_of_the_drives_is_stable(tmp_path: Path) -> None:
    """After a jump of the setpoint it comes to rest where friction lets it."""
    plant = Plant(DriveModel.load('config/hexapod.yaml'))
    robot = SimulatedRobot(plant, control=plant.gains(7.0, 0.9, command_timeout=np.inf),
                           sensors=QUIET)
    goal = plant.position + np.array([3.0, -3.0, 2.0, 0.0, 1.0, -2.0]) * 1e-3
    command(robot, Setpoint(goal, np.zeros(6), plant.holding(goal)))
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
    assert not command(robot, Setpoint(home + 1.0, np.zeros(6)))
    assert 'leg_1 would have to be at 1.4847 m' in robot.notes[-1].message
    command(robot, Setpoint(None, None, np.full(6, 1e6)))
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


def test_bodies_and_joints_of_an_mjcf_need_no_names(tmp_path: Path) -> None:
    (tmp_path / 'robot.xml').write_text(
        '<mujoco><worldbody><body><joint axis="0 1 0"/><inertial pos="0.1 0 0.1" mass="2" '
        'diaginertia="0.02 0.03 0.04"/><body pos="0.3 0 0"><joint axis="0 0 1"/><inertial '
        'pos="0.1 0.1 0" mass="1" diaginertia="0.02 0.03 0.04"/></body></body></worldbody>'
        '</mujoco>')
    path = tmp_path / 'robot.yaml'
    path.write_text('/**:\n  ros__parameters:\n    robot: {mjcf: robot.xml, base: world, '
                    'tool: body_2, drives: [joint_0, joint_1]}\n')
    MechanismEngine(DriveModel.load(path))


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


# The simulated robot: control of the drives, limits, sensors and their noise.

AXIS = DriveModel.load('config/single_axis.yaml')
EXACT = SensorSettings(quantisation=0.0, effort_noise=0.0)
RATE = 500.0
ZERO = np.zeros(1)


def axis(sensors: SensorSettings = EXACT, seed: int = 0, **settings: float | bool,
         ) -> SimulatedRobot:
    plant = Plant(AXIS)
    return SimulatedRobot(plant, seed=seed, control=plant.gains(7.0, 0.9, **settings),
                          sensors=sensors)


def wave(robot: SimulatedRobot, duration: float, feedforward: bool = True,
         ) -> tuple[list[Measurement], np.ndarray]:
    """Let a robot follow a sine; return the readings and the true positions and velocities."""
    rate, size = 2 * np.pi, 0.05
    measured, true = [], []
    for k in range(round(duration * RATE)):
        points = []
        for t in (k / RATE, (k + 1) / RATE):
            q, v, a = (size * (1 - np.cos(rate * t)), size * rate * np.sin(rate * t),
                       size * rate ** 2 * np.cos(rate * t))
            effort = AXIS.drive_forces(pprs_dynamics.JointMotion([[q]], [[v]], [[a]])).total[0]
            points.append(Setpoint(np.array([q]), np.array([v]), effort if feedforward else ZERO))
        assert command(robot, *points)
        true.append((robot.plant.position[0], robot.plant.velocity[0], points[0].position[0]))
        measured.append(robot.tick())
    return measured, np.array(true)


# Control.

def test_feedforward_lowers_the_tracking_error() -> None:
    errors = [np.abs(true[:, 0] - true[:, 2]).max() for true in (
        wave(axis(), 1.0, feedforward)[1] for feedforward in (False, True))]
    assert errors[0] > 20 * errors[1]


def test_the_goal_moves_on_beyond_the_last_setpoint_that_is_known() -> None:
    """Setpoints every 5 ms fall between ticks every 2 ms: up to one tick passes before the next."""
    speed, period, step = 0.2, 0.005, 0.0005
    control = DriveControl(AXIS.limits, np.zeros_like, ControlSettings(), step, ZERO)

    def setpoint(time: float) -> Setpoint:
        return Setpoint(np.array([speed * time]), np.array([speed]))

    control.command(0.0, setpoint(0.0), setpoint(period), period)
    for time in np.arange(0.0, period + 0.0015, step):
        effort = control.effort(time, np.array([speed * time]), np.array([speed]))
        np.testing.assert_allclose(effort, 0.0, atol=1e-9)  # a goal at rest costs up to 1.2 N


@pytest.mark.parametrize('late', [0.05, 0.15, 1e4])
def test_setpoints_that_come_late_are_followed_as_long_as_they_come(late: float) -> None:
    speed, period = np.array([0.2]), 0.01
    control = DriveControl(AXIS.limits, np.zeros_like, ControlSettings(), period, ZERO)
    led = min(late, LONGEST_LATE) * speed  # its velocity leads on from its own time
    for now in np.arange(late, late + 0.5, period):
        goal = speed * (now - late)
        assert control.command(now - late, Setpoint(goal, speed), taken=now)
        np.testing.assert_allclose(control.effort(now, goal + led, speed), 0.0, atol=1e-6)
    assert not control.notes
    control.effort(now + 0.11, goal, ZERO)
    assert [note.code for note in control.notes] == ['HOLD']
    assert 'no command for 0.11 s' in control.notes[0].message


def test_without_commands_the_robot_holds_where_it_is() -> None:
    robot = axis()
    wave(robot, 0.4)
    for _ in range(300):
        robot.tick()
    held = robot.plant.position.copy()
    for _ in range(50):
        robot.tick()
    assert [note.code for note in robot.notes] == ['HOLD']
    assert np.abs(robot.plant.position - held).max() < 1e-4


def test_efforts_beyond_limits_are_limited_and_reported() -> None:
    limits = AXIS.limits.with_efforts([13.0])
    control = DriveControl(limits, np.zeros_like, ControlSettings(), 0.002, ZERO)
    control.command(0.0, Setpoint(effort=np.array([50.0])))
    assert [control.effort(k * 0.002, ZERO, ZERO)[0] for k in range(5)] == [13.0] * 5
    assert [note.code for note in control.notes] == ['SATURATED']
    assert 'axis would need 50 N' in control.notes[0].message


def test_efforts_alone_are_applied_as_they_are() -> None:
    robot = axis()
    for _ in range(3):
        assert command(robot, Setpoint(effort=np.array([7.0])))
        measured = robot.tick()
    assert measured.effort[0] == 7.0


@pytest.mark.parametrize('setpoint', [
    Setpoint(ZERO, np.array([np.nan])), Setpoint(np.zeros(2), ZERO),
    Setpoint(effort=np.array([np.inf])), Setpoint(ZERO), Setpoint(ZERO, np.array([1e308]))],
    ids=['nan', 'two', 'inf', 'no velocity', 'overflow'])
def test_impossible_commands_are_refused(setpoint: Setpoint) -> None:
    robot = axis()
    assert not command(robot, setpoint)
    assert robot.notes[-1].code == 'REFUSED'
    assert robot.control.holding
    assert np.all(np.isfinite(robot.tick().position))


@pytest.mark.parametrize('following', [1e308, 1e9])
@pytest.mark.parametrize('size', [1.0, -1e9])
def test_the_largest_commands_leave_every_number_finite(size: float, following: float) -> None:
    robot = axis(SensorSettings())
    large = np.array([size])
    assert command(robot, Setpoint(ZERO, large, -large),
                         Setpoint(ZERO, np.array([-following]), np.array([following])))
    for _ in range(60):
        measured = robot.tick()
        for values in (measured.position, measured.velocity, measured.effort):
            assert np.all(np.isfinite(values))


def test_stops_end_the_strokes() -> None:
    plant = Plant(DriveModel.load('config/delta.yaml'))
    robot = SimulatedRobot(plant, sensors=EXACT)
    for _ in range(300):
        command(robot, Setpoint(effort=np.full(len(plant.position), 0.2) * plant.largest))
        robot.tick()
    assert np.all(plant.position < plant.upper + 0.1)


# Sensors.

def test_a_seed_repeats_a_recording_bit_for_bit() -> None:
    first, same, other = (wave(axis(SensorSettings(), seed), 0.1)[0][-1] for seed in (1, 1, 2))
    assert np.array_equal(first.effort, same.effort)
    assert not np.array_equal(first.effort, other.effort)


def test_encoders_count_in_whole_steps() -> None:
    measured, true = wave(axis(dataclasses.replace(EXACT, quantisation=1e-5)), 0.6)
    position = np.array([sample.position[0] for sample in measured])
    np.testing.assert_allclose(position / 1e-5, np.round(position / 1e-5), atol=1e-6)
    assert np.abs(position - true[:, 0]).max() <= 0.5e-5 * (1 + 1e-9)


def test_differentiated_velocities_follow_the_true_ones() -> None:
    measured, true = wave(axis(SensorSettings(effort_noise=0.0)), 0.5)
    error = np.array([sample.velocity[0] for sample in measured]) - true[:, 1]
    # They lag by 2 ms behind 2 m/s^2.
    assert 1e-4 < np.sqrt(np.mean(error ** 2)) < 0.01


def test_noise_has_its_size_and_its_correlation() -> None:
    robot = axis(SensorSettings(effort_noise=0.2))
    noise = np.array([robot.sensors.measure(0.0, ZERO).effort[0] for _ in range(40_000)])
    noise /= robot.plant.largest[0]
    # A correlated sample tells a tenth of what an independent one does.
    assert noise.std() == pytest.approx(0.2, rel=0.03)
    for lag in (1, 5):
        found = np.mean(noise[lag:] * noise[:-lag]) / noise.var()
        assert found == pytest.approx(0.36 * 0.9 ** lag, abs=0.04)


def test_a_robot_that_the_engine_does_not_solve_stops_and_says_so() -> None:
    robot = SimulatedRobot(Plant(DriveModel.load(), ['effort_offset'], scale=1e4))
    for _ in range(50):
        measurement = robot.tick()
        # What is published stays what a robot can say.
        assert np.abs(measurement.position).max() < 1.0
    assert [note.code for note in robot.notes].count('STOPPED') == 1


def test_a_body_that_cannot_be_is_named_by_its_moments(tmp_path: Path) -> None:
    model = made_up_arm.real_arm(tmp_path)
    centre = np.zeros((len(model.robot.bodies), 3))
    centre[1, 2] = 10.0  # [kg m]: too far away for the moments of what the second drive moves
    wrong = DriveModel.from_parameters(
        {**model.values, 'links.moment': tuple(centre.ravel())}, str(tmp_path / 'arm.yaml'))
    with pytest.raises(ModelError, match=r'arm.yaml: links.inertia is .*, must be moments of at '
                       'least 0 about the centre of mass of what swing moves'):
        MechanismEngine(wrong)
