# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Dynamics of the 3-PPRS parallel robot with friction in every joint."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pprs_dynamics.errors import PprsError
    from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
    from pprs_dynamics.physics.mechanism.motion import PlatformMotion
    from pprs_dynamics.physics.model.arm_model import ArmModel
    from pprs_dynamics.physics.model.axis_model import AxisModel, AxisMotion
    from pprs_dynamics.physics.model.drive_model import DriveForces, DriveModel, ModelState
    from pprs_dynamics.physics.model.model_file import load_model

__all__ = ['ArmModel', 'AxisModel', 'AxisMotion', 'DriveForces', 'DriveModel', 'JointMotion',
           'ModelState', 'PlatformMotion', 'PprsError', 'load_model']
__version__ = '0.1.0'

# Loaded at first use: `pprs --help` and a node's refusal need neither numpy nor a model.
_HOMES = {
    'ArmModel': 'pprs_dynamics.physics.model.arm_model',
    'AxisModel': 'pprs_dynamics.physics.model.axis_model',
    'AxisMotion': 'pprs_dynamics.physics.model.axis_model',
    'JointMotion': 'pprs_dynamics.physics.mechanism.joint_motion',
    'DriveForces': 'pprs_dynamics.physics.model.drive_model',
    'DriveModel': 'pprs_dynamics.physics.model.drive_model',
    'ModelState': 'pprs_dynamics.physics.model.drive_model',
    'PlatformMotion': 'pprs_dynamics.physics.mechanism.motion',
    'PprsError': 'pprs_dynamics.errors',
    'load_model': 'pprs_dynamics.physics.model.model_file',
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(_HOMES[name]), name)
