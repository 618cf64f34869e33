# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Design of the motion that best separates the remaining candidates."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.app.api.inputs import (
    Inputs,
    Model,
    Progress,
    Recordings,
    stage,
)
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.app.report.experiment_report import (
    drive_rows,
    experiment_page,
    experiment_view,
    platform_rows,
)
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.pictures import plot_over_time
from pprs_dynamics.inference.experiments.motion_design import MotionLimits
from pprs_dynamics.inference.experiments.next_experiment import Experiment, check_purpose
from pprs_dynamics.inference.experiments.next_experiment import next_experiment as design
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.simulation.motion_files import write_motion

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure

RATE = 100.0  # [Hz], the default of play_trajectory


@dataclass(frozen=True, repr=False, eq=False)
class ExperimentResult(Result):
    """What `pprs next-experiment` designs.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    design : Experiment
        The motion at any time, and what it promises.
    motion : PlatformMotion or JointMotion
        Sampled.
    purpose : {'separate', 'commission'}
    seed : int
        Of the search.
    rate : float
        Of the samples [Hz].
    """

    inputs: Inputs
    design: Experiment
    motion: PlatformMotion | JointMotion
    purpose: str
    seed: int
    rate: float

    def save(self, path: str | PathLike[str]) -> None:
        """Write the motion as a CSV that `play_trajectory` plays.

        Raises
        ------
        UnreadableFileError
            Where it cannot be written.
        """
        write_motion(path, self.inputs.model.drives, self.motion)

    def to_dict(self) -> dict[str, Any]:
        """Return what `pprs next-experiment --json` writes, but for the file's name."""
        return {**self.design.to_dict(), 'purpose': self.purpose, 'seed': self.seed,
                'rate': self.rate}

    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows."""
        return experiment_view(self.design)

    def page(self) -> Page:
        """Return a page: expected evidence, curves, and use of the limits."""
        return experiment_page(self.design, self.motion)

    def table(self) -> DataFrame:
        """Return a row per pair of effects: what a diagnosis would say if the first were true."""
        return data_frame([vars(contest) for contest in self.design.contests])

    def plot(self) -> Figure:
        """Return a picture: where the platform or every joint goes."""
        motion = self.motion
        assert motion.time is not None
        return plot_over_time(motion.time, drive_rows(self.design, motion) if isinstance(
            motion, JointMotion) else platform_rows(motion))


def next_experiment(
    model: Model, recordings: Recordings = (), *, purpose: str = 'separate',
    limits: MotionLimits | None = None, duration: float = 20.0, seed: int = 0,
    noise: float | None = None, rate: float = RATE, topic: str | None = None,
    progress: Progress | None = None,
) -> ExperimentResult:
    """Design the motion that best separates the remaining candidates.

    Parameters
    ----------
    model : DriveModel or path
    recordings : path, Recording, or a sequence of them
    purpose : {'separate', 'commission'}
        What the recordings leave open; or a first motion of a new robot, without recordings.
    limits : MotionLimits, optional
        In addition to those of the model file or the URDF.
    duration : float
        [s]
    seed : int
        Of the search.
    noise : float, optional
        Standard deviation of means of the effort over 0.01 s [N, N m], for 'commission' without
        recordings; by default 1 % of each drive's largest effort.
    rate : float
        Of the samples [Hz].
    topic, progress : optional
        As in `compare`.

    Returns
    -------
    ExperimentResult

    Raises
    ------
    PurposeError
        For 'separate' without recordings.
    NoMotionError
        Where the limits leave no room.
    PprsError
        As `diagnose`.
    """
    inputs = Inputs.of(model, recordings, (), topic, progress)
    check_purpose(purpose, inputs.fitted)
    designed = design(inputs.model, inputs.fitted, purpose, limits, duration, seed, noise,
                      stage(progress, 'designing'))
    count = int(duration * rate + 1e-9) + 1
    return ExperimentResult(inputs, designed, designed.motion(np.arange(count) / rate), purpose,
                            seed, rate)
