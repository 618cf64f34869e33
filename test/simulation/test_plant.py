# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Arms and robots with loops in motion under the efforts of their drives, in simulated time."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import made_up_arm
import numpy as np
import pytest

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.simulation.drive_control import Setpoint
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
