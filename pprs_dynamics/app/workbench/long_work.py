# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Work of seconds to minutes, as picklable functions for a worker process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.experiments.next_experiment import next_experiment
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

RATE = 100.0  # of the poses of a designed motion [Hz], the default of play_trajectory
Progress = Callable[[float], None]


@dataclass(frozen=True)
class DesignedMotion:
    """A motion that was designed, sampled.

    Parameters
    ----------
    promise : dict
        What `pprs next-experiment --json` says of it.
    motion : PlatformMotion or JointMotion
    """

    promise: dict[str, Any]
    motion: PlatformMotion | JointMotion


def diagnosed(model: DriveModel, recordings: Sequence[Recording], reference: Reference | None,
              progress: Progress) -> Diagnosis:
    """Return a diagnosis without its searches, which are large."""
    return replace(diagnose(model, recordings, (), progress, reference=reference),
                   selection=None)


def designed(model: DriveModel, recordings: Sequence[Recording], duration: float,
             seed: int, progress: Progress) -> DesignedMotion:
    """Return the motion of `pprs next-experiment`."""
    found = next_experiment(model, recordings, duration=duration, seed=seed, progress=progress)
    count = int(found.duration * RATE + 1e-9) + 1
    return DesignedMotion(found.to_dict(), found.motion(np.arange(count) / RATE))
