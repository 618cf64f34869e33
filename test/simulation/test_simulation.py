# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated robot: exact mechanics, friction as in the model file, hidden effects, sensors."""

from __future__ import annotations

import ast
import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import pprs_dynamics
from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import MissingLibraryError, MotionError
from pprs_dynamics.physics.three_pprs.forward_motion import solve_forward_motion
from pprs_dynamics.simulation.closed_chains import ClosedChains
from pprs_dynamics.simulation.drive_control import (
    LONGEST_LATE,
    ControlSettings,
    DriveControl,
    Setpoint,
)
from pprs_dynamics.simulation.injected_effect import InjectedEffectError
from pprs_dynamics.simulation.injected_effects import (
    IN_CATALOGUE,
    INJECTED_EFFECTS,
    NOT_IN_CATALOGUE,
    draw_effect,
)
from pprs_dynamics.simulation.plant import Plant, PlantSettings, Truth
from pprs_dynamics.simulation.sensors import EffortNoise, SensorSettings
from pprs_dynamics.simulation.virtual_robot import (
    DriveReference,
    SimulatedRobot,
    SimulatedRun,
    simulate,
)

MODEL = DriveModel.load('config/paper.yaml')
QUIET = SensorSettings(quantisation=0.0, true_velocity=True, white_noise=0.0, coloured_noise=0.0)
WEIGHT_HELD = ControlSettings(gravity_compensation=True)
HOME = Plant(MODEL.values).position
# The simulated robot and the model agree to rounding (1e-12 N); loads are iterated until what is
# left in the forces is below mu times 3e-5 N.
AGREEMENT = 3e-6  # [N]
RATE = 500.0
WAVE_RATES = np.array([0.9, 1.3, 1.1, 0.7, 1.0, 0.8])  # [Hz]
WAVE_PHASES = np.array([0.0, 1.0, 2.0, 0.5, 1.5, 2.5])


def wave(duration: float, size: float = 0.02) -> DriveReference:
    """Return sines of the six drives around home, analytic, that reverse at different times."""
    t = np.arange(round(duration * RATE))[:, None] / RATE
    rate, phase = 2 * np.pi * WAVE_RATES, WAVE_PHASES
    position = HOME + size * (np.sin(rate * t + phase) - np.sin(phase))
    return DriveReference(position, size * rate * np.cos(rate * t + phase))


def still(duration: float) -> DriveReference:
    samples = round(duration * RATE)
    return DriveReference(np.tile(HOME, (samples, 1)), np.zeros((samples, 6)))


def unexplained(run: SimulatedRun, model: DriveModel = MODEL) -> np.ndarray:
    """Return what the drives really applied beyond what the model says of the true motion."""
    assert run.truth is not None
    return run.truth.effort - model.drive_forces(run.platform_motion()).total


def changed(**values: object) -> DriveModel:
    return DriveModel.from_parameters(
        {**MODEL.values, **{k.replace('__', '.'): v for k, v in values.items()}})


def rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(np.square(values), axis=0))


@pytest.fixture(scope='module')
def plain() -> SimulatedRun:
    return simulate(MODEL.values, wave(1.2), control=WEIGHT_HELD, sensors=QUIET)


# Mechanics.

def test_the_model_explains_a_robot_without_hidden_effects(plain: SimulatedRun) -> None:
    assert rms(unexplained(plain)).max() < AGREEMENT


def test_friction_is_no_small_part_of_what_is_explained(plain: SimulatedRun) -> None:
    forces = MODEL.drive_forces(plain.platform_motion())
    assert rms(forces.parts['active_friction'])[:3].min() > 0.3
    assert rms(forces.parts['passive_friction']).min() > 0.005


@pytest.mark.parametrize('change', [
    {'masses__centre': [0.01, -0.02, 0.03], 'masses__inertia': [.02, .03, .04, .001, -.002, .003]},
    {'gravity': [1.0, -2.0, -9.0]},
    {'geometry__platform_angles': [0.1, 2.2, 4.1], 'geometry__chain_angles': [0.3, 2.3, 4.6]},
    {'masses__rods': [0.1, 0.3, 0.5], 'masses__slides': [0.0, 0.2, 1.0]},
    {'geometry__elbow': 'down', 'limits__lift_stroke': [-0.1, 1.5]},
], ids=['centre', 'gravity', 'angles', 'masses', 'elbow'])
def test_the_model_explains_other_robots_too(change: dict[str, object]) -> None:
    model = changed(**change)
    home = Plant(model.values).position
    reference = wave(0.2)
    reference = DriveReference(reference.position - HOME + home, reference.velocity)
    run = simulate(model.values, reference, control=WEIGHT_HELD, sensors=QUIET)
    assert rms(unexplained(run, model)).max() < AGREEMENT


def test_guide_loads_come_out_as_in_the_model(plain: SimulatedRun) -> None:
    assert plain.truth is not None
    loads = MODEL.drive_forces(plain.platform_motion()).mechanism.friction_load
    assert np.abs(plain.truth.guide_load - loads).max() < 1e-4


def test_spherical_joints_stay_closed(plain: SimulatedRun) -> None:
    assert plain.truth is not None
    assert plain.truth.gap.max() < 1e-12


def energy_of(chains: ClosedChains) -> float:
    """Return kinetic and potential energy at `qpos` and `qvel` [J]."""
    for of_engine in (chains.engine.mj_fwdPosition, chains.engine.mj_fwdVelocity,
                      chains.engine.mj_energyPos, chains.engine.mj_energyVel):
        of_engine(chains.model, chains.data)
    return float(chains.data.energy.sum())


