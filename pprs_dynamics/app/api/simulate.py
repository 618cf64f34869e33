# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a simulated robot with hidden effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.app.api.inputs import Model, Progress, stage
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.app.report.charts import recording_rows
from pprs_dynamics.app.report.figures import recording_page
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.pictures import plot_over_time
from pprs_dynamics.measurement.files.recording import Recording, describe, write_recording
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.paths import Excitation, sampled
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import find_file
from pprs_dynamics.system.plain_text import counted

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure

RATE = 500.0  # [Hz], of the 3-PPRS


@dataclass(frozen=True, repr=False, eq=False)
class SimulationResult(Result):
    """Result of `pprs simulate`.

    Parameters
    ----------
    model : DriveModel
    recording : Recording
        What the sensors said.
    effects : tuple of dict
        Hidden effects: name, drives and parameters of each.
    motion : PlatformMotion or JointMotion
        Where the robot was meant to go.
    rate : float
        Rate of the samples [Hz].
    seed : int
        Seed of noise and effects.
    """

    json_keys = ('samples', 'rate', 'seed', 'effects')

    model: DriveModel
    recording: Recording
    effects: tuple[dict[str, Any], ...]
    motion: PlatformMotion | JointMotion
    rate: float
    seed: int

    def save(self, path: str | PathLike[str]) -> None:
        """Write the recording as .csv, .mcap, .db3, or a rosbag2 folder of any other name.

        Raises
        ------
        UnreadableFileError
            Where it cannot be written.
        """
        write_recording(path, self.recording)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.recording.time)

    def view(self) -> Any:
        """Return the number of samples and of hidden effects, for the terminal."""
        return (f'{self.samples} samples at {self.rate:g} Hz, '
                f'{counted(len(self.effects), "effect")} hidden')

    def page(self) -> Page:
        """Return a page: positions and efforts of every drive over time."""
        return recording_page(self.recording, self.model.units)

    def table(self) -> DataFrame:
        """Return a row per drive: range of position, velocity and effort."""
        return data_frame({name: dict(zip(
            ('lowest_position', 'highest_position', 'lowest_effort', 'highest_effort'),
            (*drive.position, *(drive.effort or (np.nan, np.nan))), strict=True))
            for name, drive in describe(self.recording).drives.items()})

    def plot(self) -> Figure:
        """Return a picture: positions and efforts over time."""
        return plot_over_time(self.recording.time, recording_rows(self.recording, self.model.units))


def simulate(model: Model, effects: str | Sequence[str] = (), *, seed: int = 0,
             motion: PlatformMotion | None = None, duration: float = 40.0,
             path_seed: int = 0, noise: float | None = None,
             progress: Progress | None = None) -> SimulationResult:
    """Record a simulated robot with effects that its model lacks.

    Parameters
    ----------
    model : DriveModel or path
    effects : str or sequence of str
        Names of effects, drawn from the seed; 'random' draws the names, too.
    seed : int
        Of effects and noise.
    motion : PlatformMotion, optional
        Of a 3-PPRS at 500 Hz; by default, and of other robots always, a random one.
    duration : float
        Of the random motion [s].
    path_seed : int
        Of the random motion.
    noise : float, optional
        Standard deviation of the efforts [N m, N]: by default half a percent of the largest.
    progress : callable, optional
        Called with what is being done and the share of it that is done.

    Returns
    -------
    SimulationResult

    Raises
    ------
    MissingLibraryError
        Where mujoco is not installed.
    PprsError
        For an unknown effect, a motion beyond the strokes, or a model that cannot be simulated.
    """
    from pprs_dynamics.simulation.injection import draw_motion, simulate_mechanism

    found = model if isinstance(model, DriveModel) else DriveModel.load(find_file(model))
    names = [effects] if isinstance(effects, str) else list(effects)
    stage(progress, 'preparing the simulation (the first run compiles)')(0.0)
    share_done = stage(progress, 'simulating')
    # With one seed the effects are the same on every path.
    drives = nominal = None
    if not found.robot.plans_poses:
        nominal = draw_motion(found, duration, 0) if path_seed else None
    else:
        if path_seed or motion is not None:
            nominal = _of_drives(found, sampled(Excitation(duration=duration), RATE))
        if motion is None:
            motion = sampled(Excitation(duration=duration, seed=path_seed), RATE)
        drives = _of_drives(found, motion)
    run = simulate_mechanism(
        found, names, seed, noise=noise, duration=duration, path_seed=path_seed,
        progress=share_done, motion=drives, nominal=nominal)
    time = run.motion.time
    assert time is not None
    recording = Recording.from_arrays('simulated', time, run.position, None, run.effort,
                                      found.drives, run.channels)
    return SimulationResult(found, recording, run.effects, motion or run.motion,
                            round(1 / float(np.median(np.diff(time))), 6), seed)


def _of_drives(model: DriveModel, motion: PlatformMotion) -> JointMotion:
    """Return the motion of the drives within their strokes along one of the platform."""
    state = model.mechanism(motion)
    model.limits.check_strokes(state.position)
    return JointMotion(state.position, state.velocity, state.acceleration, motion.time)
