# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The budget of a test file: neither a slow machine nor a noisy measurement fails a run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from file_budget import PACE, SECONDS, over_budget


@pytest.mark.parametrize(('seconds', 'pace', 'fails'), [
    (27.0, 1.0, False), (31.0, 1.0, True), (57.0, 3.0, False), (99.0, 3.0, True)])
def test_only_a_dear_file_fails_on_any_machine(seconds: float, pace: float, fails: bool) -> None:
    reports = [SimpleNamespace(when='teardown', nodeid='test_a.py::test_b', user_properties=[
        (SECONDS, seconds), (PACE, pace)])]
    plugins = SimpleNamespace(get_plugin=lambda name: SimpleNamespace(stats={'': reports}))
    config: Any = SimpleNamespace(pluginmanager=plugins, getoption=lambda *name, **default: 20.0)
    assert over_budget(config) == (['test_a.py'] if fails else [])