def test_energy_is_conserved_without_friction() -> None:
    # Constant efforts have the potential -effort . position.
    plant = Plant(MODEL.values, settings=PlantSettings(friction=False))
    plant.place(HOME, np.array([0.1, -0.05, 0.08, 0.05, -0.04, 0.06]))
    effort = plant.chains.evaluate(plant.velocity).drive_bias.copy()

    def energy() -> float:
        plant.chains.close()
        plant.chains.evaluate(plant.velocity)
        return energy_of(plant.chains) - float(effort @ plant.position)

    start, motion = energy(), []
    kinetic = 0.5 * plant.velocity @ plant.chains.evaluate(plant.velocity).mass @ plant.velocity
    for _ in range(1000):
        plant.step(effort)
        motion.append(np.abs(plant.position - HOME).max())
    assert max(motion) > 0.02
    # The midpoint rule is of second order: 0.5 ms against motions of tenths of a second.
    assert abs(energy() - start) < 1e-5 * kinetic


def test_friction_only_takes_energy() -> None:
    plant = Plant(MODEL.values)
    plant.place(HOME, np.array([0.1, -0.05, 0.08, 0.05, -0.04, 0.06]))
    effort = plant.chains.evaluate(np.zeros(6)).drive_bias.copy()
    energies = []
    for _ in range(200):
        plant.step(effort)
        plant.chains.close()
        plant.chains.evaluate(plant.velocity)
        energies.append(energy_of(plant.chains) - float(effort @ plant.position))
    assert np.diff(energies).max() < 1e-9
    assert energies[0] - energies[-1] > 1e-3


def test_velocities_and_accelerations_are_derivatives_of_positions(plain: SimulatedRun) -> None:
    # Central differences over 4 ms err by T^2/6 of the third derivative: 3e-5 m/s here; efforts
    # that change between samples leave 0.02 m/s^2 in accelerations of up to 1.
    truth = plain.truth
    assert truth is not None
    velocity = (truth.position[2:] - truth.position[:-2]) * RATE / 2
    assert rms(velocity - truth.velocity[1:-1]).max() < 3e-5
    acceleration = (truth.velocity[2:] - truth.velocity[:-2]) * RATE / 2
    steady = np.abs(truth.velocity[1:-1]) > 0.02
    assert np.sqrt(np.mean(np.square(acceleration - truth.acceleration[1:-1])[steady])) < 0.02


def test_a_finer_time_step_changes_hardly_anything(plain: SimulatedRun) -> None:
    # Its control is finer too, so that a micrometre of difference is the control's.
    fine = simulate(MODEL.values, wave(0.4), control=WEIGHT_HELD, sensors=QUIET,
                    plant=PlantSettings(step=0.00025))
    assert np.abs(fine.position - plain.position[:200]).max() < 3e-6


@pytest.mark.parametrize('width', [0.05, 1.0, 5.0])
def test_friction_does_not_chatter_at_rest(width: float) -> None:
    run = simulate(MODEL.values, still(0.4), control=WEIGHT_HELD, sensors=QUIET,
                   plant=PlantSettings(drive_width=width))
    assert run.truth is not None
    assert np.abs(run.truth.velocity[-50:]).max() < 1e-9
    assert np.ptp(run.effort[-50:], axis=0).max() < 1e-6


def test_friction_turns_over_in_the_width_asked_for() -> None:
    # A robot three times as wide is the model of a file that says so.
    run = simulate(MODEL.values, wave(0.6), control=WEIGHT_HELD, sensors=QUIET,
                   plant=PlantSettings(drive_width=3.0, passive_width=3.0))
    wide = changed(friction__reversal_velocity=0.003, friction__reversal_rate=0.003)
    assert rms(unexplained(run, wide)).max() < AGREEMENT
    assert rms(unexplained(run)).max() > 0.01


def test_loads_with_friction_in_them_differ_by_millinewtons_of_effort() -> None:
    # The paper takes loads from the frictionless reactions; this is what that leaves out.
    run = simulate(MODEL.values, wave(1.0), control=WEIGHT_HELD, sensors=QUIET,
                   plant=PlantSettings(actual_loads=True))
    assert 5e-4 < rms(unexplained(run)).max() < 0.02


@pytest.fixture(scope='module')
def needed() -> dict[str, np.ndarray]:
    """Return the forces that the model says the reference needs, by parts."""
    reference = wave(1.2)
    acceleration = -(2 * np.pi * WAVE_RATES) ** 2 * (
        reference.position - HOME + 0.02 * np.sin(WAVE_PHASES))
    motion = solve_forward_motion(
        MODEL.robot.geometry, reference.position, reference.velocity, acceleration).motion
    forces = MODEL.drive_forces(motion)
    return {**forces.parts, 'total': forces.total}


def tracking_error(effort: np.ndarray, control: ControlSettings | None = None) -> float:
    reference = wave(1.2)
    run = simulate(MODEL.values, DriveReference(reference.position, reference.velocity, effort),
                   control=control, truth=False)
    return float(rms(run.position - reference.position).max())


def test_each_step_of_feedforward_lowers_the_tracking_error(
    needed: dict[str, np.ndarray],
) -> None:
    alone = tracking_error(np.zeros((600, 6)), WEIGHT_HELD)
    rigid, full = (tracking_error(needed[name]) for name in ('rigid_body', 'total'))
    assert alone > rigid > 10 * full


def test_the_lag_of_differentiated_velocities_is_no_tracking_error(
    needed: dict[str, np.ndarray],
) -> None:
    # The lag alone would cost 0.1 mm: 2 ms, times 150 N s/m and 1.5 m/s^2, by 4000 N/m.
    assert tracking_error(needed['total']) < 1e-5


