# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""CSV files of designed motions: poses of a platform, or positions of an arm's joints."""

from __future__ import annotations

from os import PathLike

from pprs_dynamics.measurement.joint_motion_files import write_joint_motion
from pprs_dynamics.measurement.pose_files import write_poses
from pprs_dynamics.mechanism.joint_motion import JointMotion
from pprs_dynamics.mechanism.motion import PlatformMotion


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
