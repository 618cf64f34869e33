# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects on the platform, in the rods and in the passive joints, against independent oracles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from random_states import (
    ELBOWS,
    masses_of,
    model_of,
    paper_model,
    random_motion,
    random_poses,
    random_robot,
)
from scipy.spatial.transform import Rotation

from benchmarks.speed.peers import PinocchioPeer
from pprs_dynamics import PlatformMotion
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.mechanism.state import PLATFORM
from pprs_dynamics.physics.three_pprs.robot import ThreePprs

EFFECTS = {name: paper_model().bound(effect) for name, effect in CATALOGUE.items()
           if issubclass(effect, StructureEffect) and PLATFORM in effect.acts_in}
# Forces of some 40 N carry rounding errors near 1e-14 N, and accelerations come by division.
FORCE_TOLERANCE = 1e-9
VALUES = {
    'base_tilt': {'x': 0.05, 'y': -0.03},
    'external_wrench': {'force_x': 1.0, 'force_y': -2.0, 'force_z': 3.0, 'moment_x': 0.1,
                        'moment_y': 0.2, 'moment_z': -0.3},
    'joint_friction': {'revolute.viscous': 0.03, 'revolute.torque': 0.02, 'revolute.coulomb': 0.2,
                       'spherical.viscous': 0.01, 'spherical.torque': 0.04,
                       'spherical.coulomb': 0.1},
    'joint_spring': {'revolute.stiffness': 0.8, 'revolute.position': 1.3},
    'link_mass': {'rods.mass': 0.1},
    'payload_mass': {'mass': 0.4},
    'payload_offset': {'x': 0.004, 'y': -0.01, 'z': 0.02},
    'platform_inertia': {'xx': 0.004, 'yy': 0.005, 'zz': 0.006, 'xy': 0.001, 'xz': -0.0005,
                         'yz': 0.0007},
    'tool_drag': {'coefficient': 7.0, 'rotational': 0.05},
}
NOT_LINEAR = ('base_tilt', 'payload_offset')

every_elbow = pytest.mark.parametrize('elbow', ELBOWS)
every_effect = pytest.mark.parametrize('name', EFFECTS)


@pytest.fixture(params=ELBOWS)
def case(request):
    """Return a robot of unequal chains, a random motion and the state of the mechanism."""
    rng = np.random.default_rng([5, ELBOWS.index(request.param)])
    robot = random_robot(rng, request.param, (1.0, -2.0, -9.0))
    motion = random_motion(rng, 40, request.param)
    return robot, motion, model_of(robot).mechanism(motion)


# A robot that has the change in its own numbers, in Pinocchio ---------------------------------

def changed_robot(name, robot):
    """Return a robot whose bodies or gravity differ by an effect."""
    values, masses = VALUES[name], masses_of(robot)
    if name == 'base_tilt':
        tilt = Rotation.from_euler('xy', [values['x'], values['y']])
        return replace(robot, gravity=tuple(tilt.apply(robot.gravity)))
    moved = np.add(masses.centre, [VALUES['payload_offset'][axis] for axis in 'xyz'])
    more = [VALUES['platform_inertia'][axes] for axes in ('xx', 'yy', 'zz', 'xy', 'xz', 'yz')]
    changes = {
        'payload_mass': {'payload': masses.payload + VALUES['payload_mass']['mass']},
        'payload_offset': {'centre': tuple(moved)},
        'link_mass': {'rods': tuple(np.add(masses.rods, VALUES['link_mass']['rods.mass']))},
        'platform_inertia': {'inertia': tuple(np.add(masses.inertia, more))}}
    return ThreePprs.of(robot.geometry, replace(masses, **changes[name]), robot.gravity)


@pytest.mark.parametrize('name', [
    'base_tilt', 'link_mass', 'payload_mass', 'payload_offset', 'platform_inertia'])
