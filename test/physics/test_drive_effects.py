# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects that act in single drives: their laws, what is fitted of them, and their memories."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_arm import motion, write_arm
from model_recordings import with_effects
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from pprs_dynamics import DriveModel, Excitation, PlatformMotion
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.laws.asymmetric_friction import AsymmetricFriction
from pprs_dynamics.physics.effects.laws.coulomb_friction import CoulombFriction
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.laws.drive_spring import DriveSpring
from pprs_dynamics.physics.effects.laws.effort_filter import EffortFilter
from pprs_dynamics.physics.effects.laws.effort_offset import EffortOffset
from pprs_dynamics.physics.effects.laws.force_ripple import ForceRipple
from pprs_dynamics.physics.effects.laws.friction_drift import FrictionDrift
from pprs_dynamics.physics.effects.laws.friction_temperature import FrictionTemperature
from pprs_dynamics.physics.effects.laws.gear_efficiency import GearEfficiency
from pprs_dynamics.physics.effects.laws.hysteresis import Hysteresis
from pprs_dynamics.physics.effects.laws.load_friction import LoadFriction
from pprs_dynamics.physics.effects.laws.quadratic_friction import QuadraticFriction
from pprs_dynamics.physics.effects.laws.stop_contact import StopContact
from pprs_dynamics.physics.effects.laws.stribeck_friction import StribeckFriction
from pprs_dynamics.physics.effects.laws.viscous_friction import ViscousFriction
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.physics.model.forces import ModelState

EFFECTS: tuple[type[DriveEffect], ...] = (
    AsymmetricFriction, CoulombFriction, DriveInertia, DriveSpring, EffortOffset, ForceRipple,
    FrictionDrift, FrictionTemperature, GearEfficiency, Hysteresis, LoadFriction,
    QuadraticFriction, StribeckFriction, ViscousFriction)
WITH_MEMORY = (FrictionDrift, Hysteresis)
# Presliding alone is what is taken away from the model's friction.
FRICTION = (AsymmetricFriction, CoulombFriction, FrictionDrift, GearEfficiency, LoadFriction,
            QuadraticFriction, StribeckFriction, ViscousFriction)
STEP = 0.002


every_effect = pytest.mark.parametrize('effect', EFFECTS, ids=lambda effect: effect.name)


@dataclass
class Axes:
    """Drive states of no robot in particular."""

    time: Any
    position: Any
    velocity: Any
    acceleration: Any
    friction_load: Any
    drives: tuple[str, ...] = ('axis',)

    @property
    def channels(self):
        """A drive that is as warm as its load is high."""
        return {'temperature': self.friction_load}

    @property
    def transmitted(self):
        """As large as the load, and here of its sign."""
        return self.friction_load

    @property
    def direction(self):
        return np.tanh(self.velocity / 0.001)

    def __getitem__(self, part):
        time = None if self.time is None else self.time[part]
        return Axes(time, *(x[part] for x in (self.position, self.velocity, self.acceleration,
                                              self.friction_load)), self.drives)


def excitation(duration=20.0, drives=('axis',)):
    """Return sums of two sinusoids about 0.1 m, of another phase per drive, from 5 s on."""
    t = np.arange(0, duration, STEP)[:, None] + np.arange(len(drives))
    q = 0.1 + 0.05 * np.sin(2 * t) + 0.03 * np.sin(5 * t)
    v = 0.1 * np.cos(2 * t) + 0.15 * np.cos(5 * t)
    a = -0.2 * np.sin(2 * t) - 0.75 * np.sin(5 * t)
    return Axes(5.0 + t[:, 0], q, v, a, 40 + 5 * np.cos(3 * t), drives)


def one_sample(t=0.0, q=0.0, v=0.0, a=0.0, load=0.0):
    return Axes(np.array([t]), *(np.array([[x]]) for x in (q, v, a, load)))


def random_values(effect, rng):
    """Return parameters some way into their bounds, those of a size at which they matter."""
    return {p.name: float(np.clip(p.scale * rng.uniform(0.3, 3), p.lower, p.upper))
            for p in effect.parameters}


