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

"""CSV files of designed joint motions: `time`, then position, velocity, acceleration of each joint.

The columns are `<joint>/position`, `<joint>/velocity`, `<joint>/acceleration`.
"""

from __future__ import annotations

import csv
import io
from os import PathLike

import numpy as np

from pprs_dynamics.mechanism.joint_motion import JointMotion
from pprs_dynamics.model.atomic_file import write_text

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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(['time', *(f'{joint}/{name}' for joint in joints for name in QUANTITIES)])
    table = np.stack([getattr(motion, name) for name in QUANTITIES], axis=-1)
    rows = np.column_stack((motion.time, table.reshape(len(motion), -1)))
    writer.writerows([repr(value) for value in row] for row in rows.tolist())
    write_text(path, text.getvalue())
