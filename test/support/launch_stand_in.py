# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the launch files take from launch and launch_ros, which have no wheels."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

import pytest


class Recorded:
    """An action or substitution that only has what it was made with."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.arguments, self.options = arguments, options


class LaunchConfiguration(Recorded):
    def perform(self, context: dict[str, str]) -> str:
        return context[self.arguments[0]]


NAMES = {
    'launch': ('LaunchContext', 'LaunchDescription'),
    'launch.actions': ('DeclareLaunchArgument', 'ExecuteProcess', 'LogInfo', 'OpaqueFunction'),
    'launch.conditions': ('IfCondition',),
    'launch.substitutions': ('Command', 'LaunchConfiguration', 'PathJoinSubstitution'),
    'launch_ros': (), 'launch_ros.actions': ('LifecycleNode', 'Node'),
    'launch_ros.parameter_descriptions': ('ParameterValue',),
    'launch_ros.substitutions': ('FindPackagePrefix', 'FindPackageShare')}


def install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the packages importable in one test, where no other package is installed."""
    monkeypatch.setenv('AMENT_PREFIX_PATH', '/nowhere')
    for name, classes in NAMES.items():
        module = ModuleType(name)
        for kind in classes:
            base = LaunchConfiguration if kind == 'LaunchConfiguration' else Recorded
            setattr(module, kind, type(kind, (base,), {}))
        monkeypatch.setitem(sys.modules, name, module)
