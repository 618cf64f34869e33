# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forces of other forms than those of the laws, on one joint of an arm or on an axis."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made_once import diagnose
from made_up_arm import motion, real_arm
from planar_arm import planar_arm
from single_axis import axis_values

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.next_step import GivenFiles, next_step
from pprs_dynamics.inference.diagnosis.sentences import Sentences
from pprs_dynamics.inference.readings.check import find_mistakes
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.candidates import Component, EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.catalogue import catalogue

SWING, WIDTH = 1, 0.01  # the joint, and in which its friction reverses [rad/s]
MOVED = motion(20.0)
Q, V = MOVED.position[:, SWING], MOVED.velocity[:, SWING]
STROKE = float(np.ptp(Q))
REACH = 0.15  # of the stroke, in which a stop is felt
VISCOUS = 15.0  # [N m s/rad]
Force = Callable[[Array], Array]  # of the torque that the joint transmits


def diagnosed(folder: Path, force: Force, moved: JointMotion = MOVED,
              noise: float = 0.1) -> Diagnosis:
    """Return the diagnosis of an arm with a further force on a joint."""
    model, random = real_arm(folder), np.random.default_rng(3)
    forces = model.drive_forces(moved)
    effort = forces.total + noise * random.normal(size=forces.total.shape)
    effort[:, SWING] += force(forces.mechanism.transmitted[:, SWING])
    position = moved.position + 1e-5 * random.normal(size=effort.shape)
    return diagnose(model, [Recording.from_arrays('run', moved.time, position, None, effort,
                                                  model.drives)])


def named(found: Diagnosis) -> list[tuple[str, tuple[str, ...] | None]]:
    return [(effect.name, effect.drives) for effect in found.effects]


def values(found: Diagnosis) -> dict[str, float]:
    """Return the values of all effects, which are on one joint, by parameter."""
    return {key.split('.')[1]: parameter.value for effect in found.effects
            for key, parameter in effect.parameters.items()}


def rubber(side: float) -> Force:
    """Return a bumper that stiffens at one end of the stroke."""
    x = np.maximum(side * Q - (side * Q).max() + REACH * STROKE, 0.0) / (REACH * STROKE)
    return lambda load: side * 6.0 * x ** 1.5


def gear(driving: float, driven_back: float) -> Force:
    """Return losses in proportion to the load, by who drives whom."""
    return lambda load: np.where(load * V > 0, driving, driven_back) * np.abs(load) * (
        V / np.hypot(V, WIDTH))


def breakaway(exponent: float) -> Force:
    """Return friction that falls with speed, and grows with a power of the load."""
    return lambda load: 4.0 * np.abs(load / 30.0) ** exponent * np.exp(-np.abs(V) / 0.1) * (
        V / np.hypot(V, WIDTH))


@pytest.mark.parametrize(('force', 'name', 'expected'), [
    (lambda load: 8.0 * (Q - 0.2), 'drive_spring', {'stiffness': 8.0}),
    (lambda load: 2.0 * np.sin(2 * np.pi * Q / 0.3) + 0.5 * np.sin(4 * np.pi * Q / 0.3),
     'force_ripple', {'pitch': 0.3}),
    (gear(0.15, 0.15), 'load_friction', {}),
    (gear(0.25, 0.10), 'gear_efficiency', {'driving': 0.25, 'driven_back': 0.10}),
    (gear(0.20, 0.15), 'gear_efficiency', {'driving': 0.20, 'driven_back': 0.15}),
    (breakaway(0.9), 'stribeck_friction', {'force': 0.0}),
    (breakaway(0.0), 'stribeck_friction', {'coefficient': 0.0})],
    ids=['spring', 'ripple', 'losses', 'gear', 'nearly alike', 'breakaway by load', 'breakaway'])
def test_a_force_is_named_alone_with_its_size(
    tmp_path: Path, force: Force, name: str, expected: dict[str, float],
) -> None:
    found = diagnosed(tmp_path, force)
    assert named(found) == [(name, ('swing',))]
    for key, value in expected.items():
        assert values(found)[key] == pytest.approx(value, rel=0.05, abs=0.01 * (value < 1))


