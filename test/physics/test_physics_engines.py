# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Drive forces against MuJoCo and Pinocchio; kinematics and projection are the benchmark's own."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from random_states import ELBOWS, model_of, random_motion, random_robot

from benchmarks.speed.peers import MujocoPeer, PinocchioPeer

STATES = 1000
# Forces of some 40 N carry rounding errors near 1e-14 N; a wrong term shows at 1e-3 N or more.
FORCE_TOLERANCE = 1e-10
GRAVITIES = {'upright': (0.0, 0.0, -9.81), 'oblique': (3.0, -4.0, -8.0)}
# All mass distributions of `random_robot` are unequal; these viscous constants are too.
C_REVOLUTE, C_SPHERICAL = 0.031, 0.017
VISCOUS_ONLY = {
    'friction.revolute.viscous': C_REVOLUTE, 'friction.spherical.viscous': C_SPHERICAL,
    'friction.revolute.coulomb': 0.0, 'friction.spherical.coulomb': 0.0}


@pytest.fixture(scope='module', params=[
    (elbow, gravity) for elbow in ELBOWS for gravity in GRAVITIES], ids='-'.join)
def states(request):
    """Return a robot of unequal chains, random states, and the model's answer."""
    elbow, gravity = request.param
    # One seed per case, so that a case run alone sees the states that it sees in the suite.
    rng = np.random.default_rng([ELBOWS.index(elbow), list(GRAVITIES).index(gravity)])
    robot = random_robot(rng, elbow, GRAVITIES[gravity])
    motion = random_motion(rng, STATES, elbow)
    return robot, motion, model_of(robot, VISCOUS_ONLY).drive_forces(motion)


def test_drive_motion_is_that_of_an_inverse_kinematics_of_its_own(states):
    robot, motion, forces = states
    _, *rates, _, _ = PinocchioPeer(robot).kinematics(motion)
    # Accelerations up to some 100 m/s^2 come from divisions by sin u.
    for found, expected, tolerance in zip(forces.drive_motion, rates, (1e-14, 1e-13, 1e-11),
                                          strict=True):
        assert_allclose(found, np.concatenate((expected[..., 0], expected[..., 1]), axis=1),
                        rtol=0, atol=tolerance)


def test_frictionless_drive_forces_are_those_of_both_engines(states):
    robot, motion, forces = states
    assert len(motion) >= STATES
    for engine in (MujocoPeer, PinocchioPeer):
        assert_allclose(forces.parts['rigid_body'], engine(robot).many(motion), rtol=0,
                        atol=FORCE_TOLERANCE)


def viscous_friction(robot, motion):
    """Return what the drives do against viscous passive joints, by virtual work, (N, 6) [N]."""
    *_, follow, rods = PinocchioPeer(robot).kinematics(motion)
    angles = np.array(robot.geometry.chain_angles)
    hinges = np.stack((-np.sin(angles), np.cos(angles), 0 * angles), axis=1)
    of_rods = rods[:, :, None] * hinges[..., None]  # angular velocities by the platform's twist
    relative = of_rods - np.concatenate((np.zeros((3, 3)), np.eye(3)), axis=1)
    damping = sum(c * np.einsum('nckv,nckw->nvw', turns, turns)
                  for c, turns in ((C_REVOLUTE, of_rods), (C_SPHERICAL, relative)))
    twist = np.concatenate((motion.linear_velocity, motion.angular_velocity), axis=1)
    return np.linalg.solve(np.swapaxes(follow, 1, 2), damping @ twist[..., None])[..., 0]


def test_viscous_friction_of_passive_joints_is_that_of_virtual_work(states):
    robot, motion, forces = states
    expected = viscous_friction(robot, motion)
    assert np.abs(expected).max() > 0.1
    assert_allclose(forces.parts['passive_friction'], expected, rtol=0, atol=FORCE_TOLERANCE)


@pytest.mark.parametrize('elbow', ELBOWS)
def test_printed_equations_7_and_12_contradict_the_engines(elbow):
    """Both errors would be caught above; printed friction has at least the right power."""
    rng = np.random.default_rng(11)
    robot = random_robot(rng, elbow)
    motion = random_motion(rng, 50, elbow)
    forces = model_of(robot, {**VISCOUS_ONLY, 'equations': 'printed'}).drive_forces(motion)
    printed, rigid = forces.parts['rigid_body'], PinocchioPeer(robot).many(motion)
    assert_allclose(printed[:, :3], rigid[:, :3], rtol=0, atol=FORCE_TOLERANCE)
    assert np.abs(printed[:, 3:] - rigid[:, 3:]).max() > 0.1
    printed, rubbing = forces.parts['passive_friction'], viscous_friction(robot, motion)
    q_dot = forces.mechanism.velocity
    assert np.abs(printed - rubbing).max() > 0.1
    assert_allclose(np.sum(q_dot * printed, axis=1), np.sum(q_dot * rubbing, axis=1), rtol=0,
                    atol=1e-12)