def test_the_goal_moves_on_beyond_the_last_setpoint_that_is_known() -> None:
    """Setpoints every 5 ms fall between ticks every 2 ms: up to one tick passes before the next."""
    speed, period, step = 0.2, 0.005, 0.0005
    model = DriveModel.load()
    control = DriveControl(model.limits, Plant(model.values).holding, ControlSettings(), step)

    def setpoint(time: float) -> Setpoint:
        return Setpoint(np.full(6, 0.1 + speed * time), np.full(6, speed))

    control.command(0.0, setpoint(0.0), setpoint(period), period)
    for time in np.arange(0.0, period + 0.0015, step):
        effort = control.effort(time, np.full(6, 0.1 + speed * time), np.full(6, speed))
        np.testing.assert_allclose(effort, 0.0, atol=1e-9)  # a goal at rest costs up to 1.2 N


@pytest.mark.parametrize('late', [0.05, 0.15, 1e4])
def test_setpoints_that_come_late_are_followed_as_long_as_they_come(late: float) -> None:
    speed, period, model = 0.2, 0.01, DriveModel.load()
    control = DriveControl(model.limits, Plant(model.values).holding, ControlSettings(), period)
    led = min(late, LONGEST_LATE) * speed  # its velocity leads on from its own time
    for now in np.arange(late, late + 0.5, period):
        goal = np.full(6, 0.1 + speed * (now - late))
        assert control.command(now - late, Setpoint(goal, np.full(6, speed)), taken=now)
        np.testing.assert_allclose(control.effort(now, goal + led, np.full(6, speed)), 0.0,
                                   atol=1e-6)
    assert not control.notes
    control.effort(now + 0.11, goal, np.zeros(6))
    assert [note.code for note in control.notes] == ['HOLD']
    assert 'no command for 0.11 s' in control.notes[0].message


# Hidden effects.

def drawn(name: str, seed: int = 5) -> object:
    effect = draw_effect(name, np.random.default_rng(seed))
    if name == 'payload_pick_up':
        effect.parameters['time'] = 0.1
    return effect


def test_every_effect_of_the_interface_is_there() -> None:
    assert ' '.join(IN_CATALOGUE) == (
        'viscous_friction coulomb_friction asymmetric_friction stribeck_friction '
        'quadratic_friction load_friction gear_efficiency hysteresis friction_drift '
        'friction_temperature '
        'effort_offset effort_gain '
        'homing_error lost_motion drive_spring stop_contact force_ripple drive_inertia '
        'time_delay effort_filter joint_friction joint_spring payload_mass payload_offset '
        'platform_inertia external_wrench base_tilt tool_drag link_mass')
    assert not set(IN_CATALOGUE) & set(NOT_IN_CATALOGUE)


@pytest.mark.parametrize('name', [name for name in INJECTED_EFFECTS if name not in (
    'effort_filter', 'effort_gain', 'homing_error', 'lost_motion', 'time_delay')])
def test_a_hidden_effect_changes_the_efforts_of_its_drives_alone(name: str) -> None:
    effect = drawn(name)
    error = rms(unexplained(simulate(MODEL.values, wave(0.5), [effect], control=WEIGHT_HELD,
                                     sensors=QUIET)))
    has = np.isin(DRIVES, effect.drives) if effect.drives else np.ones(6, dtype=bool)
    assert error[has].max() > 0.02
    if effect.drives:
        # A drive need not come by the place of a bump, or to a stop.
        assert error[has].min() > (0.0 if name in ('local_bump', 'stop_contact') else 1e-3)
    assert np.all(error[~has] < AGREEMENT)


def gear_loss(t: Truth) -> np.ndarray:
    """Return the loss of screws that pass on what the bodies need."""
    passed = MODEL.drive_forces(PlatformMotion(
        t.platform_position, t.orientation, t.linear_velocity, t.angular_velocity,
        t.linear_acceleration, t.angular_acceleration)).parts['rigid_body']
    power = passed * t.velocity
    driving = 0.5 + 0.5 * power / np.hypot(power, 0.005)
    return (0.05 + 0.15 * driving) * 5.0 * (np.abs(passed) / 5.0) ** 0.9 * (
        t.velocity / np.hypot(t.velocity, 0.002))


CLOSED_FORMS = {
    'viscous_friction': ({'coefficient': 5.0, 'thinning_velocity': 0.3},
                         lambda t: 1.5 * np.arcsinh(t.velocity / 0.3)),
    'coulomb_friction': ({'force': 0.7, 'width': 0.002},
                         lambda t: 0.7 * t.velocity / np.hypot(t.velocity, 0.002)),
    'asymmetric_friction': ({'coefficient': 6.0, 'side': -1.0},
                            lambda t: np.where(t.velocity < 0, 6.0 * t.velocity, 0.0)),
    'stribeck_friction': ({'force': 0.8, 'velocity': 0.02, 'width': 0.002},
                          lambda t: 0.8 * np.exp(-np.abs(t.velocity) / 0.02)
                          * t.velocity / np.hypot(t.velocity, 0.002)),
    'quadratic_friction': ({'coefficient': 30.0, 'power': 2.0},
                           lambda t: 30.0 * t.velocity * np.abs(t.velocity)),
    'load_friction': ({'coefficient': 0.03, 'width': 0.002},
                      lambda t: 0.03 * t.guide_load ** (2 / 3) * 10 ** (1 / 3)
                      * t.velocity / np.hypot(t.velocity, 0.002)),
    'gear_efficiency': ({'driving': 0.2, 'driven_back': 0.05, 'width': 0.002}, gear_loss),
    'effort_offset': ({'force': -0.6}, lambda t: np.full_like(t.velocity, -0.6)),
    'drive_spring': ({'stiffness': 20.0, 'rest': 0.01, 'hardening': 0.2},
                     lambda t: 20.0 * (t.position - 0.01)
                     + 20.0 / 0.04 * (t.position - 0.01) ** 3),
    'stop_contact': ({'stiffness': 50.0, 'side': 1.0, 'middle': -0.02, 'reach': 0.01,
                      'damping': 2.0},
                     lambda t: 50.0 * np.clip(t.position + 0.01, 0, None) ** 1.5
                     * (1 + 2.0 * t.velocity)),
    'force_ripple': ({'force': 0.5, 'pitch': 0.005, 'phase': 0.3, 'second': 0.4,
                      'second_phase': -1.0},
                     lambda t: 0.5 * np.sin(2 * np.pi * t.position / 0.005 + 0.3)
                     + 0.2 * np.sin(4 * np.pi * t.position / 0.005 - 1.0)),
    'drive_inertia': ({'mass': 0.8}, lambda t: 0.8 * t.acceleration),
    'local_bump': ({'force': 1.0, 'place': 0.02, 'width': 0.02},
                   lambda t: 1 / (1 + ((t.position - 0.02) / 0.02) ** 4)),
    'vibration': ({'force': 0.4, 'frequency': 12.0, 'phase': 0.5},
                  lambda t: np.tile(0.4 * np.sin(24 * np.pi * t.time[:, None] + 0.5), 6)),
    'drive_coupling': ({'coefficient': 5.0, 'source': 1.0},
                       lambda t: np.tile(5.0 * t.velocity[:, 1:2], 6)),
}