def on_axis(values: dict[str, float]) -> dict[str, float]:
    """Return values with the keys that a model file has below the name of an effect."""
    return {f'axis.{name}': value for name, value in values.items()}


# What the laws say ---------------------------------------------------------------------------

@pytest.mark.parametrize(('effect', 'values', 'sample', 'force'), [
    (ViscousFriction, {'coefficient': 3.0}, {'v': -0.2}, -0.6),
    (CoulombFriction, {'force': 0.7}, {'v': -0.2}, -0.7),
    (CoulombFriction, {'force': 0.7}, {'v': 0.0}, 0.0),
    (AsymmetricFriction, {'force_forward': 1.0, 'force_backward': 2.0, 'viscous_forward': 3.0,
                          'viscous_backward': 4.0}, {'v': 0.5}, 2.5),
    (AsymmetricFriction, {'force_forward': 1.0, 'force_backward': 2.0, 'viscous_forward': 3.0,
                          'viscous_backward': 4.0}, {'v': -0.5}, -4.0),
    (StribeckFriction, {'force': 1.2, 'velocity': 0.1}, {'v': 0.1}, 0.4414553),  # 1.2 / e
    (StribeckFriction, {'force': 1.2, 'velocity': 0.1, 'exponent': 1.0}, {'v': -0.2},
     -0.1624023),  # 1.2 / e^2
    (QuadraticFriction, {'coefficient': 20.0}, {'v': -0.3}, -1.8),
    (LoadFriction, {'coefficient': 0.05}, {'v': -0.2, 'load': 40.0}, -2.0),
    # Both quadrants of either sign: the motor drives the load, or the load the motor.
    *((GearEfficiency, {'driving': 0.25, 'driven_back': 0.1}, {'v': v, 'load': load}, force)
      for v, load, force in ((0.2, 40.0, 10.0), (-0.2, 40.0, -4.0), (-0.2, -40.0, -10.0),
                             (0.2, -40.0, 4.0))),
    (EffortOffset, {'force': -0.4}, {'v': 0.3, 'q': 0.1}, -0.4),
    (FrictionDrift, {'force': 0.9, 'time': 10.0}, {'t': 7.0, 'v': -0.2}, -0.9),
    # 15 K above the reference, by 0.02 N and 0.2 N s/m a kelvin, the latter less and less.
    (FrictionTemperature, {'coulomb': -0.02, 'viscous': -0.2, 'reference': 25.0,
                           'thinning': 25.0},
     {'v': -0.2, 'load': 40.0}, 0.3 + 1.0 * (1 - math.exp(-0.6))),
    (DriveSpring, {'stiffness': 20.0, 'position': 0.05}, {'q': 0.2}, 3.0),
    *((StopContact, {'upper': 300.0, 'lower': 200.0, 'position': 0.05}, {'q': q, 'v': v}, force)
      for q, v, force in ((0.07, 0.1, 6.0), (0.07, -0.1, 6.0), (0.02, 0.1, -6.0))),
    (StopContact, {'upper': 300.0, 'position': 0.05}, {'q': 0.02}, 0.0),
    (StopContact, {'lower': 200.0, 'position': 0.05}, {'q': 0.07}, 0.0),
    (ForceRipple, {'force': 0.5, 'phase': math.pi / 6, 'pitch': 0.004}, {'q': 0.001},
     0.4330127),  # 0.5 cos(30 deg)
    (ForceRipple, {'force': 0.5, 'phase': math.pi / 6, 'pitch': 0.004, 'second': 0.2},
     {'q': 0.0005}, 0.6829629),  # 0.5 sin(75 deg) + 0.2 sin(90 deg)
    (ForceRipple, {'force': 0.0, 'phase': 0.0, 'pitch': 0.004, 'second': 0.2,
                   'second_phase': math.pi / 2}, {'q': 0.001}, -0.2),
    (DriveInertia, {'mass': 0.3}, {'a': -2.0}, -0.6),
])
def test_law_gives_the_number_worked_out_by_hand(effect, values, sample, force):
    built = effect.from_file(on_axis(values))
    assert_allclose(built.force(one_sample(**sample)), [[force]], rtol=0, atol=1e-7)