def test_a_gear_loses_no_less_where_the_motor_drives(tmp_path: Path) -> None:
    """Less loss there than driven back is a gain of all loads, which a mass explains as well."""
    model, effect = real_arm(tmp_path), catalogue()['gear_efficiency']
    component = Component.of(effect, SWING, {}, ('driving', 'driven_back'))
    forces = model.drive_forces(MOVED)
    load, fits = forces.mechanism.transmitted[:, SWING], []
    for losses in ((0.25, 0.1), (0.1, 0.25), (0.5, -0.4)):
        effort = forces.total.copy()
        effort[:, SWING] += gear(*losses)(load)
        effort += 0.05 * np.random.default_rng(0).normal(size=effort.shape)
        recording = Recording.from_arrays('run', MOVED.time, MOVED.position, None, effort,
                                          model.drives)
        sets = FittedSets(Design.of(model, [recording]), DECISIONS)
        fits.append(sets.evaluate((EffectCandidate.of([component]),)))
    usual, impossible, pushing = fits
    np.testing.assert_allclose(usual.coefficients(component), [0.25, 0.1], atol=0.03)
    assert usual.terms.feasibility == 0
    driving, driven_back = impossible.coefficients(component)
    assert driving == pytest.approx(driven_back, rel=1e-6)
    assert impossible.terms.feasibility > DECISIONS.rival_margin
    # Driven back, it may give back no more than the drive's own friction takes.
    most = model.friction.dry(forces.mechanism.friction_load)[:, SWING].max()
    assert pushing.coefficients(component)[1] == pytest.approx(
        -most / np.abs(load[load * V < 0]).max(), rel=0.05)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_stop_is_found_at_its_end_and_place(tmp_path: Path, side: float) -> None:
    found = diagnosed(tmp_path, rubber(side))
    assert named(found) == [('stop_contact', ('swing',))]
    stiffness, other = ('upper', 'lower')[::int(side)]
    assert values(found)[stiffness] * REACH * STROKE == pytest.approx(6.0, rel=0.5)
    assert values(found)[other] == 0
    # A bumper that stiffens begins to be felt behind its edge.
    beyond = side * values(found)['position'] - ((side * Q).max() - REACH * STROKE)
    assert -0.1 < beyond / (REACH * STROKE) < 0.5


def test_the_form_error_of_friction_is_no_unknown(tmp_path: Path) -> None:
    """Viscous friction of which 6 % swings with the speed: nearly twice the noise."""
    wave = np.sqrt(2) * np.cos(4 * np.pi * V / np.ptp(V) + 1)
    found = diagnosed(tmp_path, lambda load: VISCOUS * V * (1 + 0.06 * wave), noise=0.2)
    assert named(found) == [('viscous_friction', ('swing',))]
    assert np.nanstd(found.remaining[:, SWING]) > 1.5 * found.noise_floors['swing']
    assert (found.verdict, dict(found.above_noise)) == ('effect', {})


def test_a_force_of_no_catalogue_is_unknown_beside_any_friction(tmp_path: Path) -> None:
    bump = 6.0 * np.exp(-((Q - np.median(Q)) / (0.04 * STROKE)) ** 2)
    assert diagnosed(tmp_path, lambda load: VISCOUS * V + bump, noise=0.2).verdict == 'unknown'


