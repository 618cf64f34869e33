# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Thread pool over drives; NumPy releases the interpreter lock while it computes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

WORKERS = min(os.cpu_count() or 1, 6)

Item = TypeVar('Item')
Result = TypeVar('Result')


def each(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return the function of every item, in order; the first error is raised."""
    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(function, items))