@pytest.mark.parametrize('name', CLOSED_FORMS)
def test_a_hidden_force_has_the_form_that_it_states(name: str) -> None:
    parameters, form = CLOSED_FORMS[name]
    effect = INJECTED_EFFECTS[name]({'slide_1': parameters, 'lift_3': parameters})
    run = simulate(MODEL.values, wave(0.3), [effect], control=WEIGHT_HELD, sensors=QUIET)
    expected = form(run.truth)
    expected[:, 1:5] = 0.0
    assert np.abs(expected).max() > 0.05
    assert np.abs(unexplained(run) - expected).max() < 10 * AGREEMENT


BODIES = {
    'payload_offset': ({'x': 0.01, 'y': -0.005, 'z': 0.02},
                       {'masses__centre': [0.01, -0.005, 0.02]}),
    'payload_mass': ({'mass': 0.3}, {'masses__payload': 1.3, 'masses__inertia':
                                     [0.005048, 0.005048, 0.010048, 0.0, 0.0, 0.0]}),
    'platform_inertia': ({'inertia': 0.02, 'angle': np.pi / 2}, {
        'masses__inertia': [0.025, 0.005, 0.03, 0.0, 0.0, 0.0]}),
    'base_tilt': ({'x': 0.03, 'y': 0.0},
                  {'gravity': [0.0, 9.81 * np.sin(0.03), -9.81 * np.cos(0.03)]}),
}


@pytest.mark.parametrize('name', BODIES)
def test_a_hidden_body_is_a_robot_with_other_numbers(name: str) -> None:
    parameters, numbers = BODIES[name]
    effect = INJECTED_EFFECTS[name](**parameters)
    run = simulate(MODEL.values, wave(0.2), [effect], control=WEIGHT_HELD, sensors=QUIET)
    assert rms(unexplained(run, changed(**numbers))).max() < AGREEMENT
    assert rms(unexplained(run)).max() > 0.02


def test_hidden_bodies_add_up_in_any_order() -> None:
    mass = INJECTED_EFFECTS['payload_mass'](mass=0.3)
    offset = INJECTED_EFFECTS['payload_offset'](x=0.01, y=0.0, z=0.02)
    tensors = []
    for effects in ((mass, offset), (offset, mass)):
        chains = Plant(MODEL.values, effects).chains
        tensors.append((chains.platform_mass, *chains.platform_centre,
                        *chains.platform_inertia.ravel()))
    np.testing.assert_allclose(*tensors, rtol=0, atol=1e-15)


# Forces on rods and platform load the guides, and so raise the dry friction there. Without dry
# friction the drives give exactly the power that the effect takes.
NO_DRY = changed(friction__drives__coulomb=[0.0] * 6, friction__revolute__coulomb=0.0,
                 friction__spherical__coulomb=0.0)


def drag_power(p: dict[str, float], run: SimulatedRun) -> np.ndarray:
    square = np.sum(run.truth.linear_velocity ** 2, axis=1)
    return p['coefficient'] * np.sqrt(1 + square / p['turbulent_velocity'] ** 2) * square


def stiffness_power(p: dict[str, float], run: SimulatedRun) -> np.ndarray:
    chains = MODEL.mechanism(run.platform_motion()).links.chains
    x = chains.rod_angle - p['rest']
    return np.sum(p['stiffness'] * (x + x ** 3 / p['hardening'] ** 2) * chains.u_dot, axis=1)


def cord_power(p: dict[str, float], run: SimulatedRun) -> np.ndarray:
    rotation, truth = run.platform_motion().rotation, run.truth
    arm = rotation @ np.array([p['x'], p['y'], p['z']])
    level, up = np.cos(p['elevation']), np.sin(p['elevation'])
    pulley = np.array([3 * level * np.cos(p['azimuth']), 3 * level * np.sin(p['azimuth']),
                       0.5 + 3 * up])
    cord = pulley - truth.platform_position - arm
    end = truth.linear_velocity + np.cross(truth.angular_velocity, arm)
    return -p['force'] * np.sum(cord * end, axis=1) / np.linalg.norm(cord, axis=1)


def joint_power(p: dict[str, float], speed: np.ndarray) -> np.ndarray:
    moment = (p['viscous'] * p['thinning_rate'] * np.arcsinh(speed / p['thinning_rate'])
              + p['dry'] * speed / np.hypot(speed, p['width']))
    return np.sum(moment * speed, axis=1)