@pytest.mark.slow
@pytest.mark.parametrize('is_viscous', [False, True])
@pytest.mark.parametrize('levels', [(1.0, 0.15, 1.0, 0.15, 1.0, 0.4), (0.6,) * 6])
def test_friction_that_its_own_heat_takes_away_is_a_drift_by_work(
    tmp_path: Path, levels: tuple[float, ...], is_viscous: bool,
) -> None:
    """The same strokes at several speeds, 15 s each; heat flows off in 12 s."""
    time, cooling = np.arange(0.0, 90.0, 0.01), 12.0
    clock = np.cumsum(np.interp(time, 15.0 * np.arange(6), levels)) * 0.01
    position = np.stack([0.3 * np.sin(2.1 * clock + j) + 0.1 * np.sin((4.3 + j) * clock)
                         for j in range(3)], axis=1)
    velocity = np.gradient(position, time, axis=0)
    v = velocity[:, SWING]
    warm, work = np.zeros(len(v)), np.abs(v) / np.abs(v).mean()
    for k in range(1, len(v)):
        warm[k] = warm[k - 1] + (20.0 * work[k - 1] - warm[k - 1]) / cooling * 0.01
    rubs = v / np.abs(v).max() if is_viscous else v / np.hypot(v, 0.002)
    # Grease thins by a factor e every 20 K.
    found = diagnosed(tmp_path, lambda load: 4.0 * np.exp(-warm / 20.0) * rubs, JointMotion(
        position, velocity, np.gradient(velocity, time, axis=0), time))
    assert found.verdict == 'effect'
    names = {'friction_drift', 'viscous_friction' if is_viscous else 'coulomb_friction'}
    if len(set(levels)) == 1 and not is_viscous:
        # At one speed s, w is s (1 - exp(-t / tau)): F exp(-t / tau) + F_w w is dry friction that
        # goes from F to F_w s. The drift alone is all of it, and a second effect adds no function.
        names = {'friction_drift'}
        ends = values(found)['force'], values(found)['worked'] * np.abs(v).mean()
        assert ends == pytest.approx((4.0, 4.0 / np.e), rel=0.05)
    elif len(set(levels)) > 1:
        assert values(found)['thinned' if is_viscous else 'worked'] < 0
        assert values(found)['time'] == pytest.approx(cooling, rel=0.5)
    assert {name for name, _ in named(found)} == names
    assert {drives for _, drives in named(found)} == {('swing',)}


@pytest.mark.parametrize(('acceleration', 'warns'), [(0.3, True), (3.0, False)])
def test_friction_by_load_needs_another_load(acceleration: float, warns: bool) -> None:
    """A vertical screw that loses 8 % of its load both ways, which varies by 2 or 20 %."""
    model = DriveModel.from_parameters(axis_values(20.0, 100.0, 20.0, gravity=-9.81))
    time, w = np.arange(0, 30, 0.01), 2 * np.pi * 0.4 * np.array([1.0, 0.37])
    phase, size = w * time[:, None], acceleration / w[0] ** 2
    q, v, a = (size * wave.sum(axis=1, keepdims=True) for wave in (
        np.sin(phase), w * np.cos(phase), -w ** 2 * np.sin(phase)))
    force = model.drive_forces(JointMotion(q, v, a, time)).total
    force = force + 0.08 * np.abs(20.0 * (a + 9.81)) * np.tanh(v / 0.001)
    noise = 0.3 * np.random.default_rng(5).normal(size=force.shape)
    found = diagnose(model, [Recording.from_arrays('run', time, q, v, force + noise, ('axis',))])
    assert named(found) == [('load_friction', ('axis',))]
    assert any('another load' in warning for warning in found.warnings) is warns
    value = found.effects[0].parameters['axis.coefficient']
    assert abs(value.value - 0.08) < 3 * value.std


# Answers about a planar arm whose efforts come from Lagrange's equations, written out by hand.

MASS, LENGTH, CENTRE, INERTIA = 0.6, 0.5, 0.25, 0.01  # of each rod
TIME = np.arange(0.0, 10.0, 0.005)
NOISE = 0.02  # [N m]


@pytest.fixture
def arm(tmp_path: Path) -> DriveModel:
    return planar_arm(tmp_path, 2)