def test_work_warms_a_drive_and_a_rest_cools_it() -> None:
    """10 s at 0.2 m/s, a rest of 10 s, back at 0.1 m/s, with heat that flows off in 5 s."""
    time = np.arange(0.0, 25.0, 0.002)
    v = np.where(time < 10, 0.2, np.where(time < 20, 0.0, -0.1))[:, None]
    axes = Axes(time, np.cumsum(v, axis=0) * 0.002, v, np.zeros_like(v), np.zeros_like(v))
    at = np.searchsorted(time, [4.997, 9.997, 19.997, 24.997])
    worked, thinned = (FrictionDrift({'axis': {name: -3.0, 'time': 5.0}}).force(axes)[at, 0]
                       for name in ('worked', 'thinned'))
    warm = 0.2 * (1 - math.exp(-2))
    again = warm * math.exp(-3) + 0.1 * (1 - math.exp(-1))
    assert_allclose(worked, [-3 * 0.2 * (1 - math.exp(-1)), -3 * warm, 0, 3 * again], atol=1e-3)
    assert_allclose(thinned, worked * [0.2, 0.2, 0, 0.1], atol=1e-3)


@pytest.mark.parametrize('x_d', [1e-4, 1e-2])
def test_presliding_solves_dahls_differential_equation(x_d):
    def q_dot(t):
        return 0.01 * np.cos(2 * t) + 0.015 * np.cos(5 * t)

    t = np.arange(0, 6, 2e-4)
    q = 0.005 * np.sin(2 * t) + 0.003 * np.sin(5 * t)
    z = solve_ivp(lambda s, z: (q_dot(s) - z * abs(q_dot(s))) / x_d, (0, t[-1]), [0.0],
                  t_eval=t, rtol=1e-9, atol=1e-10, max_step=2e-3).y[0]
    assert z.min() < -0.5
    assert z.max() > 0.5
    axes = Axes(t, q[:, None], q_dot(t)[:, None], q[:, None], q[:, None])
    force = Hysteresis({'axis': {'force': 1.0, 'distance': x_d}}).force(axes)
    # A reversal between samples is missed by up to acceleration dt^2 / 8 = 5e-10 m.
    assert_allclose(force[:, 0] + axes.direction[:, 0], z, rtol=0, atol=2e-5)


@pytest.mark.parametrize('effect', FRICTION, ids=lambda effect: effect.name)
def test_friction_takes_power_from_the_motion_and_below_its_limit_gives_it(effect):
    axes = excitation()
    rng = np.random.default_rng(62)
    # What comes with work, or goes, is a share of the drive's other friction.
    limited = effect.linear[:1] if effect is FrictionDrift else effect.linear
    for variant in effect.variants:
        values = {c.name: c.scale * rng.uniform(0.3, 3) if c.name in variant else 0.0
                  for c in limited}
        if not any(values.values()):
            continue
        shape = {p.name: p.scale for p in effect.shape}
        assert set(values) == set(effect.unphysical_below)
        for name, limit in effect.unphysical_below.items():
            assert limit == 0, name
        power = effect({'axis': {**values, **shape}}).force(axes) * axes.velocity
        # A dry force of one direction only is half itself within the reversal, 1 mm/s wide.
        sliding = np.abs(axes.velocity) > 0.02
        assert np.all(power[sliding] > -1e-12)
        assert power.max() > 1e-3
        against = {name: -value for name, value in values.items()}
        assert_allclose(effect({'axis': {**against, **shape}}).force(axes) * axes.velocity, -power)


# What is fitted ------------------------------------------------------------------------------

@every_effect
def test_force_is_the_sum_of_coefficients_times_columns(effect):
    axes = excitation()
    values = random_values(effect, np.random.default_rng(63))
    shape = {p.name: values[p.name] for p in effect.shape}
    columns = effect.columns(DriveSamples.of(axes, 0), **shape)
    coefficients = effect.to_coefficients(values)
    assert list(coefficients) == [c.name for c in effect.coefficients]
    expected = sum(coefficients[c.name] * column
                   for c, column in zip(effect.coefficients, columns, strict=True))
    assert_allclose(effect({'axis': values}).force(axes)[:, 0], expected, rtol=1e-12, atol=1e-12)