def revolute_power(p: dict[str, float], run: SimulatedRun) -> np.ndarray:
    return joint_power(p, np.abs(MODEL.mechanism(run.platform_motion()).links.chains.u_dot))


def spherical_power(p: dict[str, float], run: SimulatedRun) -> np.ndarray:
    chains = MODEL.mechanism(run.platform_motion()).links.chains
    n = chains.angular_velocity
    return joint_power(p, np.sqrt(n.e ** 2 + (chains.u_dot - n.n) ** 2 + n.k ** 2))


@pytest.mark.parametrize(('name', 'power'), [
    ('tool_drag', drag_power), ('joint_spring', stiffness_power),
    ('external_wrench', cord_power), ('joint_friction:revolute', revolute_power),
    ('joint_friction:spherical', spherical_power)])
def test_the_drives_give_the_power_that_the_effect_takes(name: str, power: object) -> None:
    effect = drawn(name)
    run = simulate(NO_DRY.values, wave(0.3), [effect], control=WEIGHT_HELD, sensors=QUIET)
    given = np.sum(unexplained(run, NO_DRY) * run.truth.velocity, axis=1)
    taken = power(effect.parameters, run)
    assert np.abs(taken).max() > 1e-3
    assert np.abs(given - taken).max() < AGREEMENT


def test_forces_on_the_platform_raise_the_friction_of_the_guides() -> None:
    effect = drawn('external_wrench')
    run = simulate(MODEL.values, wave(0.3), [effect], control=WEIGHT_HELD, sensors=QUIET)
    loads = MODEL.drive_forces(run.platform_motion()).mechanism.friction_load
    assert np.abs(run.truth.guide_load - loads).max() > 0.1


def test_a_hidden_offset_shifts_the_held_effort_by_its_force() -> None:
    offset = INJECTED_EFFECTS['effort_offset']({'lift_2': {'force': 0.8}})
    stiff = ControlSettings(stiffness=40000.0, damping=150.0, gravity_compensation=True)
    held = [simulate(MODEL.values, still(1.0), effects, control=stiff, sensors=QUIET).effort[-1]
            for effects in ([], [offset])]
    # Friction slows the last part of the way: a per cent of the offset after a second.
    np.testing.assert_allclose(held[1] - held[0], [0, 0, 0, 0, 0.8, 0], atol=0.01)


def test_presliding_follows_displacement_and_saturates() -> None:
    effect = INJECTED_EFFECTS['hysteresis']({'slide_1': {'share': 1.0, 'distance': 0.001,
                                                       'power': 2.0}})
    run = simulate(MODEL.values, wave(1.2), [effect], control=WEIGHT_HELD, sensors=QUIET)
    extra, velocity = unexplained(run)[:, 0], run.truth.velocity[:, 0]
    # Far from reversals the bristles are bent fully, and nothing is left of the effect.
    reversals = np.flatnonzero(np.diff(np.sign(velocity)))
    assert len(reversals) >= 1
    after = reversals[0] + 1
    assert np.abs(extra[after - 20:after - 5]).max() < 0.02
    # Just after one the bent bristles push on: twice the dry friction is missing.
    dry = 0.05 * run.truth.guide_load[after + 8, 0]
    assert abs(extra[after:after + 12]).max() > 1.2 * dry
    assert np.all(extra[after:after + 12] * velocity[after + 5] < 1e-9)


def test_cold_friction_fades_with_the_work_done() -> None:
    effect = INJECTED_EFFECTS['friction_drift']({'slide_1': {
        'force': 1.0, 'path': 0.1, 'cooling_time': 100.0, 'width': 0.001}})
    run = simulate(MODEL.values, wave(0.9), [effect], control=WEIGHT_HELD, sensors=QUIET)
    moving = np.abs(run.truth.velocity[:, 0]) > 0.03
    size = np.abs(unexplained(run)[:, 0])
    path = np.cumsum(np.abs(run.truth.velocity[:, 0])) / RATE
    np.testing.assert_allclose(size[moving], np.exp(-path / 0.1)[moving], rtol=0.03)


def test_a_payload_picked_up_weighs_from_then_on() -> None:
    effect = INJECTED_EFFECTS['payload_pick_up'](mass=0.3, time=0.5, x=0.0, y=0.0, z=0.03)
    run = simulate(MODEL.values, still(1.2), [effect], control=WEIGHT_HELD, sensors=QUIET)
    lifts = unexplained(run)[:, 3:].sum(axis=1)
    assert np.abs(lifts[run.time < 0.5]).max() < AGREEMENT
    assert lifts[-1] == pytest.approx(0.3 * 9.81, rel=0.02)


def moved(robot: SimulatedRobot, first: int, last: int) -> np.ndarray:
    """Return positions, velocities and efforts of some ticks along a wave, (N, 3, 6)."""
    path, rows = wave(0.3), []
    for tick in range(first, last):
        robot.command(path.setpoint(tick))
        row = robot.tick()
        rows.append((row.position, row.velocity, row.effort))
    return np.array(rows)


def test_effects_that_come_and_go_at_once_leave_the_motion() -> None:
    plain, other = (SimulatedRobot(MODEL.values, seed=1, control=WEIGHT_HELD) for _ in range(2))
    assert np.array_equal(moved(plain, 0, 60), moved(other, 0, 60))
    other.use_effects([drawn(name) for name in INJECTED_EFFECTS])
    other.use_effects([])
    np.testing.assert_allclose(moved(other, 60, 120), moved(plain, 60, 120), rtol=0, atol=1e-9)


