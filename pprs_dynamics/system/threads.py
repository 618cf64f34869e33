# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""One thread for linear algebra: the arrays here are small, and threads would only wait.

On a busy machine of two cores, several threads made the search for where a model fails ten
times slower, and they disturb a node's timing.
"""

from __future__ import annotations

import os


def use_one_thread() -> None:
    """Limit numpy's libraries to one thread, unless the environment says otherwise.

    Call it before numpy is imported.
    """
    for library in ('OPENBLAS', 'OMP', 'MKL'):
        os.environ.setdefault(f'{library}_NUM_THREADS', '1')
