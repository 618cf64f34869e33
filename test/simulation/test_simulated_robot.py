# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated robot: control of the drives, limits, sensors and their noise."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import pprs_dynamics
from pprs_dynamics import DriveModel
from pprs_dynamics.simulation.drive_control import (
    LONGEST_LATE,
    ControlSettings,
    DriveControl,
    Setpoint,
)
from pprs_dynamics.simulation.plant import Plant
from pprs_dynamics.simulation.simulated_robot import Measurement, SensorSettings, SimulatedRobot

AXIS = DriveModel.load('config/single_axis.yaml')
QUIET = SensorSettings(quantisation=0.0, effort_noise=0.0)
RATE = 500.0
ZERO = np.zeros(1)


def axis(sensors: SensorSettings = QUIET, seed: int = 0, **settings: float | bool,
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
        assert robot.command(*points)
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
    control = DriveControl(AXIS.limits, np.zeros_like, ControlSettings(), step)

    def setpoint(time: float) -> Setpoint:
        return Setpoint(np.array([speed * time]), np.array([speed]))

    control.command(0.0, setpoint(0.0), setpoint(period), period)
    for time in np.arange(0.0, period + 0.0015, step):
        effort = control.effort(time, np.array([speed * time]), np.array([speed]))
        np.testing.assert_allclose(effort, 0.0, atol=1e-9)  # a goal at rest costs up to 1.2 N


@pytest.mark.parametrize('late', [0.05, 0.15, 1e4])
def test_setpoints_that_come_late_are_followed_as_long_as_they_come(late: float) -> None:
    speed, period = np.array([0.2]), 0.01
    control = DriveControl(AXIS.limits, np.zeros_like, ControlSettings(), period)
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
    control = DriveControl(limits, np.zeros_like, ControlSettings(), 0.002)
    control.command(0.0, Setpoint(effort=np.array([50.0])))
    assert [control.effort(k * 0.002, ZERO, ZERO)[0] for k in range(5)] == [13.0] * 5
    assert [note.code for note in control.notes] == ['SATURATED']
    assert 'axis would need 50 N' in control.notes[0].message


def test_efforts_alone_are_applied_as_they_are() -> None:
    robot = axis()
    for _ in range(3):
        assert robot.command(Setpoint(effort=np.array([7.0])))
        measured = robot.tick()
    assert measured.effort[0] == 7.0


@pytest.mark.parametrize('setpoint', [
    Setpoint(ZERO, np.array([np.nan])), Setpoint(np.zeros(2), ZERO),
    Setpoint(effort=np.array([np.inf])), Setpoint(ZERO), Setpoint(ZERO, np.array([1e308]))],
    ids=['nan', 'two', 'inf', 'no velocity', 'overflow'])
def test_impossible_commands_are_refused(setpoint: Setpoint) -> None:
    robot = axis()
    assert not robot.command(setpoint)
    assert robot.notes[-1].code == 'REFUSED'
    assert robot.control.holding
    assert np.all(np.isfinite(robot.tick().position))


@pytest.mark.parametrize('following', [1e308, 1e9])
@pytest.mark.parametrize('size', [1.0, -1e9])
def test_the_largest_commands_leave_every_number_finite(size: float, following: float) -> None:
    robot = axis(SensorSettings())
    large = np.array([size])
    assert robot.command(Setpoint(ZERO, large, -large),
                         Setpoint(ZERO, np.array([-following]), np.array([following])))
    for _ in range(60):
        measured = robot.tick()
        for values in (measured.position, measured.velocity, measured.effort):
            assert np.all(np.isfinite(values))


def test_stops_end_the_strokes() -> None:
    plant = Plant(DriveModel.load('config/delta.yaml'))
    robot = SimulatedRobot(plant, sensors=QUIET)
    for _ in range(300):
        robot.command(Setpoint(effort=np.full(len(plant.position), 0.2) * plant.largest))
        robot.tick()
    assert np.all(plant.position < plant.upper + 0.1)


# Sensors.

def test_a_seed_repeats_a_recording_bit_for_bit() -> None:
    one, same, other = (wave(axis(SensorSettings(), seed), 0.1)[0][-1] for seed in (1, 1, 2))
    assert np.array_equal(one.effort, same.effort)
    assert not np.array_equal(one.effort, other.effort)


def test_encoders_count_in_whole_steps() -> None:
    measured, true = wave(axis(dataclasses.replace(QUIET, quantisation=1e-5)), 0.6)
    position = np.array([each.position[0] for each in measured])
    np.testing.assert_allclose(position / 1e-5, np.round(position / 1e-5), atol=1e-6)
    assert np.abs(position - true[:, 0]).max() <= 0.5e-5 * (1 + 1e-9)


def test_differentiated_velocities_follow_the_true_ones() -> None:
    measured, true = wave(axis(SensorSettings(effort_noise=0.0)), 0.5)
    error = np.array([each.velocity[0] for each in measured]) - true[:, 1]
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
