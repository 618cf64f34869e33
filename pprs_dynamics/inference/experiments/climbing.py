# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The search among motions within limits: random steps from the best of many, ever smaller.

The value of a motion is rough, since drives turn over in a millimetre per second: no slopes are
taken.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

STEPS = 160
FIRST, LAST = 0.3, 0.03  # size of the steps, relative to the largest coefficient

Motion = TypeVar('Motion')
"""Of an arm or a platform."""


def climb(
    start: Motion, beside: Callable[[Motion, float, np.random.Generator], Motion],
    value: Callable[[Motion], float], random: np.random.Generator,
    progress: Callable[[float], None] = lambda share: None,
) -> Motion:
    """Return the motion of the largest value that is found from a start.

    Parameters
    ----------
    start : Motion
        Within the limits.
    beside : callable
        Returns a motion within the limits that differs by a step of some size.
    value : callable
    random : Generator
    progress : callable, optional
        Called with the share that is done.
    """
    best, most = start, value(start)
    for k in range(STEPS):
        progress(k / STEPS)
        tried = beside(best, FIRST + (LAST - FIRST) * k / STEPS, random)
        found = value(tried)
        if found > most:
            best, most = tried, found
    return best