def test_effects_switched_on_in_a_running_robot_are_those_it_could_have_started_with() -> None:
    born, other = (SimulatedRobot(MODEL.values, effects, seed=1, control=WEIGHT_HELD,
                                  sensors=QUIET)
                   for effects in ([drawn(name) for name in IN_CATALOGUE], []))
    other.use_effects([drawn(name) for name in IN_CATALOGUE])
    other.place(HOME)  # one that started with a moved zero stood there
    np.testing.assert_allclose(moved(other, 0, 100), moved(born, 0, 100), rtol=0, atol=1e-9)


def test_what_stays_on_keeps_its_memory() -> None:
    """Cold friction that has faded is not cold again because a payload came."""
    effect = INJECTED_EFFECTS['friction_drift']({'slide_1': {
        'force': 1.0, 'path': 0.02, 'cooling_time': 100.0, 'width': 0.001}})
    robot = SimulatedRobot(MODEL.values, [effect], control=WEIGHT_HELD, sensors=QUIET)
    moved(robot, 0, 100)
    warm = effect._heat.copy()
    assert warm[0] > 0.005
    robot.use_effects([effect, drawn('payload_mass')])
    assert np.array_equal(effect._heat, warm)


@pytest.mark.parametrize('name', INJECTED_EFFECTS)
def test_draws_repeat_by_seed_and_can_be_told(name: str) -> None:
    one, same, other = (drawn(name, seed) for seed in (1, 1, 2))
    assert one.truth() == same.truth() != other.truth()
    assert json.loads(json.dumps(one.truth()))['name'] == name
    assert one.form


def test_drives_may_be_named() -> None:
    effect = draw_effect('coulomb_friction:lift_1,slide_2', np.random.default_rng(0))
    assert effect.drives == ('slide_2', 'lift_1')
    coupled = draw_effect('drive_coupling:lift_1', np.random.default_rng(0))
    assert coupled.parameters['lift_1']['source'] != DRIVES.index('lift_1')


def test_scale_multiplies_the_strength() -> None:
    one, twice = (draw_effect('payload_mass', np.random.default_rng(0), scale) for scale in (1, 2))
    assert twice.parameters['mass'] == 2 * one.parameters['mass']


@pytest.mark.parametrize(('make', 'text'), [
    (lambda: draw_effect('viscous', np.random.default_rng(0)), 'did you mean'),
    (lambda: draw_effect('base_tilt:lift_1', np.random.default_rng(0)), 'acts in no drive'),
    (lambda: draw_effect('drive_coupling:x', np.random.default_rng(0)), 'acts in a drive'),
    (lambda: INJECTED_EFFECTS['payload_mass'](weight=1.0), 'has the parameters mass'),
    (lambda: INJECTED_EFFECTS['payload_mass'](mass=np.nan), 'finite'),
    (lambda: INJECTED_EFFECTS['effort_offset']({'lift_9': {'force': 1.0}}), 'lift_9')])
def test_impossible_effects_are_refused_in_a_sentence(make: object, text: str) -> None:
    with pytest.raises(InjectedEffectError, match=text):
        make()


# Sensors.

def test_a_seed_repeats_a_recording_bit_for_bit() -> None:
    def record(seed: int) -> SimulatedRun:
        effects = [draw_effect(name, np.random.default_rng(3)) for name in
                   ('hysteresis', 'force_ripple')]
        return simulate(MODEL.values, wave(0.3), effects, seed=seed, control=WEIGHT_HELD)

    one, same, other = record(1), record(1), record(2)
    for name in ('position', 'velocity', 'effort'):
        assert np.array_equal(getattr(one, name), getattr(same, name))
    assert not np.array_equal(one.effort, other.effort)
    assert np.array_equal(one.truth.position, other.truth.position)


def test_encoders_count_in_whole_steps() -> None:
    settings = dataclasses.replace(QUIET, quantisation=1e-5)
    run = simulate(MODEL.values, wave(0.6), control=WEIGHT_HELD, sensors=settings)
    np.testing.assert_allclose(run.position / 1e-5, np.round(run.position / 1e-5), atol=1e-6)
    error = run.position - run.truth.position
    assert np.abs(error).max() <= 0.5e-5 * (1 + 1e-9)
    assert error.std() == pytest.approx(1e-5 / np.sqrt(12), rel=0.1)


def test_differentiated_velocities_follow_the_true_ones() -> None:
    run = simulate(MODEL.values, wave(0.5), control=WEIGHT_HELD)
    # 80 Hz smooth the 2 mm/s of a count per time step to under 1 mm/s, and lag by 2 ms.
    assert rms(run.velocity - run.truth.velocity).max() < 0.003
    assert rms(run.velocity - run.truth.velocity).min() > 1e-5


def noise(samples: int, **settings: float) -> np.ndarray:
    chosen = SensorSettings(**{'white_noise': 0.0, 'coloured_noise': 0.0, **settings})
    source = EffortNoise(chosen, np.random.default_rng(11))
    return np.array([source.sample() for _ in range(samples)])


def test_white_noise_has_its_size_and_no_memory() -> None:
    samples = noise(4000, white_noise=0.2)
    # 24 000 samples: the standard error of a standard deviation is 0.5 %, of a correlation 0.7 %.
    assert samples.std() == pytest.approx(0.2, rel=0.03)
    assert abs(np.mean(samples[1:] * samples[:-1])) / 0.04 < 0.04


def test_coloured_noise_has_its_correlation() -> None:
    samples = noise(8000, coloured_noise=0.2, noise_correlation=0.9)
    # Ten samples tell as much as one: the standard errors are thrice those of white noise.
    assert samples.std() == pytest.approx(0.2, rel=0.06)
    for lag in (1, 5):
        found = np.mean(samples[lag:] * samples[:-lag]) / samples.var()
        assert found == pytest.approx(0.9 ** lag, abs=0.04)


