# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Measures of the package: how often it is right, how fast it is, what its node survives.

Each is a module, run from the project's folder: `python -m benchmarks.scores.diagnosis`.
"""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OUTPUT = ROOT / 'output'

# The arrays are small: threads of the linear algebra would only wait for one another.
for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ.setdefault(f'{library}_NUM_THREADS', '1')
# Helpers of tests and demonstrations serve here, too: processes of nodes, engines, a browser.
sys.path[:0] = [str(ROOT / folder) for folder in ('test', 'test/support', 'demo')
               if str(ROOT / folder) not in sys.path]
