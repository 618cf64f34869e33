# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""From the drives' motion to that of what they move: a platform, or nothing but the axis itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ConvergenceError
from pprs_dynamics.measurement.files.samples import Progress
from pprs_dynamics.measurement.motion.drive_motion import DriveMotion
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.arm_model import ArmModel
from pprs_dynamics.physics.model.axis_model import AxisModel
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.three_pprs.forward_motion import find_pose_jumps, solve_forward_motion
from pprs_dynamics.physics.three_pprs.robot import Geometry

CHUNK = 16_000  # samples at a time; a million at once would take gigabytes
Motion = PlatformMotion | JointMotion


class FollowedMotion(NamedTuple):
    """Motion of N samples without times, nearness to another branch (N,), and jumps (J,)."""

    motion: Motion
    near_branch: np.ndarray
    jumps: np.ndarray

    def notes(self, time: Array) -> list[str]:
        """Return what was found, in words; time (N,) [s]."""
        notes = []
        if np.any(self.near_branch):
            notes.append(
                f'{int(self.near_branch.sum())} samples lie near another solution of the forward '
                'kinematics, where small errors of positions matter most')
        if len(self.jumps):
            notes.append(f'the pose jumps at {len(self.jumps)} places, first at '
                         f'{time[self.jumps[0]]:.6g} s: forward kinematics may have left its '
                         'branch')
        return notes


def follow(model: ForceModel | Geometry, time: Array, drives: DriveMotion,
           progress: Progress | None = None) -> FollowedMotion:
    """Return the motion that belongs to the drives': of an axis and an arm it is the same.

    Parameters
    ----------
    model : ForceModel or Geometry
        Of any kind, or the geometry of a 3-PPRS.
    time : (N,) array
        [s].
    drives : DriveMotion
    progress : callable, optional
        Called with (samples done, all) now and then.

    Raises
    ------
    ConvergenceError
        Where drive positions do not close the mechanism.
    """
    if isinstance(model, (AxisModel, ArmModel)):
        return FollowedMotion(JointMotion(drives.position, drives.velocity, drives.acceleration),
                              np.zeros(len(time), dtype=bool), np.zeros(0, dtype=int))
    geometry = model.robot.geometry if isinstance(model, DriveModel) else model
    assert isinstance(geometry, Geometry)
    return _follow_platform(geometry, time, drives, progress)


def _follow_platform(geometry: Geometry, time: Array, drives: DriveMotion,
                     progress: Progress | None) -> FollowedMotion:
    """Return the platform's motion by forward kinematics, chunk by chunk."""
    count = len(time)
    arrays = [np.empty((count, width)) for width in (3, 4, 3, 3, 3, 3)]
    near = np.zeros(count, dtype=bool)
    for segment in drives.segments:
        seed = None
        for start in range(segment.start, segment.stop, CHUNK):
            rows = slice(start, min(start + CHUNK, segment.stop))
            try:
                found = solve_forward_motion(
                    geometry, drives.position[rows], drives.velocity[rows],
                    drives.acceleration[rows], seed)
            except ConvergenceError as error:
                sample = start + error.sample
                raise ConvergenceError(
                    int(drives.index[sample]), f'at {time[sample]:.6g} s {error.found}',
                    error.rule) from None
            part = found.motion
            for array, values in zip(arrays, (
                    part.position, part.orientation, part.linear_velocity, part.angular_velocity,
                    part.linear_acceleration, part.angular_acceleration), strict=True):
                array[rows] = values
            near[rows] = found.near_branch
            seed = part[-1:]
            if progress is not None:
                progress(rows.stop, count)
    motion = PlatformMotion(*arrays)
    return FollowedMotion(motion, near, _jumps(motion, time, drives.segments))


def _jumps(motion: PlatformMotion, time: Array, segments: Sequence[slice]) -> np.ndarray:
    jumps = []
    for segment in segments:
        for start in range(segment.start, segment.stop, CHUNK):
            first = max(start - 1, segment.start)  # the step from the last chunk counts too
            rows = slice(first, min(start + CHUNK, segment.stop))
            jump = find_pose_jumps(motion[rows].with_time(time[rows]))
            jumps.append(first + np.flatnonzero(jump))
    return np.concatenate(jumps)