@pytest.mark.parametrize('exponent', [1.0, 1.5])
def test_pink_noise_falls_with_its_exponent(exponent: float) -> None:
    samples = noise(16384, pink_noise=1.0, pink_exponent=exponent)
    power = np.mean(np.abs(np.fft.rfft(samples * np.hanning(16384)[:, None], axis=0)) ** 2, axis=1)
    frequency = np.fft.rfftfreq(16384)
    band = (frequency > 2e-3) & (frequency < 2e-2)
    slope = np.polyfit(np.log(frequency[band]), np.log(power[band]), 1)[0]
    # About 300 lines of six drives in the band: the standard error of the slope is 0.03.
    assert slope == pytest.approx(-exponent, abs=0.2)


def test_a_gain_scales_the_measured_effort_only() -> None:
    effect = INJECTED_EFFECTS['effort_gain']({'slide_2': {'gain': 0.1}})
    run, plain = (simulate(MODEL.values, wave(0.2), effects, control=WEIGHT_HELD, sensors=QUIET)
                  for effects in ([effect], []))
    assert np.array_equal(run.truth.effort, plain.truth.effort)
    np.testing.assert_allclose(run.effort, plain.effort * [1, 1.1, 1, 1, 1, 1], rtol=1e-12)


def test_a_late_effort_is_that_of_a_moment_before() -> None:
    effect = INJECTED_EFFECTS['time_delay']({'slide_1': {'delay': 0.006}})
    run, plain = (simulate(MODEL.values, wave(0.4), effects, control=WEIGHT_HELD, sensors=QUIET)
                  for effects in ([effect], []))
    assert np.array_equal(run.position, plain.position)
    np.testing.assert_allclose(run.effort[3:, 0], plain.effort[:-3, 0], atol=1e-12)
    np.testing.assert_allclose(run.effort[:, 1:], plain.effort[:, 1:], atol=1e-12)


def test_a_filtered_effort_is_rounded_as_butterworths_filter_rounds_it() -> None:
    effect = INJECTED_EFFECTS['effort_filter']({'slide_1': {'time_constant': 0.01}})
    run, plain = (simulate(MODEL.values, wave(0.4), effects, control=WEIGHT_HELD, sensors=QUIET)
                  for effects in ([effect], []))
    assert np.array_equal(run.position, plain.position)
    np.testing.assert_allclose(run.effort[:, 1:], plain.effort[:, 1:], atol=1e-12)
    # On what changes slowly a filter is a delay of its T.
    late = np.interp(run.time - 0.01, run.time, plain.effort[:, 0])
    moving = run.time > 0.1
    change = np.abs(plain.effort[moving, 0] - run.effort[moving, 0]).max()
    assert change > 0.05
    assert np.abs(late - run.effort[:, 0])[moving].mean() < 0.2 * change


def test_an_early_effort_is_prompt_among_encoders_that_are_late() -> None:
    effect = INJECTED_EFFECTS['time_delay']({'slide_1': {'delay': -0.006}})
    run, plain = (simulate(MODEL.values, wave(0.4), effects, control=WEIGHT_HELD, sensors=QUIET)
                  for effects in ([effect], []))
    np.testing.assert_allclose(run.effort[:, 0], plain.effort[:, 0], atol=1e-12)
    np.testing.assert_allclose(run.position[3:], plain.position[:-3], atol=1e-12)
    np.testing.assert_allclose(run.effort[3:, 1:], plain.effort[:-3, 1:], atol=1e-12)


def test_a_wrong_zero_shifts_the_robot_under_its_encoders() -> None:
    effect = INJECTED_EFFECTS['homing_error']({'lift_1': {'zero': 0.002}})
    run = simulate(MODEL.values, wave(0.2), [effect], control=WEIGHT_HELD, sensors=QUIET)
    np.testing.assert_allclose(run.position - run.truth.position,
                               np.tile([0, 0, 0, 0.002, 0, 0], (100, 1)), atol=1e-12)
    assert rms(unexplained(run)).max() < AGREEMENT


# Control.

def test_efforts_beyond_limits_are_cut_and_told() -> None:
    model = changed(limits__effort=[100.0, 100.0, 100.0, 13.0, 100.0, 100.0])
    run = simulate(model.values, still(0.1), control=WEIGHT_HELD, sensors=QUIET)
    assert np.abs(run.truth.effort[:, 3]).max() == 13.0
    assert run.saturated_steps[3] > 100
    assert list(np.delete(run.saturated_steps, 3)) == [0] * 5
    codes = [note.code for note in run.notes]
    assert codes.count('SATURATED') == 1
    assert 'lift_1' in run.notes[0].message
    assert '13 N' in run.notes[0].message


def test_without_commands_the_robot_holds_where_it_is() -> None:
    reference = wave(0.3)
    run = simulate(MODEL.values, reference, duration=1.5, sensors=QUIET)
    assert [note.code for note in run.notes] == ['HOLD']
    # The robot has gone on for the time-out and must brake.
    assert np.abs(run.truth.velocity[-1]).max() < 1e-4
    assert np.abs(run.position[-1] - reference.position[-1]).max() < 0.03
    assert np.abs(run.position[-1] - run.position[-100]).max() < 1e-4


def test_a_robot_that_was_never_commanded_holds_against_its_weight() -> None:
    robot = SimulatedRobot(MODEL.values, sensors=QUIET)
    start = robot.plant.position
    for _ in range(100):
        measurement = robot.tick()
    assert np.abs(measurement.position - start).max() < 1e-6
    assert measurement.effort[3:].sum() > 35


