# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""CSV files of designed motions: poses of a platform, or positions of an arm's joints."""

from __future__ import annotations

from os import PathLike

from pprs_dynamics.measurement.files.joint_motion_files import write_joint_motion
from pprs_dynamics.measurement.files.pose_files import write_poses
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion


def write_motion(path: str | PathLike[str], drives: tuple[str, ...],
                 motion: PlatformMotion | JointMotion) -> None:
    """Write a motion with times.

    Raises
    ------
    UnreadableFileError
        Where it cannot be written.
    """
    if isinstance(motion, JointMotion):
        write_joint_motion(path, drives, motion)
    else:
        write_poses(path, motion)
