# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forces of parallel robots with friction in every joint, and which effect a model lacks.

These names are stable; what is behind them may move.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pprs_dynamics.app.api.adopt import (
        AdoptionResult,
        AdoptionRunResult,
        adopt,
        adopt_all,
    )
    from pprs_dynamics.app.api.compare import ComparisonResult, compare
    from pprs_dynamics.app.api.diagnose import DiagnosisResult, diagnose
    from pprs_dynamics.app.api.fit import FitResult, fit
    from pprs_dynamics.app.api.next_experiment import ExperimentResult, next_experiment
    from pprs_dynamics.app.api.simulate import SimulationResult, simulate
    from pprs_dynamics.app.workbench.session import Session
    from pprs_dynamics.arrays import Array
    from pprs_dynamics.errors import (
        EffectError,
        LimitError,
        MissingLibraryError,
        ModelError,
        MotionError,
        PprsError,
        SingularityError,
        UnknownNameError,
        UnreadableFileError,
        WorkspaceError,
    )
    from pprs_dynamics.measurement.files.recording import (
        Recording,
        read_recording,
        write_recording,
    )
    from pprs_dynamics.physics.effects.drive_effect import (
        DriveEffect,
        DriveRange,
        DriveSamples,
        MeasurementEffect,
    )
    from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter
    from pprs_dynamics.physics.effects.structure_effect import StructureEffect
    from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
    from pprs_dynamics.physics.mechanism.motion import PlatformMotion
    from pprs_dynamics.physics.mechanism.paths import Excitation, HelicalPath
    from pprs_dynamics.physics.model.drive_model import DriveModel
    from pprs_dynamics.physics.model.forces import Forces, ModelState

__all__ = ['AdoptionResult', 'AdoptionRunResult', 'Array', 'CatalogueEffect',
           'ComparisonResult', 'DiagnosisResult', 'DriveEffect', 'DriveModel',
           'DriveRange', 'DriveSamples', 'EffectError', 'Excitation', 'ExperimentResult',
           'FitResult', 'Forces', 'HelicalPath', 'JointMotion', 'LimitError',
           'MeasurementEffect', 'MissingLibraryError', 'ModelError', 'ModelState', 'MotionError',
           'Parameter', 'PlatformMotion', 'PprsError', 'Recording', 'Session',
           'SimulationResult', 'SingularityError', 'StructureEffect', 'UnknownNameError',
           'UnreadableFileError', 'WorkspaceError', 'adopt', 'adopt_all', 'compare', 'diagnose',
           'fit', 'next_experiment', 'read_recording', 'simulate', 'write_recording']
__version__ = '0.1.0'

# Loaded at first use: `pprs --help` and a node's refusal need neither numpy nor a model.
_HOMES = {
    'app.api.adopt': ('AdoptionResult', 'AdoptionRunResult', 'adopt', 'adopt_all'),
    'app.api.compare': ('ComparisonResult', 'compare'),
    'app.api.diagnose': ('DiagnosisResult', 'diagnose'),
    'app.api.fit': ('FitResult', 'fit'),
    'app.api.next_experiment': ('ExperimentResult', 'next_experiment'),
    'app.api.simulate': ('SimulationResult', 'simulate'),
    'app.workbench.session': ('Session',),
    'arrays': ('Array',),
    'errors': (
        'EffectError', 'LimitError', 'MissingLibraryError', 'ModelError',
        'MotionError', 'PprsError', 'SingularityError', 'UnknownNameError', 'UnreadableFileError',
        'WorkspaceError'),
    'measurement.files.recording': ('Recording', 'read_recording', 'write_recording'),
    'physics.effects.drive_effect': (
        'DriveEffect', 'DriveRange', 'DriveSamples', 'MeasurementEffect'),
    'physics.effects.effect': ('CatalogueEffect', 'Parameter'),
    'physics.effects.structure_effect': ('StructureEffect',),
    'physics.mechanism.joint_motion': ('JointMotion',),
    'physics.mechanism.motion': ('PlatformMotion',),
    'physics.mechanism.paths': ('Excitation', 'HelicalPath'),
    'physics.model.drive_model': ('DriveModel',),
    'physics.model.forces': ('Forces', 'ModelState'),
}
_MODULES = {name: f'{__name__}.{module}' for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