def test_changed_bodies_give_the_engines_forces(case, name) -> None:
    robot, motion, state = case
    found = EFFECTS[name](VALUES[name]).force(state)
    expected = PinocchioPeer(changed_robot(name, robot)).many(motion) - PinocchioPeer(
        robot).many(motion)
    assert np.abs(expected).max() > 0.1
    assert_allclose(found, expected, rtol=0, atol=FORCE_TOLERANCE)


# Power of the drives = power into the load ---------------------------------------------------

def several_velocities_per_pose(elbow):
    """Return a robot and, for each of 10 poses, 6 independent velocities in a row."""
    rng = np.random.default_rng([6, ELBOWS.index(elbow)])
    robot = random_robot(rng, elbow)
    pose = [np.repeat(part, 6, axis=0) for part in random_poses(rng, 10, elbow)]
    v, omega, a, epsilon = rng.uniform(-1, 1, (4, 60, 3))
    return robot, PlatformMotion(*pose, v, omega, a, epsilon)


def rod_angles(robot, motion):
    """Return u_i from where A_i stands over C_i's slide: A_i . e_i = R - l cos u_i."""
    geometry = robot.geometry
    angles = np.array(geometry.platform_angles)
    points = geometry.platform_radius * np.stack((np.cos(angles), np.sin(angles), 0 * angles))
    tips = motion.position[:, :, None] + motion.rotation @ points
    outwards = np.stack((np.cos(geometry.chain_angles), np.sin(geometry.chain_angles)))
    reach = np.einsum('nxi,xi->ni', tips[:, :2], outwards)
    u = np.arccos((geometry.base_radius - reach) / geometry.rod_length)
    return u if geometry.elbow == 'up' else -u


@every_elbow
def test_the_drives_do_the_work_of_wrench_and_drag(elbow) -> None:
    robot, motion = several_velocities_per_pose(elbow)
    state = model_of(robot).mechanism(motion)
    v, omega = motion.linear_velocity, motion.angular_velocity
    wrench = EFFECTS['external_wrench'](VALUES['external_wrench'])
    force = wrench.force(state)
    power = v @ [1.0, -2.0, 3.0] + omega @ [0.1, 0.2, -0.3]
    assert_allclose(np.sum(force * state.velocity, axis=1), power, rtol=0, atol=1e-11)
    # Six independent velocities per pose leave no other force that does this work.
    assert_allclose(np.ptp(force.reshape(10, 6, 6), axis=1), 0, atol=FORCE_TOLERANCE)
    drag = EFFECTS['tool_drag'](VALUES['tool_drag']).force(state)
    power = 7.0 * np.sum(v ** 2, axis=1) + 0.05 * np.sum(omega ** 2, axis=1)
    assert_allclose(np.sum(drag * state.velocity, axis=1), power, rtol=0, atol=1e-11)
    # At a pose drag is linear in the velocity: its matrix is the same from any six of them.
    held = EFFECTS['tool_drag']({'coefficient': 7.0, 'rotational': 0.0}).force(state)
    for rows, motions in zip(held.reshape(10, 6, 6), state.velocity.reshape(10, 6, 6), strict=True):
        damping = np.linalg.solve(motions, rows)
        assert_allclose(damping, damping.T, rtol=0, atol=1e-6)


@every_elbow
def test_the_force_of_stiffness_is_the_change_of_its_energy(elbow) -> None:
    robot, motion = several_velocities_per_pose(elbow)
    state = model_of(robot).mechanism(motion)
    force = EFFECTS['joint_spring'](VALUES['joint_spring']).force(state)
    step = 1e-6
    before, after = (
        0.4 * np.sum((rod_angles(robot, moved(motion, side * step)) - 1.3) ** 2, axis=1)
        for side in (-1, 1))
    power = np.sum(force * state.velocity, axis=1)
    assert np.abs(power).max() > 0.5
    assert_allclose(power, (after - before) / (2 * step), rtol=0, atol=1e-7)
    assert_allclose(np.ptp(force.reshape(10, 6, 6), axis=1), 0, atol=FORCE_TOLERANCE)


