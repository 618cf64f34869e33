# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Reads the MAT files of EMPS as recordings: python docs/emps.py [FOLDER] [OUTPUT FOLDER].

The data is not part of the package: it is in ../shared/data/emps, or in emps below the folder that
PPRS_DATA names. Cite A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS,
Workshop on Nonlinear System Identification Benchmarks, 2019.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from scipy.io import loadmat

from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.three_pprs.robot import AXIS

IDENTIFICATION, PULSES = 'DATA_EMPS.mat', 'DATA_EMPS_PULSES.mat'


def find_data() -> Path | None:
    """Return the folder of the MAT files, None where there is none."""
    places = [Path(__file__).resolve().parents[2] / 'shared/data/emps']
    if 'PPRS_DATA' in os.environ:
        given = Path(os.environ['PPRS_DATA'])
        places = [given / 'emps', given, *places]
    return next((place for place in places if (place / IDENTIFICATION).is_file()), None)


def read_emps(path: Path) -> Recording:
    """Return a MAT file as a recording: measured position, and voltage times its force constant.

    `pulses_N` is no part of the force: the voltage holds the pulses already.
    """
    content = loadmat(path)
    force = content['gtau'].item() * content['vir']
    return Recording.from_arrays(path.stem, content['t'][:, 0], content['qm'], None, force, (AXIS,))


def main(folder: Path | None, output: Path) -> None:
    """Write both files as CSV."""
    if folder is None:
        sys.exit('no EMPS data: ../shared/data/emps does not hold it, and PPRS_DATA names no '
                 'folder that does')
    for name in (IDENTIFICATION, PULSES):
        recording = read_emps(folder / name)
        write_recording(output / f'{recording.name}.csv', recording)
        print(output / f'{recording.name}.csv')


if __name__ == '__main__':
    arguments = [Path(argument) for argument in sys.argv[1:]]
    main(arguments[0] if arguments else find_data(),
         arguments[1] if len(arguments) > 1 else Path())