def test_efforts_alone_are_applied_as_they_are() -> None:
    robot = SimulatedRobot(MODEL.values, sensors=QUIET)
    effort = np.array([0.1, -0.2, 0.3, 14.0, 13.0, 12.5])
    for _ in range(5):
        assert robot.command(Setpoint(effort=effort))
        measurement, truth = robot.tick_with_truth()
    assert truth is not None
    assert np.array_equal(truth.effort, effort)
    np.testing.assert_allclose(measurement.effort, effort)


@pytest.mark.parametrize('setpoint', [
    Setpoint(HOME, np.full(6, np.nan)), Setpoint(HOME[:5], np.zeros(6)),
    Setpoint(effort=np.full(6, np.inf)), Setpoint(HOME), Setpoint(HOME + 0.5, np.zeros(6)),
    Setpoint(HOME, np.full(6, 1e308))],
    ids=['nan', 'five', 'inf', 'no velocity', 'beyond stroke', 'overflow'])
def test_impossible_commands_are_refused_and_told(setpoint: Setpoint) -> None:
    robot = SimulatedRobot(MODEL.values, sensors=QUIET)
    assert not robot.command(setpoint)
    assert robot.notes[-1].code == 'REFUSED'
    assert robot.control.holding
    assert np.all(np.isfinite(robot.tick().position))


@pytest.mark.parametrize('following', [1e308, 1e300, 1e9])
@pytest.mark.parametrize('size', [1e9, 1.0, -1e9])
def test_the_largest_commands_leave_every_number_finite(size: float, following: float) -> None:
    robot = SimulatedRobot(MODEL.values)
    large = np.full(6, size)
    assert robot.command(Setpoint(HOME, large, -large),
                         Setpoint(HOME, np.full(6, -following), np.full(6, following)))
    for _ in range(60):
        measured = robot.tick()
        for values in (measured.position, measured.velocity, measured.effort):
            assert np.all(np.isfinite(values))


def test_actuation_delay_makes_efforts_come_late() -> None:
    robot = SimulatedRobot(MODEL.values, sensors=QUIET,
                           control=ControlSettings(actuation_delay=0.004))
    robot.tick()
    effort = np.array([1.0, 1.0, 1.0, 14.0, 14.0, 14.0])
    applied = []
    for _ in range(4):
        robot.command(Setpoint(effort=effort))
        truth = robot.tick_with_truth()[1]
        assert truth is not None
        applied.append(truth.effort[0])
    assert applied[:2] != [1.0, 1.0]
    assert applied[2:] == [1.0, 1.0]


def test_stops_end_the_strokes() -> None:
    robot = SimulatedRobot(MODEL.values, sensors=QUIET)
    lowest, highest = MODEL.values['limits.lift_stroke']
    for _ in range(400):
        robot.command(Setpoint(effort=np.array([0.0, 0.0, 0.0, 30.0, 30.0, 30.0])))
        robot.tick()
    assert np.all(robot.plant.position[3:] < highest + 0.005)
    assert np.all(robot.plant.position[3:] > highest - 0.05)
    assert lowest < highest


# House rules.

# What a true motion, or a load, is handed over in, and names; an arm's come from its model, and so
# do the numbers that MuJoCo takes.
CONTAINERS = (
    'pprs_dynamics.drives', 'pprs_dynamics.physics.mechanism.motion',
    'pprs_dynamics.physics.mechanism.joint_motion',
    'pprs_dynamics.physics.mechanism.structure_load',
    'pprs_dynamics.physics.mechanism.joint_series', 'pprs_dynamics.physics.model.drive_model',
    'pprs_dynamics.physics.model.limits')
# Robots by URDF are built in MuJoCo from what was read of their file: joints, loops, names and
# numbers, friction's among them. Kinematics, loops, reactions and friction are the engine's, or
# forms of their own; `test_engine_loops.py` holds them against the model.
DESCRIPTION = tuple(f'pprs_dynamics.physics.mechanism.{name}' for name in (
    'description', 'urdf', 'mjcf', 'structure', 'mechanism', 'tree_equations', 'passive_joints'))
OF_ARMS = {**dict.fromkeys(('engine_state.py', 'engine_loops.py'), DESCRIPTION),
           'mechanism_engine.py': (*DESCRIPTION, 'pprs_dynamics.physics.model.robot_block'),
           **dict.fromkeys(('mechanism_run.py', 'mechanism_plant.py'), (
               *DESCRIPTION, 'pprs_dynamics.physics.effects.laws.joint_friction'))}
# Of the equations, which are compiled functions over tables, names and kinds of rows alone.
NAMES_OF_TABLES = {'AXES', 'KIND', 'LOOP', 'TRANSLATION', 'JointFriction'}


def test_the_simulation_shares_no_physics_with_the_model() -> None:
    folder = Path(pprs_dynamics.__file__).parent / 'simulation'
    for file in folder.glob('*.py'):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module:
                other = node.module.startswith('pprs_dynamics.') and not node.module.startswith(
                    ('pprs_dynamics.simulation', 'pprs_dynamics.errors', 'pprs_dynamics.arrays'))
                assert not other or node.module in (*CONTAINERS, *OF_ARMS.get(file.name, ())), file
                if node.module.endswith('tree_equations'):
                    assert {one.name for one in node.names} <= NAMES_OF_TABLES, file


def test_a_missing_engine_is_told_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    with pytest.raises(MissingLibraryError, match=r'mujoco.*pprs_dynamics\[sim\]'):
        SimulatedRobot(MODEL.values)


@pytest.mark.parametrize('position', [np.zeros((3, 5)), np.full((3, 6), np.nan)])
def test_a_reference_must_hold_six_finite_numbers(position: np.ndarray) -> None:
    with pytest.raises(MotionError):
        DriveReference(position, position)
