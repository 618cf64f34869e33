# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Which message asks a model for forces, and how it is read."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.model.arm_model import ArmModel
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.ros.messages.cdr_validation import message_in
from pprs_dynamics.ros.messages.conversions import PLATFORM
from pprs_dynamics.ros.messages.joint_request import read_joint_trajectory
from pprs_dynamics.ros.messages.robot_names import RobotNames
from pprs_dynamics.ros.messages.serialisation import trajectories_have_known_bytes
from pprs_dynamics.ros.messages.trajectory_request import (
    TrajectoryRequest,
    read_serialised,
    read_trajectory,
)

TRAJECTORY, POSES = '~/trajectory', '~/pose_trajectory'


class RequestReader(NamedTuple):
    """How requests arrive.

    Parameters
    ----------
    message : type
    read : callable
        Bytes, time of arrival [ns], largest age [s] and what to do about missing derivatives ->
        TrajectoryRequest; see `read_trajectory`.
    """

    message: type
    read: Callable[[bytes, int, float, str], TrajectoryRequest]


def readers_for(model: ForceModel, names: RobotNames | None = None) -> dict[str, RequestReader]:
    """Return how trajectories for a model arrive, by topic.

    A robot with loops takes the motion of its drives, and beside it that of its tool where the
    tool's pose determines the drives.
    """
    readers = {TRAJECTORY: reader_for(model, names)}
    if isinstance(model, ArmModel):
        try:
            tool = model.tool_pose.structure.tool
        except ModelError:
            return readers
        readers[POSES] = _poses((names and names.frame) or str(model.values[f'{model.block}.base']),
                                tool)
    return readers


def reader_for(model: ForceModel, names: RobotNames | None = None) -> RequestReader:
    """Return how trajectories for a model arrive, by the names of its robot."""
    joints, frame = names or RobotNames.of(model)
    if isinstance(model, ArmModel):
        return RequestReader(JointTrajectory, lambda data, *rules: read_joint_trajectory(
            message_in(data, JointTrajectory), joints, *rules))
    if trajectories_have_known_bytes():
        return RequestReader(MultiDOFJointTrajectory, partial(read_serialised, frame=frame))
    return _poses(frame, PLATFORM)


def _poses(frame: str, body: str) -> RequestReader:
    return RequestReader(MultiDOFJointTrajectory, lambda data, now, age, missing: read_trajectory(
        message_in(data, MultiDOFJointTrajectory), now, age, missing, frame, body))
