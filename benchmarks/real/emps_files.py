# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Read the MAT files of EMPS as recordings.

    python -m benchmarks.real.emps_files [FOLDER] [OUTPUT FOLDER]

The data is not part of the package: it is in ../shared/data/emps, or in emps below the folder that
PPRS_DATA names. Cite A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS,
Workshop on Nonlinear System Identification Benchmarks, 2019.
"""

from __future__ import annotations

import sys
from pathlib import Path

from scipy.io import loadmat

from benchmarks.real.recorded_data import need_data
from pprs_dynamics.measurement.files.recording import Recording, write_recording

AXIS = 'axis'

IDENTIFICATION, PULSES = 'DATA_EMPS.mat', 'DATA_EMPS_PULSES.mat'


def read_emps(path: Path) -> Recording:
    """Return a MAT file as a recording: measured position, and voltage times its force constant.

    `pulses_N` is no part of the force: the voltage contains the pulses already.
    """
    content = loadmat(path)
    force = content['gtau'].item() * content['vir']
    return Recording.from_arrays(path.stem, content['t'][:, 0], content['qm'], None, force, (AXIS,))


def main(folder: Path, output: Path) -> None:
    """Write both files as CSV."""
    for name in (IDENTIFICATION, PULSES):
        recording = read_emps(folder / name)
        write_recording(output / f'{recording.name}.csv', recording)
        print(output / f'{recording.name}.csv')


if __name__ == '__main__':
    arguments = [Path(argument) for argument in sys.argv[1:]]
    main(arguments[0] if arguments else need_data('emps', IDENTIFICATION),
         arguments[1] if len(arguments) > 1 else Path())
