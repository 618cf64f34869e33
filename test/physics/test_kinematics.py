# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Kinematics: closure, forward and inverse, Jacobians, singular poses and other solutions."""

from __future__ import annotations

import numpy as np
import pytest
import random_states as states
from numpy.testing import assert_allclose
from oracles.first_principles import chain_vectors, closure
from scipy.optimize import brentq, root
from scipy.spatial.transform import Rotation

from pprs_dynamics import PlatformMotion
from pprs_dynamics.errors import SingularityError, WorkspaceError
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion

POSES = 4000
# Newton stops at 1e-13 of a rod, which the condition of [B] turns into some 1e-12 rad.
POSE_TOLERANCE = 1e-11

every_elbow = pytest.mark.parametrize('elbow', states.ELBOWS)


@pytest.fixture(params=states.ELBOWS)
def geometry(request):
    """Return a geometry in which no two chains are equal."""
    return states.random_robot(np.random.default_rng(21), request.param).geometry


def home_pose():
    """Return the platform at rest at home."""
    return PlatformMotion.at_rest((0.0, 0.0, 0.5))


def forward(geometry, q):
    """Return the platform's frames for drive positions."""
    return states.any_robot(geometry).at(q, 0 * q, 0 * q).frame_of('platform')


def solve(geometry, motion):
    """Return drives, sin u_i and [B] of a motion, at singular poses too."""
    robot = states.any_robot(geometry)
    drives, start = robot.drive_motion(motion)
    links = LinkMotion(robot.structure, robot.structure.evaluation.forward_kinematics(
        drives.position, drives.velocity, drives.acceleration, start)[0])
    sin_u = np.sin(robot.rods(links)[0])
    A = np.concatenate((np.ones_like(sin_u), sin_u), axis=1)
    return drives, sin_u, A[:, :, None] * np.linalg.inv(robot.jacobian(links))


def home_determinant(geometry):
    """Return det [B] of the home pose."""
    return np.linalg.det(solve(geometry, home_pose())[2])[0]


# Inverse and forward -------------------------------------------------------------------------

@every_elbow
@pytest.mark.parametrize('robot', ['paper', 'unequal'])
def test_forward_kinematics_undoes_inverse_kinematics(elbow, robot):
    geometry = (states.paper_geometry(elbow) if robot == 'paper'
                else states.random_robot(np.random.default_rng(3), elbow).geometry)
    position, orientation = states.random_poses(np.random.default_rng(4), POSES, elbow)
    poses = PlatformMotion.at_rest(position, orientation)
    found = forward(geometry, states.inverse_kinematics(geometry, poses).position)
    assert_allclose(found.p, position, rtol=0, atol=POSE_TOLERANCE)
    assert_allclose(found.R, poses.rotation, rtol=0, atol=POSE_TOLERANCE)


# Other solutions -----------------------------------------------------------------------------

def assert_right_or_refused(geometry, q, true_position):
    """Assert that drives with several poses give the true one, or WorkspaceError."""
    try:
        found = forward(geometry, q[None])
    except WorkspaceError:
        return
    assert_allclose(found.p, [true_position], rtol=0, atol=POSE_TOLERANCE)


def test_other_solutions_of_random_poses_are_refused():
    geometry = states.paper_geometry()
    rng = np.random.default_rng(8)
    position, orientation = states.random_poses(rng, 20)
    true = PlatformMotion.at_rest(position, orientation)
    q = states.inverse_kinematics(geometry, true).position
    sign_at_home = np.sign(home_determinant(geometry))
    others = 0
    for sample in range(len(q)):
        for _ in range(8):
            start = np.concatenate((position[sample] + rng.uniform(-0.1, 0.1, 3),
                                    rng.normal(size=3)))
            found = root(lambda x, s=sample: closure(geometry, q[s], x[:3], x[3:]), start)
            if np.abs(closure(geometry, q[sample], found.x[:3], found.x[3:])).max() > 1e-10:
                continue
            pose = PlatformMotion.at_rest(
                found.x[:3], Rotation.from_rotvec(found.x[3:]).as_quat()[None])
            # The inverse takes sin u > 0: only such solutions come back to the same drives.
            drives, _, B = solve(geometry, pose)
            same_elbow = np.abs(drives.position[0] - q[sample]).max() < 1e-8
            if same_elbow and np.sign(np.linalg.det(B)[0]) != sign_at_home:
                others += 1
                assert_right_or_refused(geometry, q[sample], position[sample])
    assert others >= 10


