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

"""One ROS domain per test session, so that runs side by side do not hear each other."""

from __future__ import annotations

import gc
import os
import tempfile
from collections.abc import Iterator

import pytest
from ros_processes import environment, reserve_domain

from pprs_dynamics.threads import use_one_thread

use_one_thread()
_DOMAIN, _HOLDER = reserve_domain()
os.environ.update({name: value for name, value in environment(_DOMAIN).items()
                   if name.startswith('ROS_')})
# What tests keep is theirs.
_CACHE = tempfile.TemporaryDirectory()
os.environ['XDG_CACHE_HOME'] = _CACHE.name


@pytest.fixture(scope='session')
def ros_domain() -> Iterator[int]:
    """Domain id of this session."""
    yield _DOMAIN
    _HOLDER.close()


@pytest.fixture(autouse=True)
def _nothing_to_collect(request: pytest.FixtureRequest) -> None:
    """Keep what earlier tests left out of the garbage collection of nodes in real time."""
    if request.node.get_closest_marker('nodes'):
        gc.collect()
        gc.freeze()
