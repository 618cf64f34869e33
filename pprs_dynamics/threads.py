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

"""One thread for linear algebra: the arrays here are small, and threads would only wait.

On a busy machine of two cores, several threads made the search for where a model fails ten
times slower, and they disturb a node's timing.
"""

from __future__ import annotations

import os


def use_one_thread() -> None:
    """Tell numpy's libraries so; to be called before numpy is imported. The user's word counts."""
    for library in ('OPENBLAS', 'OMP', 'MKL'):
        os.environ.setdefault(f'{library}_NUM_THREADS', '1')