def test_drives_that_cannot_close_the_mechanism_raise(geometry):
    q = states.inverse_kinematics(geometry, home_pose()).position.repeat(3, axis=0)
    q[1, 0] += 1.0  # one slide a metre away from the others
    with pytest.raises(WorkspaceError, match='sample 1') as caught:
        forward(geometry, q)
    assert caught.value.sample == 1


def yaw_with_share(geometry, share):
    """Return the home pose yawed until det [B] is `share` of its value at home."""
    def pose(yaw):
        return PlatformMotion.at_rest(
            states.home_position(geometry.elbow), Rotation.from_rotvec((0, 0, yaw)).as_quat()[None])

    def excess(yaw):
        determinant = np.linalg.det(solve(geometry, pose(yaw))[2])[0]
        return determinant / home_determinant(geometry) - share

    return pose(brentq(excess, 0.0, 2.0, xtol=1e-14))


@every_elbow
@pytest.mark.parametrize('share', [0.5, 0.12, 0.08, 0.01])
def test_the_pose_is_found_where_two_solutions_are_about_to_meet(elbow, share):
    geometry = states.paper_geometry(elbow)
    pose = yaw_with_share(geometry, share)
    q = states.inverse_kinematics(geometry, pose).position
    found = forward(geometry, q)
    assert_allclose(found.p, pose.position, rtol=0, atol=1e-9)


# Out of reach and singular -------------------------------------------------------------------

@every_elbow
@pytest.mark.parametrize('chain', [1, 2, 3])
def test_pose_out_of_reach_names_sample_chain_and_rod_length(elbow, chain):
    model = states.paper_model({'geometry.elbow': elbow})
    away = -0.26 * chain_vectors(model.robot.geometry)[0][chain - 1]  # from this carriage
    home = states.home_position(elbow)
    motion = PlatformMotion.at_rest([home, home + away])
    with pytest.raises(WorkspaceError, match=rf'chain {chain}\b') as caught:
        model.drive_forces(motion)
    assert not isinstance(caught.value, SingularityError)
    assert caught.value.sample == 1
    assert 'geometry.rod_length = 0.3 m' in str(caught.value)
    # R - A . e = 0.15 - (0.10 - 0.26) m.
    assert '0.31 m' in str(caught.value)


@every_elbow
@pytest.mark.parametrize('chain', [1, 2, 3])
def test_horizontal_rod_raises_singularity(elbow, chain):
    model = states.paper_model({'geometry.elbow': elbow})
    away = -0.25 * chain_vectors(model.robot.geometry)[0][chain - 1]
    motion = PlatformMotion.at_rest(states.home_position(elbow) + away * (1 - 1e-6))
    with pytest.raises(SingularityError, match=rf'chain {chain}\b') as caught:
        model.drive_forces(motion)
    assert '0.05' in str(caught.value)  # limits.rod_sine
    assert_allclose(solve(model.robot.geometry, motion)[1][0, chain - 1], 0, atol=2e-3)


@every_elbow
def test_pose_at_which_the_drives_cannot_hold_the_platform_raises(elbow):
    model = states.paper_model({'geometry.elbow': elbow})
    pose = yaw_with_share(model.robot.geometry, 0.0)
    moving = PlatformMotion.at_rest(np.concatenate((
        states.home_position(elbow)[None], pose.position)), np.concatenate((
            [[0, 0, 0, 1]], pose.orientation)))
    with pytest.raises(SingularityError, match=r'condition_number|det \[B\]') as caught:
        model.drive_forces(moving)
    assert caught.value.sample == 1


@every_elbow
def test_condition_limit_is_where_it_says(elbow):
    geometry = states.paper_geometry(elbow)
    pose = yaw_with_share(geometry, 0.2)
    free = states.paper_model({
        'geometry.elbow': elbow, 'limits.condition_number': 1e6}).mechanism(pose)
    number = float(free.robot.condition_number(free.robot.jacobian(free.links))[0])
    above = {'geometry.elbow': elbow, 'limits.condition_number': number * (1 + 1e-9)}
    below = {'geometry.elbow': elbow, 'limits.condition_number': number * (1 - 1e-9)}
    assert np.all(np.isfinite(states.paper_model(above).drive_forces(pose).total))
    with pytest.raises(SingularityError, match='condition number'):
        states.paper_model(below).drive_forces(pose)
