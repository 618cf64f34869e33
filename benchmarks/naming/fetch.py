# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Fetches recordings of real machines from their sources, for `benchmarks.naming.real`.

    python -m benchmarks.naming.fetch FOLDER        # then: export PPRS_DATA=FOLDER

UR10e (S. Mamedov) and da Vinci (Y. Wang et al., RA-L 2019) carry no licence: they are yours to
measure with, and not ours to ship. EMPS (A. Janot, M. Gautier, M. Brunot, 2019) is on
nonlinearbenchmark.org: put its two MAT files into FOLDER/emps. What has another checksum than it
had is refused.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import io
import sys
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

UR10E_JOINTS = ('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint', 'wrist_1_joint',
                'wrist_2_joint', 'wrist_3_joint')
PSM_JOINTS, PSM_SENSORS = ('yaw', 'pitch', 'insertion'), 7
RAW = 'https://raw.githubusercontent.com'
UR10E = f'{RAW}/shamilmamedov/dynamic_calibration/11af40e7deb758ec080a175fed8fcdd6c99aca29'
PSM = f'{RAW}/WPI-AIM/dvrk_dynamics_identification/7697d3a6c90866c1846f0d3054d7f78384ab1ef9/data'


@dataclass(frozen=True)
class Source:
    """One file, where it is and what becomes of it.

    Parameters
    ----------
    address, sha256 : str
    target : str
        Below the folder.
    convert : callable
        From its bytes to those of the target.
    """

    address: str
    sha256: str
    target: str
    convert: Callable[[bytes], bytes] = lambda content: content


def _table(columns: Mapping[str, np.ndarray], digits: Sequence[str]) -> bytes:
    text = io.StringIO()
    np.savetxt(text, np.column_stack(list(columns.values())), fmt=list(digits), delimiter=',',
               header=','.join(columns), comments='')
    return gzip.compress(text.getvalue().encode(), mtime=0)


def ur10e(content: bytes) -> bytes:
    """Return a run of the UR10e as CSV: time, positions [rad], speeds, currents [A]."""
    raw = np.loadtxt(io.BytesIO(content), delimiter=',')
    columns = {'time': raw[:, 0]}
    for k, joint in enumerate(UR10E_JOINTS):
        for at, what in ((1, 'position'), (7, 'velocity'), (13, 'current')):
            columns[f'{joint}/{what}'] = raw[:, at + k]
    return _table(columns, ['%.4f', *(['%.7g'] * (len(columns) - 1))])


def psm(rate: float) -> Callable[[bytes], bytes]:
    """Return what makes a CSV of a run of the da Vinci arm, logged at a rate [Hz]."""
    def convert(content: bytes) -> bytes:
        raw = np.loadtxt(io.BytesIO(content), delimiter=',')
        columns = {'time': np.arange(len(raw)) / rate}
        for k, joint in enumerate(PSM_JOINTS):
            for number, what in enumerate(('position', 'velocity', 'effort')):
                columns[f'{joint}/{what}'] = raw[:, PSM_SENSORS * number + k]
        return _table(columns, ['%.3f', *(['%.9g'] * (len(columns) - 1))])
    return convert


SOURCES = (
    Source(f'{UR10E}/dataset_ur10e/identification_data/ur-20_02_10-30sec_12harm.csv',
           '341fff80f177be564c8720ea898165addfd46d7cbe6f3ffd8923eeaae0eef000',
           'ur10e/free_30s_12harm.csv.gz', ur10e),
    Source(f'{UR10E}/dataset_ur10e/identification_data/ur-20_02_12-40sec_12harm.csv',
           '1355f739afecc5a9330f906e0c403be0080407f5ce2c26652556fac5748c6236',
           'ur10e/free_40s_12harm.csv.gz', ur10e),
    Source(f'{UR10E}/dataset_ur10e/identification_data/ur-20_02_12-50sec_12harm.csv',
           'bb48cca42716a88f8b255d2d1b3eb3fa4a6eac4a9a52b694d4c1066ce8b4ca51',
           'ur10e/free_50s_12harm.csv.gz', ur10e),
    Source(f'{UR10E}/dataset_ur10e/identification_data/ur-20_02_19_14harm50sec.csv',
           'cd503afc985c41a6ad8fbe47d443c961eadbde4822a87ff3e17adcb2a24fa103',
           'ur10e/free_50s_14harm.csv.gz', ur10e),
    Source(f'{UR10E}/dataset_ur10e/identification_data/ur-20_02_19_14harm50secLoad.csv',
           'e689a99e5ff00ac38d03a2b9302e77688de0db8388b1d9c0e6aad3f77962758c',
           'ur10e/load_50s_14harm.csv.gz', ur10e),
    Source(f'{UR10E}/URe/urdf/ur10e.urdf',
           '0d2abc6ebc70725c691a35aa6c2d03fd6e8158017a1b7da7a10a3ef52de7b821',
           'ur10e/ur10e.urdf'),
    Source(f'{PSM}/psm/measured_trajectory/one_results.csv',
           '918ed2f56fec574c4ba0bf7af47fb73aea5f3b3b59506802ca0c698b41f8514e',
           'dvrk/free_one_b.csv.gz', psm(200.0)),
    Source(f'{PSM}/psm_simplified/measured_trajectory/one_results_1.0_scale_105_grams_insertion.csv',
           '0f2377ef3c7517a05cb3bbe92334eabb643728c9a559a6d2a9f074b22adac854',
           'dvrk/load_insertion_105_fast.csv.gz', psm(200.0)),
    Source(f'{PSM}/psm_simplified/measured_trajectory/one_results_0.5_scale_105_grams_insertion.csv',
           'b078e642d4e7c21df127fe7e21a7b2333c4bd56122b6a17823b03701f9e28a85',
           'dvrk/load_insertion_105_slow.csv.gz', psm(100.0)),
    Source(f'{PSM}/psm_simplified/measured_trajectory/one_results_1.0_scale_105_grams_parallel.csv',
           'c6370e71c451be260cf6b2cb0df0ee25d4cb796e2ab0faf1c1818e27dfae3a0d',
           'dvrk/load_parallel_105_fast.csv.gz', psm(200.0)),
    Source(f'{PSM}/psm_simplified/measured_trajectory/one_results_0.5_scale_105_grams_parallel.csv',
           '31c78632def6143f6dc56dd734fbf632ed5a3b3e8fa5ba8bb2dfaa62c96e9e7b',
           'dvrk/load_parallel_105_slow.csv.gz', psm(100.0)),
)


def main() -> int:
    """Fetch what is not there yet."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folder', type=Path)
    folder, failed = parser.parse_args().folder, 0
    for source in SOURCES:
        target = folder / source.target
        if target.exists():
            continue
        try:
            with urllib.request.urlopen(source.address) as answer:
                content = answer.read()
        except OSError as error:
            print(f'{source.target}: {source.address}: {error}', file=sys.stderr)
            failed += 1
            continue
        if (found := hashlib.sha256(content).hexdigest()) != source.sha256:
            print(f'{source.target}: sha256 of {source.address} is {found}, must be '
                  f'{source.sha256}', file=sys.stderr)
            failed += 1
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(source.convert(content))
        print(target)
    return min(failed, 1)


if __name__ == '__main__':
    sys.exit(main())
