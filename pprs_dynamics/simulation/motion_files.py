# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""CSV files of designed motions: poses of a platform, or positions of joints.

Platform: `time,x,y,z,qx,qy,qz,qw` and, optionally, the twists
`vx,vy,vz,wx,wy,wz,ax,ay,az,alx,aly,alz`: velocity, angular velocity, acceleration and angular
acceleration of o in `base`. Without them a spline through the poses gives them.

Joints: `time` and `<joint>/position`, `<joint>/velocity`, `<joint>/acceleration` of each.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from pprs_dynamics.errors import MotionError, UnreadableFileError
from pprs_dynamics.measurement.files.csv_files import CsvTable
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.system.csv_tables import write_table
from pprs_dynamics.system.files import require_file

POSE_COLUMNS = ('time', 'x', 'y', 'z', 'qx', 'qy', 'qz', 'qw')
TWIST_COLUMNS = ('vx', 'vy', 'vz', 'wx', 'wy', 'wz', 'ax', 'ay', 'az', 'alx', 'aly', 'alz')
QUANTITIES = ('position', 'velocity', 'acceleration')  # of a joint


def read_poses(path: str | PathLike[str]) -> PlatformMotion:
    """Return the motion in a CSV of poses, columns in any order.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read, a column is missing or unknown, or a cell is not a number.
    MotionError
        Where the poses are no motion: non-finite, off unit length, times not increasing.
    """
    require_file(path)
    table = CsvTable.open(Path(path))
    columns = _columns(path, table.names)
    numbers = np.stack(table.read(columns), axis=1)
    time, position, orientation = numbers[:, 0], numbers[:, 1:4], numbers[:, 4:8]
    try:
        if columns == POSE_COLUMNS:
            return PlatformMotion.from_poses(time, position, orientation)
        v, omega, a, epsilon = np.split(numbers[:, 8:], 4, axis=1)
        return PlatformMotion(position, orientation, v, omega, a, epsilon, time)
    except MotionError as error:
        raise MotionError(f'{path}: {error.quantity}', error.found, error.rule,
                          error.kind) from None


def write_motion(path: str | PathLike[str], drives: tuple[str, ...],
                 motion: PlatformMotion | JointMotion) -> None:
    """Write a motion with times, exact to the last digit; `drives` are the joints' names.

    Raises
    ------
    UnreadableFileError
        Where it cannot be written.
    """
    assert motion.time is not None
    if isinstance(motion, JointMotion):
        names = [f'{joint}/{name}' for joint in drives for name in QUANTITIES]
        table = np.stack([getattr(motion, name) for name in QUANTITIES], axis=-1)
        columns = [table.reshape(len(motion), -1)]
    else:
        names = [*POSE_COLUMNS[1:], *TWIST_COLUMNS]
        columns = [motion.position, motion.orientation, motion.linear_velocity,
                   motion.angular_velocity, motion.linear_acceleration,
                   motion.angular_acceleration]
    write_table(path, ['time', *names], [motion.time, *columns])


def _columns(path: object, header: list[str]) -> tuple[str, ...]:
    missing = [name for name in POSE_COLUMNS if name not in header]
    if missing:
        raise UnreadableFileError(
            path, f'not a file of poses: the header must contain {",".join(POSE_COLUMNS)}, '
            f'but {missing[0]} is missing')
    unknown = [name for name in header if name not in POSE_COLUMNS + TWIST_COLUMNS]
    if unknown or len(set(header)) < len(header):
        name = unknown[0] if unknown else max(header, key=header.count)
        raise UnreadableFileError(path, f'the column {name!r} is unknown or occurs twice')
    twists = [name for name in TWIST_COLUMNS if name in header]
    if twists and len(twists) < len(TWIST_COLUMNS):
        raise UnreadableFileError(
            path, f'of the columns {",".join(TWIST_COLUMNS)} all or none must be there')
    return POSE_COLUMNS + tuple(twists)