@given(st.data())
@every_effect
def test_any_coefficients_fitted_make_an_allowed_effect_of_the_same_force(effect, data):
    fitted = {c.name: data.draw(st.sampled_from((0.0, 1e-9, -1e-9)) | st.floats(-100, 100))
              for c in effect.coefficients}
    values = {**effect.from_coefficients(fitted), **{p.name: p.scale for p in effect.shape}}
    assert effect.from_file(on_axis(values)).drives == {'axis': values}
    axes = excitation(2.0)
    columns = effect.columns(DriveSamples.of(axes, 0), **{p.name: p.scale for p in effect.shape})
    expected = sum(fitted[c.name] * column
                   for c, column in zip(effect.coefficients, columns, strict=True))
    # A constant force as the softest spring allowed varies by 0.02 % over 0.2 m.
    assert_allclose(effect({'axis': values}).force(axes)[:, 0], expected,
                    rtol=0, atol=2e-4 * max(map(abs, fitted.values())) + 1e-12)


# Files, drives and memories ------------------------------------------------------------------

@every_effect
def test_effect_comes_back_from_its_block_in_a_file(effect):
    rng = np.random.default_rng(66)
    built = effect({'lift_1': random_values(effect, rng), 'slide_2': random_values(effect, rng)})
    keys = {f'{drive}.{name}': value for drive, values in built.drives.items()
            for name, value in values.items()}
    assert effect.from_file(keys) == built
    assert effect.from_file(on_axis(built.drives['lift_1'])) != built


@every_effect
def test_effect_acts_in_its_drive_alone_and_by_that_drives_motion(effect):
    two = excitation(drives=('slide_2', 'lift_1'))
    values = random_values(effect, np.random.default_rng(67))
    force = effect({'lift_1': values}).force(two)
    assert np.all(force[:, 0] == 0)
    alone = Axes(two.time, two.position[:, 1:], two.velocity[:, 1:], two.acceleration[:, 1:],
                 two.friction_load[:, 1:])
    assert_array_equal(force[:, 1:], effect({'axis': values}).force(alone))
    assert np.sqrt(np.mean(force[:, 1] ** 2)) > 1e-3


@every_effect
def test_a_stream_with_a_carried_memory_equals_one_call(effect):
    drives = ('slide_2', 'lift_1')
    axes = excitation(4.0, drives)
    rng = np.random.default_rng(68)
    axes.position = np.round(axes.position, 6)  # an encoder, that stands still at times
    built = effect({drive: random_values(effect, rng) for drive in drives})
    memory = built.initial_memory()
    assert (memory is not None) == (effect in WITH_MEMORY)
    parts = [built.force(axes[start:start + 7], memory) for start in range(0, len(axes.time), 7)]
    assert_array_equal(np.concatenate(parts), built.force(axes))


@pytest.mark.parametrize('time_constant', [0.004, 0.03, 0.2])
def test_a_filtered_ramp_is_the_solution_of_its_differential_equation(time_constant):
    """(T/2 d/dt + 1)^2 y = t from rest has y = t - T + (t + T) exp(-2 t / T)."""
    t = np.arange(0.0, 1.0, 0.0005)
    effect = EffortFilter({'axis': {'time_constant': time_constant}})
    y = effect.sense(t, DriveSamples(t, *[np.zeros_like(t)] * 6), **effect.drives['axis'])
    expected = t - time_constant + (t + time_constant) * np.exp(-2 * t / time_constant)
    assert_allclose(y, expected, atol=1e-2 * time_constant)


# --- what is remembered while parameters change ---------------------------------------------------


def moved(model: DriveModel, start: float, state: Any) -> np.ndarray:
    """Return the forces of 4 s of a path that began `start` seconds ago."""
    time = np.arange(0.0, 4.0, 0.01)
    return model.drive_forces(Excitation(4.0, seed=1).motion(time).with_time(time + start),
                              state).parts


def with_effect(name: str, **values: float) -> DriveModel:
    return with_effects(PAPER, {name: {f'lift_1.{key}': value for key, value in values.items()}})


