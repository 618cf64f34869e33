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

"""Work on drives side by side: numpy lets go of the interpreter while it computes."""

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
