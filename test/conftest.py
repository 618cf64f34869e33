# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""One ROS domain per test session, so that runs side by side do not hear each other."""

from __future__ import annotations

import gc
import os
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from discovery import in_a_hurry
from file_budget import pytest_runtest_makereport  # noqa: F401
from hypothesis import settings
from listed_skips import pytest_addoption, pytest_sessionfinish, pytest_terminal_summary  # noqa: F401
from ros_processes import environment, reserve_domain

from pprs_dynamics.system.threads import use_one_thread

use_one_thread()
# A shell's background jobs ignore Ctrl-C, and so would every command that is tested.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# The same examples each time, so that a change is judged by what it changes; `make fuzz` looks
# for new ones, which then become examples of their own.
# None is timed: a busy machine is no defect.
settings.register_profile('same', derandomize=True, deadline=None)
settings.register_profile('new', print_blob=True, deadline=None)
settings.load_profile('same')
_DOMAIN, _HOLDER = reserve_domain()
os.environ.update({name: value for name, value in environment(_DOMAIN).items()
                   if name.startswith('ROS_')})
# What tests keep is theirs.
_CACHE = tempfile.TemporaryDirectory()
os.environ['XDG_CACHE_HOME'] = _CACHE.name
os.environ.update(in_a_hurry(_CACHE.name))


@pytest.fixture(scope='session')
def ros_domain() -> Iterator[int]:
    """Domain id of this session."""
    yield _DOMAIN
    _HOLDER.close()


@pytest.fixture
def package(tmp_path: Path) -> Iterator[ModuleType]:
    """Module of a package whose effects fail on demand, installed for this process."""
    from failing_effects import installed  # with NumPy, which threads are set before

    with installed(tmp_path) as module:
        yield module


@pytest.fixture
def running() -> Iterator[Any]:
    """Bench of a probe that talks to processes."""
    from node_bench import bench  # with rclpy, after the domain is set

    with bench() as probe:
        yield probe


@pytest.fixture(scope='module')
def browser() -> Iterator[Any]:
    """Chromium."""
    from browser import chromium

    with chromium() as running:
        yield running


@pytest.fixture(autouse=True)
def _nothing_to_collect(request: pytest.FixtureRequest) -> None:
    """Keep what earlier tests left out of the garbage collection of nodes in real time."""
    if request.node.get_closest_marker('nodes'):
        gc.collect()
        gc.freeze()