def test_a_warm_drive_does_not_get_cold_as_a_parameter_changes() -> None:
    """After 20 min of a friction that fades in 1 min another force of it makes no step."""
    before, after = (with_effect('friction_drift', force=force, time=60.0) for force in (5.0, 6.0))
    state = before.initial_state()
    moved(before, 0.0, state)
    moved(before, 1200.0, state)
    warm = moved(after, 1204.0, after.continued_state(before, state))['friction_drift']
    assert np.max(np.abs(warm)) < 6.0 * np.exp(-1200.0 / 60.0) * 1.001
    # One that is new to a machine that has worked for 20 min is as warm as the machine.
    plain = DriveModel.load()
    state = plain.initial_state()
    moved(plain, 0.0, state)
    moved(plain, 1200.0, state)
    found = moved(before, 1204.0, before.continued_state(plain, state))['friction_drift']
    assert np.max(np.abs(found)) < 5.0 * np.exp(-1200.0 / 60.0) * 1.001
    assert np.max(np.abs(moved(before, 0.0, before.initial_state())['friction_drift'])) > 4.0


def test_a_stressed_contact_does_not_relax_as_a_parameter_changes() -> None:
    """In the middle of a stroke, far from a reversal, presliding has long been overcome."""
    first, other = (with_effect('hysteresis', force=force, distance=1e-3) for force in (2.0, 3.0))
    state = first.initial_state()
    moved(first, 0.0, state)
    again = other.continued_state(first, state)
    expected = with_effect('hysteresis', force=3.0, distance=1e-3)
    whole = expected.initial_state()
    moved(expected, 0.0, whole)
    assert moved(other, 4.0, again)['hysteresis'] == pytest.approx(
        moved(expected, 4.0, whole)['hysteresis'], abs=1e-12)


# Times that go back: every effect begins anew, and no force grows.

PAPER = DriveModel.load()
STEPS = 0.01 * np.arange(40)
MOTION = HelicalPath().motion(1.0 + STEPS)


def with_any(name: str) -> DriveModel:
    """Return the paper's robot with an effect on its first drive, or on the platform."""
    effect = PAPER.bound(CATALOGUE[name])
    if name == 'measured_curve':
        own = {'variable': 'position', 'from': -1.0, 'to': 1.0, 'values': [0.0, 1.0, 2.0]}
    else:
        own = {parameter.name: float(np.clip(
            0.3 if math.isinf(parameter.upper) or parameter.upper > 1 else parameter.upper / 2,
            parameter.lower, parameter.upper)) for parameter in effect.parameters}
    place = f'{DRIVES[0]}.' if issubclass(effect, DriveEffect) or name == 'measured_curve' else ''
    return with_effects(PAPER, {name: {f'{place}{key}': value for key, value in own.items()}})


def efforts(model: DriveModel, state: ModelState, start: float, motion: PlatformMotion,
            step: int = 1) -> np.ndarray:
    """Return measured efforts of a stream of samples from a time on, so many at a time."""
    found = []
    for k in range(0, len(motion), step):
        piece = motion[k:k + step].with_time(start + STEPS[k:k + step])
        forces = model.drive_forces(piece, state)
        found.append(model.measured(forces, state).total)
    return np.concatenate(found)


# Of other robots, and without a memory.
ELSEWHERE = {'counterbalance', 'coupled_drives', 'eccentric_encoder'}


def test_every_effect_with_a_memory_is_tried() -> None:
    for name in ELSEWHERE:
        effect = CATALOGUE[name]
        assert not (issubclass(effect, DriveEffect) and effect.drive_memory())


@pytest.mark.parametrize('name', [name for name in CATALOGUE if name not in ELSEWHERE])
def test_an_effect_begins_anew_and_gives_what_it_gave_at_first(name: str) -> None:
    model = with_any(name)
    state, fresh = model.initial_state(), model.initial_state()
    efforts(model, state, 1000.0, MOTION)
    again = efforts(model, state, 5.0, MOTION)
    assert np.isfinite(again).all()
    np.testing.assert_array_equal(again, efforts(model, fresh, 5.0, MOTION))


