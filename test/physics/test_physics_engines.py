# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Drive forces against MuJoCo and Pinocchio, which share no kinematics with the package."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from oracles.mujoco_robot import MujocoRobot
from random_states import ELBOWS, model_of, random_motion, random_robot

from benchmarks.speed.peers import PinocchioPeer

STATES = 1000
# Forces of some 40 N carry rounding errors near 1e-14 N; a wrong term shows at 1e-3 N or more.
FORCE_TOLERANCE = 1e-10
GRAVITIES = {'upright': (0.0, 0.0, -9.81), 'oblique': (3.0, -4.0, -8.0)}
# All mass distributions of `random_robot` are unequal; these viscous constants are too.
C_REVOLUTE, C_SPHERICAL = 0.031, 0.017
VISCOUS_ONLY = {
    'friction.revolute.viscous': C_REVOLUTE, 'friction.spherical.viscous': C_SPHERICAL,
    'friction.revolute.coulomb': 0.0, 'friction.spherical.coulomb': 0.0}

every_elbow = pytest.mark.parametrize('elbow', ELBOWS)


@pytest.fixture(scope='module', params=[
    (elbow, gravity) for elbow in ELBOWS for gravity in GRAVITIES], ids='-'.join)
def states(request):
    """Return a robot of unequal chains, its model, and random states with the model's answer."""
    elbow, gravity = request.param
    # One seed per case, so that a case run alone sees the states that it sees in the suite.
    rng = np.random.default_rng([ELBOWS.index(elbow), list(GRAVITIES).index(gravity)])
    robot = random_robot(rng, elbow, GRAVITIES[gravity])
    motion = random_motion(rng, STATES, elbow)
    return robot, motion, model_of(robot, VISCOUS_ONLY).drive_forces(motion)


@pytest.fixture(scope='module')
def oracle(states):
    """Return MuJoCo's answer for `states`, worked out once."""
    robot, motion, _ = states
    return MujocoRobot(robot).solve(motion, C_REVOLUTE, C_SPHERICAL)


def test_drive_motion_is_the_engines(states, oracle):
    chains = states[2].mechanism.links
    # Accelerations up to some 100 m/s^2 come from divisions by sin u.
    assert_allclose(chains.position, oracle.position, rtol=0, atol=1e-14)
    assert_allclose(chains.velocity, oracle.velocity, rtol=0, atol=1e-13)
    assert_allclose(chains.acceleration, oracle.acceleration, rtol=0, atol=1e-11)


def test_frictionless_drive_forces_are_those_of_both_engines(states, oracle):
    robot, motion, forces = states
    assert len(motion) >= STATES
    for expected in (oracle.force, PinocchioPeer(robot).many(motion)):
        assert_allclose(forces.parts['rigid_body'], expected, rtol=0, atol=FORCE_TOLERANCE)


def test_viscous_friction_of_passive_joints_is_the_engines(states, oracle):
    assert np.abs(oracle.passive).max() > 0.1
    assert_allclose(states[2].parts['passive_friction'], oracle.passive, rtol=0,
                    atol=FORCE_TOLERANCE)


# The errors of (7) and (12) as printed, on states of this kind: both would be caught above.

@every_elbow
def test_printed_equation_7_contradicts_the_engines(elbow):
    rng = np.random.default_rng(11)
    robot = random_robot(rng, elbow)
    motion = random_motion(rng, 50, elbow)
    printed = model_of(robot, {'equations': 'printed'}).drive_forces(motion).parts['rigid_body']
    oracle = MujocoRobot(robot).solve(motion).force
    assert_allclose(printed[:, :3], oracle[:, :3], rtol=0, atol=FORCE_TOLERANCE)
    assert np.abs(printed[:, 3:] - oracle[:, 3:]).max() > 0.1


@every_elbow
def test_printed_equation_12_contradicts_the_engines_but_has_their_power(elbow):
    rng = np.random.default_rng(12)
    robot = random_robot(rng, elbow)
    motion = random_motion(rng, 50, elbow)
    forces = model_of(robot, {**VISCOUS_ONLY, 'equations': 'printed'}).drive_forces(motion)
    printed, q_dot = forces.parts['passive_friction'], forces.mechanism.velocity
    oracle = MujocoRobot(robot).solve(motion, C_REVOLUTE, C_SPHERICAL).passive
    assert np.abs(printed - oracle).max() > 0.1
    assert_allclose(np.sum(q_dot * printed, axis=1), np.sum(q_dot * oracle, axis=1), rtol=0,
                    atol=1e-12)
