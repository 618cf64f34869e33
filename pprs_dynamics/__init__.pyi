# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

from pprs_dynamics.app.api.adopt import (
    AdoptionResult as AdoptionResult,
    AdoptionRunResult as AdoptionRunResult,
    adopt as adopt,
    adopt_all as adopt_all,
)
from pprs_dynamics.app.api.compare import ComparisonResult as ComparisonResult, compare as compare
from pprs_dynamics.app.api.diagnose import DiagnosisResult as DiagnosisResult, diagnose as diagnose
from pprs_dynamics.app.api.fit import FitResult as FitResult, fit as fit
from pprs_dynamics.app.api.next_experiment import (
    ExperimentResult as ExperimentResult,
    next_experiment as next_experiment,
)
from pprs_dynamics.app.api.simulate import (
    SimulationResult as SimulationResult,
    simulate as simulate,
)
from pprs_dynamics.app.workbench.session import Session as Session
from pprs_dynamics.arrays import Array as Array
from pprs_dynamics.errors import (
    EffectError as EffectError,
    LimitError as LimitError,
    MissingLibraryError as MissingLibraryError,
    ModelError as ModelError,
    MotionError as MotionError,
    PprsError as PprsError,
    SingularityError as SingularityError,
    UnknownNameError as UnknownNameError,
    UnreadableFileError as UnreadableFileError,
    WorkspaceError as WorkspaceError,
)
from pprs_dynamics.measurement.files.recording import (
    Recording as Recording,
    read_recording as read_recording,
    write_recording as write_recording,
)
from pprs_dynamics.physics.effects.drive_effect import (
    DriveEffect as DriveEffect,
    DriveRange as DriveRange,
    DriveSamples as DriveSamples,
    MeasurementEffect as MeasurementEffect,
)
from pprs_dynamics.physics.effects.effect import (
    CatalogueEffect as CatalogueEffect,
    Parameter as Parameter,
)
from pprs_dynamics.physics.effects.structure_effect import StructureEffect as StructureEffect
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion as JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion as PlatformMotion
from pprs_dynamics.physics.mechanism.paths import (
    Excitation as Excitation,
    HelicalPath as HelicalPath,
)
from pprs_dynamics.physics.model.drive_model import DriveModel as DriveModel
from pprs_dynamics.physics.model.forces import Forces as Forces, ModelState as ModelState

__version__: str