def test_a_stream_that_goes_on_remembers() -> None:
    model = with_any('hysteresis')
    state = model.initial_state()
    efforts(model, state, 1000.0, MOTION)
    later = efforts(model, state, 1000.0 + len(STEPS) * 0.01, MOTION)
    assert np.abs(later - efforts(model, model.initial_state(), 0.0, MOTION)).max() > 0.01


# Friction of motors that turn with several joints, and cylinders between two links.

MAP = '{wrist: {turn: -0.5, swing: 2.0}}'


@pytest.fixture
def arm(tmp_path):
    return DriveModel.load(write_arm(tmp_path, friction__motors=MAP))


def added(model, name, at, **values):
    return with_effects(model, {name: {key.replace('__', '.'): value for key, value in
                                       values.items()}}).drive_forces(at).parts[name]


def test_friction_at_the_motor_does_the_same_work_as_in_its_joints(arm):
    at = motion()
    force = added(arm, 'coupled_drives', at, wrist__viscous=0.7, wrist__coulomb=3.0)
    speed = -0.5 * at.velocity[:, 0] + 2.0 * at.velocity[:, 1]
    fast = np.abs(speed) > 0.3  # far from where it turns over
    assert fast.mean() > 0.5
    rubbed = 0.7 * speed ** 2 + 3.0 * np.abs(speed)
    assert_allclose(np.sum(force * at.velocity, axis=1)[fast], rubbed[fast], rtol=1e-9)
    # Each joint by its share of the map, the third not at all.
    assert_allclose(force[:, 0] * 2.0, force[:, 1] * -0.5)
    assert not force[:, 2].any()


@pytest.mark.parametrize(('motors', 'sentence'), [
    ('{wrist: {turn: 1.0, elbow: 1.0}}', 'elbow'),
    ('{wrist: {turn: 1.0}}', 'move two joints or more'),
    ('{wrist: {turn: 1.0, swing: fast}}', 'friction.motors.wrist.swing')])
def test_a_map_that_cannot_be_is_told(tmp_path, motors, sentence):
    with pytest.raises(ModelError, match=sentence):
        DriveModel.load(write_arm(tmp_path, friction__motors=motors))


def stretched(q, nearer, farther, place):
    """Return the distance of two points, one of which turns."""
    return np.linalg.norm(nearer * np.stack([np.cos(q - place), np.sin(q - place)])
                          - [[farther], [0.0]], axis=0)


def test_a_spring_between_links_has_the_torque_of_its_energy(arm):
    q = np.linspace(-1.2, 1.4, 400)
    at = motion(duration=4.0)
    position = at.position.copy()
    position[:, 1] = q
    still = type(at)(position, 0 * position, 0 * position, at.time)
    # 80 mm and 0.4 m from the axis, 3000 N/m, 0.15 m long where it pulls nothing.
    nearer, farther, stiffness, free, place = 0.08, 0.4, 3000.0, 0.15, 0.5
    force = added(arm, 'counterbalance', still, swing__force=-stiffness * free * farther,
                  swing__stiffness=stiffness * farther ** 2, swing__ratio=nearer / farther,
                  swing__position=place)
    step = 1e-5
    energy = [stiffness / 2 * (stretched(q + side * step, nearer, farther, place) - free) ** 2
              for side in (-1, 1)]
    assert_allclose(force[:, 1], (energy[1] - energy[0]) / (2 * step), rtol=1e-6, atol=1e-6)
    assert not force[:, [0, 2]].any()


def test_a_cylinder_pulls_with_the_pressure_that_was_measured(arm):
    at = motion(duration=4.0)
    pressure = 5e6 + 1e6 * np.sin(at.time)
    measured = at.with_channels({'pressure': np.tile(pressure, (3, 1)).T})
    shape = {'swing__ratio': 0.2, 'swing__position': 0.5, 'swing__force': 0.0}
    force = added(arm, 'counterbalance', measured, swing__area=3e-5, **shape)
    # The same as a constant pull of that size at every moment.
    unit = added(arm, 'counterbalance', at, **{**shape, 'swing__force': 1.0})
    assert_allclose(force[:, 1], 3e-5 * pressure * unit[:, 1])
    assert not added(arm, 'counterbalance', at, swing__area=3e-5, **shape).any()