def moved(motion, time):
    """Return where the platform is a moment later at its velocity."""
    half = 0.5 * time * motion.angular_velocity
    x, y, z, w = motion.orientation.T
    h_x, h_y, h_z = half.T
    # q + (omega t / 2) q, to first order: what is left cancels in a central difference.
    turned = np.stack((x + h_x * w + h_y * z - h_z * y, y + h_y * w + h_z * x - h_x * z,
                       z + h_z * w + h_x * y - h_y * x, w - h_x * x - h_y * y - h_z * z), axis=1)
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    zero = np.zeros_like(motion.position)
    return PlatformMotion(motion.position + time * motion.linear_velocity, turned,
                          zero, zero, zero, zero)


@every_elbow
def test_dry_friction_of_joints_takes_its_torque_times_their_speed(elbow) -> None:
    robot, motion = several_velocities_per_pose(elbow)
    state = model_of(robot).mechanism(motion)
    step = 1e-6
    before, after = (rod_angles(robot, moved(motion, side * step)) for side in (-1, 1))
    u_dot = (after - before) / (2 * step)
    angles = np.array(robot.geometry.chain_angles)
    axes = np.stack((-np.sin(angles), np.cos(angles), 0 * angles), axis=1)
    relative = u_dot[..., None] * axes - motion.angular_velocity[:, None, :]
    for joint, speed in (('revolute', np.abs(u_dot)),
                         ('spherical', np.linalg.norm(relative, axis=2))):
        force = EFFECTS['joint_friction']({f'{joint}.torque': 0.04}).force(state)
        expected = 0.04 * np.sum(speed * np.tanh(speed / state.reversal.rate), axis=1)
        assert_allclose(np.sum(force * state.velocity, axis=1), expected, rtol=0, atol=1e-7)


# What holds for all of them ------------------------------------------------------------------


@every_effect
def test_forces_follow_the_coefficients(case, name) -> None:
    effect, state = EFFECTS[name], case[2]
    coefficients = effect.to_coefficients(VALUES[name])
    whole = effect(VALUES[name]).force(state)
    assert_allclose(effect.at(coefficients).force(state), whole, rtol=0, atol=1e-9)
    single = [effect.at({key: value}).force(state) for key, value in coefficients.items()]
    rest = np.abs(np.sum(single, axis=0) - whole).max()
    if name in NOT_LINEAR:
        # Angles of 0.05 rad and offsets of 1 cm: a few hundredths of what the effect does.
        assert 1e-9 < rest < 0.1 * np.abs(whole).max()
    else:
        assert rest < 1e-9
    assert_allclose(effect.at({}).force(state), 0, atol=1e-9)


@every_effect
def test_an_effect_comes_back_from_its_file_and_from_its_coefficients(name) -> None:
    effect = EFFECTS[name]
    once = effect.from_file(VALUES[name])
    assert {key: value for key, value in once.values.items() if key in VALUES[name]} == VALUES[name]
    assert effect.from_file(once.values) == once
    coefficients = effect.to_coefficients(once.values)
    assert list(coefficients) == [c.name for c in effect.coefficients]
    assert effect.from_coefficients(coefficients) == pytest.approx(VALUES[name], rel=1e-14)
    again = effect.at(coefficients)
    assert effect.from_file(again.values).values == pytest.approx(VALUES[name], rel=1e-14)


@pytest.mark.parametrize(('name', 'values', 'rule'), [
    ('payload_mass', {'mass': 1e6}, r'effects\.payload_mass\.mass is 1000000.*between'),
    ('payload_mass', {}, r'effects\.payload_mass\.mass is missing.*kg'),
    ('base_tilt', {'x': 'level', 'y': 0.0}, 'be a number'),
])
def test_a_wrong_block_is_told(name, values, rule) -> None:
    with pytest.raises(ModelError, match=rule):
        EFFECTS[name].from_file(values)
