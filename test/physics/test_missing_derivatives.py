# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Trajectories without twists or accelerations: rejected, or taken from a spline."""

from __future__ import annotations

import numpy as np
import pytest
from feedforward_bench import EQUAL, feedforward_bench, message_of, random_motion
from random_states import smooth_motion
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.messages.trajectory_request import TRAJECTORY, readers_for

READER = readers_for(DriveModel.load())[TRAJECTORY]

TIMES = np.arange(0.0, 1.0, 0.01)
SMOOTH = smooth_motion(TIMES)


def without(motion: PlatformMotion, *fields: str, points: slice | None = None,
            ) -> MultiDOFJointTrajectory:
    message = message_of(motion)
    for point in message.points[points or slice(None)]:
        for field in fields:
            setattr(point, field, [])
    return message


def motion_of(message: MultiDOFJointTrajectory) -> PlatformMotion:
    return READER.of_message(message, 1, missing='spline').motion


def test_the_spline_gives_the_derivatives_of_a_motion_known_in_closed_form() -> None:
    motion = motion_of(without(SMOOTH, 'velocities', 'accelerations'))
    # Poses at 100 Hz of motions of 3 rad/s: truncation of quintic splines. The ends matter: the
    # first point is the one that is executed.
    for name, inner, ends in (('linear_velocity', 1e-9, 1e-8), ('angular_velocity', 1e-9, 1e-8),
                              ('linear_acceleration', 1e-8, 1e-6),
                              ('angular_acceleration', 1e-7, 1e-5)):
        error = np.abs(getattr(motion, name) - getattr(SMOOTH, name)).max(axis=1)
        assert error[10:-10].max() < inner, name
        assert error.max() < ends, name


def test_what_is_given_is_kept_and_only_what_is_missing_is_filled() -> None:
    altered = PlatformMotion(
        SMOOTH.position, SMOOTH.orientation, SMOOTH.linear_velocity + 0.01,
        SMOOTH.angular_velocity, SMOOTH.linear_acceleration, SMOOTH.angular_acceleration, TIMES)
    motion = motion_of(without(altered, 'accelerations'))
    np.testing.assert_array_equal(motion.linear_velocity, altered.linear_velocity)
    np.testing.assert_allclose(motion.linear_acceleration[10:-10],
                               SMOOTH.linear_acceleration[10:-10], rtol=0, atol=1e-8)
    some = motion_of(without(altered, 'velocities', points=slice(20, 30)))
    np.testing.assert_array_equal(some.linear_velocity[:20], altered.linear_velocity[:20])
    np.testing.assert_array_equal(some.linear_acceleration, altered.linear_acceleration)
    np.testing.assert_allclose(some.linear_velocity[20:30], SMOOTH.linear_velocity[20:30],
                               rtol=0, atol=1e-8)


@pytest.mark.parametrize('fields', [('velocities',), ('accelerations',),
                                    ('velocities', 'accelerations')])
def test_too_few_points_and_the_policy_reject_refuse_with_the_code_size(
    fields: tuple[str, ...],
) -> None:
    for motion, policy in ((SMOOTH[:3], 'spline'), (SMOOTH[:1], 'spline'), (SMOOTH, 'reject')):
        with pytest.raises(Rejection, match=r'^SIZE: point 0 has 0'):
            READER.of_message(without(motion, *fields), 1, missing=policy)
    motion_of(without(SMOOTH[:4], *fields))


def test_poses_that_no_spline_can_follow_are_rejected_and_nothing_else_happens() -> None:
    rng = np.random.default_rng(4)
    for seconds in ([0, 1, 2, 3], [0, 0, 2**31 - 5, 2**31 - 2]):
        message = without(random_motion(rng, 4), 'velocities', 'accelerations')
        for k, (point, second) in enumerate(zip(message.points, seconds, strict=True)):
            point.time_from_start.sec, point.time_from_start.nanosec = second, k
        message.points[2].transforms[0].translation.x = 1e308
        message.points[3].transforms[0].translation.x = -1e308
        with pytest.raises(Rejection, match=r'^OUTPUT'):
            motion_of(message)


def test_the_node_answers_a_pose_trajectory_as_a_whole_and_its_first_point() -> None:
    expected = DriveModel.load().drive_forces(SMOOTH)
    with feedforward_bench(missing_derivatives='spline') as node:
        first = node.answer(without(SMOOTH, 'velocities', 'accelerations'))
        assert node.bench.spin_until(lambda: node.joint_trajectory)
        effort = np.array([point.effort for point in node.joint_trajectory[-1].points])
        np.testing.assert_allclose(first, effort[0], rtol=0, atol=EQUAL)
        # Errors of 1e-5 in accelerations, and velocities of 1e-8 under a reversal of 1e-3 m/s.
        np.testing.assert_allclose(effort, expected.total, rtol=0, atol=1e-4)
        node.send(without(SMOOTH[:1], 'velocities'))
        assert node.counters['SIZE'] == 1
