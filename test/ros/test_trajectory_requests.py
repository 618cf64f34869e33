# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What trajectories of joints and poses ask for, and which break a rule: by direct calls."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Transform
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from pprs_dynamics import DriveModel
from pprs_dynamics.ros.messages.conversions import RobotNames
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.messages.trajectory_request import (
    POSES,
    TRAJECTORY,
    RequestReader,
    readers_for,
)

JOINTS = ('shoulder', 'elbow', 'wrist')
TIMES = np.arange(0.25, 0.65, 0.02)  # the first point is due later
RATES = np.array([2.0, 3.0, 5.0])
READER = RequestReader(JointTrajectory, JOINTS)


def message(order: tuple[int, ...] = (0, 1, 2), *lacking: str) -> JointTrajectory:
    """Sines of three frequencies, with their derivatives, of joints in an order."""
    names = [JOINTS[k] for k in order]
    found = JointTrajectory(joint_names=names)
    for time in TIMES:
        angle = (RATES * time)[list(order)]
        rate = RATES[list(order)]
        point = JointTrajectoryPoint(
            positions=np.sin(angle), velocities=rate * np.cos(angle),
            accelerations=-rate ** 2 * np.sin(angle), time_from_start=lasting(time))
        for field in lacking:
            setattr(point, field, [])
        found.points.append(point)
    return found


def lasting(time: float) -> Duration:
    return Duration(sec=int(time), nanosec=round(time % 1 * 1e9))


def test_joints_may_come_in_any_order() -> None:
    angle = TIMES[:, None] * RATES
    for order in ((0, 1, 2), (2, 0, 1), (1, 0, 2)):
        found: Any = READER.of_message(message(order), 7)
        assert found.start == 7
        np.testing.assert_array_equal(found.offsets, np.round(1e9 * TIMES))
        np.testing.assert_allclose(found.motion.position, np.sin(angle), atol=1e-15)
        np.testing.assert_allclose(found.motion.velocity, RATES * np.cos(angle), atol=1e-15)
        np.testing.assert_allclose(found.motion.acceleration, -RATES ** 2 * np.sin(angle),
                                   atol=1e-14)


def test_a_stamp_is_the_start() -> None:
    stamped = message()
    stamped.header.stamp = Time(sec=12, nanosec=34)
    assert READER.of_message(stamped, 7).start == 12_000_000_034


@pytest.mark.parametrize('lacking', [('accelerations',), ('velocities', 'accelerations')])
def test_derivatives_that_are_missing_are_those_of_a_spline_through_the_positions(
    lacking: tuple[str, ...],
) -> None:
    found: Any = READER.of_message(message((0, 1, 2), *lacking), 7, 'spline')
    angle = TIMES[:, None] * RATES
    np.testing.assert_allclose(found.motion.velocity, RATES * np.cos(angle), atol=1e-4)
    np.testing.assert_allclose(found.motion.acceleration, -RATES ** 2 * np.sin(angle), atol=2e-2)
    if len(lacking) == 1:  # what is given is kept
        np.testing.assert_allclose(found.motion.velocity, RATES * np.cos(angle), atol=1e-15)


def test_what_is_missing_is_rejected_where_no_spline_is_asked_for() -> None:
    with pytest.raises(Rejection, match='point 0 has 0 accelerations, must have 3'):
        READER.of_message(message((0, 1, 2), 'accelerations'), 7)


@pytest.mark.parametrize('names', [JOINTS[:2], (*JOINTS, 'gripper'), ('a', 'b', 'c'),
                                   ('shoulder', 'shoulder', 'wrist')])
def test_other_joints_are_rejected(names: tuple[str, ...]) -> None:
    wrong = message()
    wrong.joint_names = list(names)
    with pytest.raises(Rejection, match='must hold each of shoulder, elbow, wrist once'):
        READER.of_message(wrong, 7)


def test_a_robot_with_loops_takes_its_drives_and_poses_of_its_tool_in_its_frame() -> None:
    model = DriveModel.load('config/hexapod.yaml')
    own = RobotNames.of(model)
    base = str(model.values['robot.base'])
    for names, frame in ((None, base), (own._replace(frame='cell'), 'cell')):
        readers = readers_for(model, names)
        assert set(readers) == {TRAJECTORY, POSES}
        still = JointTrajectory(joint_names=list(own.joints), points=[JointTrajectoryPoint(
            positions=[0.0] * 6, velocities=[0.0] * 6, accelerations=[0.0] * 6)])
        found = readers[TRAJECTORY].read(serialize_message(still), 7, 'reject')
        assert type(found.motion) is model.robot.motions[0]
        pose = MultiDOFJointTrajectory(
            joint_names=[model.robot.structure.tool],
            points=[MultiDOFJointTrajectoryPoint(transforms=[Transform()]) for _ in range(4)])
        for k, point in enumerate(pose.points):
            point.time_from_start = lasting(0.1 * k)
        for given in ('', frame):
            pose.header.frame_id = given
            found = readers[POSES].read(serialize_message(pose), 7, 'spline')
            assert type(found.motion) is model.robot.motions[1]
        pose.header.frame_id = 'elsewhere'
        with pytest.raises(Rejection, match=f"must be '{frame}' or empty"):
            readers[POSES].read(serialize_message(pose), 7, 'spline')
