# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""CSV files of designed joint motions: `time`, then position, velocity, acceleration of each joint.

The columns are `<joint>/position`, `<joint>/velocity`, `<joint>/acceleration`.
"""

from __future__ import annotations

from os import PathLike

import numpy as np

from pprs_dynamics.measurement.files.csv_tables import write_table
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion

QUANTITIES = ('position', 'velocity', 'acceleration')


def write_joint_motion(path: str | PathLike[str], joints: tuple[str, ...], motion: JointMotion,
                       ) -> None:
    """Write a motion with times.

    Raises
    ------
    UnreadableFileError
        Where it cannot be written.
    """
    assert motion.time is not None
    header = ['time', *(f'{joint}/{name}' for joint in joints for name in QUANTITIES)]
    table = np.stack([getattr(motion, name) for name in QUANTITIES], axis=-1)
    write_table(path, header, [motion.time, table.reshape(len(motion), -1)])