def recorded(gravity: tuple[float, float] = (0.0, -9.81), force: tuple[float, float] = (0.0, 0.0),
             forward: float = 0.0, backward: float = 0.0, seed: int = 1) -> Recording:
    """Return a recording of the arm with gravity and a force at the elbow, (x, z), and friction."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.array([[0.2, 0.47, 0.9], [0.31, 0.63, 1.1]])
    size, phase = np.array([1.2, 0.5, 0.1]), rng.uniform(0, 2 * np.pi, (2, 3))
    angle = omega[..., None] * TIME + phase[..., None]
    q = np.einsum('k,jkm->mj', size, np.sin(angle)) + np.array([0.5, 0.4])
    v = np.einsum('k,jk,jkm->mj', size, omega, np.cos(angle))
    a = -np.einsum('k,jk,jkm->mj', size, omega ** 2, np.sin(angle))
    effort = _lagrange(q, v, a, gravity) + 0.1 * v + 0.3 * np.tanh(v / 0.01)
    s, c = np.sin(q[:, 0]), np.cos(q[:, 0])
    effort[:, 0] += LENGTH * (force[1] * s - force[0] * c)
    effort[:, 0] += np.where(v[:, 0] > 0, forward, backward) * np.tanh(v[:, 0] / 0.01)
    return Recording.from_arrays('run', TIME, q, v, effort + NOISE * rng.normal(size=q.shape),
                                 ('j1', 'j2'))


def _lagrange(q: Array, v: Array, a: Array, gravity: tuple[float, float]) -> Array:
    """Return the torques of two rods that hang from axes along y."""
    s1, c1, s2, c2 = np.sin(q[:, 0]), np.cos(q[:, 0]), np.sin(q[:, 1]), np.cos(q[:, 1])
    s12, c12 = np.sin(q.sum(axis=1)), np.cos(q.sum(axis=1))
    elbow = INERTIA + MASS * CENTRE ** 2
    cross = elbow + MASS * LENGTH * CENTRE * c2
    first = 2 * elbow + MASS * LENGTH ** 2 + 2 * MASS * LENGTH * CENTRE * c2
    h = -MASS * LENGTH * CENTRE * s2
    x, z = gravity
    lower = -MASS * CENTRE * (z * s12 - x * c12)
    upper = lower - MASS * (CENTRE + LENGTH) * (z * s1 - x * c1)
    return np.stack((
        first * a[:, 0] + cross * a[:, 1] + h * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2) + upper,
        cross * a[:, 0] + elbow * a[:, 1] - h * v[:, 0] ** 2 + lower), axis=1)


def test_where_nothing_is_hidden_nothing_is_reported(arm: DriveModel) -> None:
    assert diagnose(arm, [recorded()]).verdict == 'adequate'


@pytest.mark.parametrize(('force', 'forward', 'backward'), [
    ((3.0, 4.0), 0.5, 0.1), ((3.0, 4.0), 0.9, 0.3), ((8.0, 10.0), 0.9, 0.3)])
def test_a_wrench_with_asymmetric_friction_is_the_reported_set(
    arm: DriveModel, force: tuple[float, float], forward: float, backward: float,
) -> None:
    found = diagnose(arm, [recorded(force=force, forward=forward, backward=backward)])
    assert {effect.name for effect in found.effects} == {'external_wrench', 'asymmetric_friction'}
    assert found.verdict == 'effect'


@pytest.mark.parametrize(('x', 'z'), [(0.0, 9.81), (-6.9, -6.9)])
def test_another_mounting_is_named_with_the_line_of_the_model_file(
    arm: DriveModel, x: float, z: float,
) -> None:
    found = diagnose(arm, [recorded((x, z))])
    assert (found.verdict, found.effects) == ('unknown', ())
    assert 'the robot is mounted in another direction' in Sentences(found).headline
    assert_gravity(next_step(found, GivenFiles())[0], x, z)


@pytest.mark.parametrize('degrees', [-130, -110, -50, 50, 110, 150])
def test_an_oblique_mounting_is_no_other_unit_sign_or_zero(arm: DriveModel, degrees: float,
                                                           ) -> None:
    x, z = 9.81 * np.sin(np.radians(degrees)), -9.81 * np.cos(np.radians(degrees))
    (looks,) = find_mistakes(arm, recorded((x, z)))
    assert_gravity(looks.line, x, z)


def assert_gravity(line: str, x: float, z: float) -> None:
    """Assert that a line of a model file has a gravity, within 0.1 m/s²."""
    (found,) = re.findall(r'under robot, gravity: \[(.*?)\]', line)
    np.testing.assert_allclose([float(value) for value in found.split(',')], (x, 0.0, z), atol=0.1)
