# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What `trajectory_proxy` takes from control_msgs, which has no wheel; nothing of it is sent."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from sensor_msgs.msg import JointState
from test_msgs.action import Fibonacci
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory


class FollowJointTrajectory(Fibonacci):  # type: ignore[misc]
    """The action, with the type support of another one: a server can be made."""

    @dataclass
    class Goal:
        trajectory: JointTrajectory = field(default_factory=JointTrajectory)
        multi_dof_trajectory: MultiDOFJointTrajectory = field(
            default_factory=MultiDOFJointTrajectory)
        path_tolerance: Any = ()
        goal_tolerance: Any = ()
        goal_time_tolerance: Duration = field(default_factory=Duration)

    @dataclass
    class Result:
        SUCCESSFUL, INVALID_GOAL, PATH_TOLERANCE_VIOLATED = 0, -1, -4
        error_code: int = 0
        error_string: str = ''


def install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the package importable in one test."""
    package, action, messages = (ModuleType(f'control_msgs{part}') for part in (
        '', '.action', '.msg'))
    action.FollowJointTrajectory = FollowJointTrajectory  # type: ignore[attr-defined]
    messages.JointTrajectoryControllerState = JointState  # type: ignore[attr-defined]
    for module in (package, action, messages):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.delitem(sys.modules, 'pprs_dynamics.ros.trajectory_proxy', raising=False)
