# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How wrong a model is on recordings, and where."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.api.inputs import Inputs, Model, Progress, Recordings, stage
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.app.report.comparison_report import comparison_page, comparison_view
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.pictures import plot_errors, plot_series
from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.diagnosis.comparison import Beside, Comparison, localise
from pprs_dynamics.inference.diagnosis.comparison import compare as compare_residuals
from pprs_dynamics.inference.diagnosis.next_step import first_step, measure_first
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.inference.readings.findings import effort_looks_like, no_measurements
from pprs_dynamics.inference.residuals.comparison_bag import write_comparison
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import Residuals, rms, rms_by_drive
from pprs_dynamics.inference.search.explained_effort import little_explained
from pprs_dynamics.inference.search.noise_floors import measure_columns, noise_floors
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.plain_text import displayed

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure


@dataclass(frozen=True, repr=False, eq=False)
class ComparisonResult(Result):
    """What `pprs compare` says.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    residuals : Residuals
        Measured minus model, sample by sample.
    comparison : Comparison
        The numbers.
    notes : tuple of str
        How it was computed.
    beside : Beside, optional
        Errors of another model on the same recordings.
    """

    inputs: Inputs
    residuals: Residuals
    comparison: Comparison
    notes: tuple[str, ...]
    beside: Beside | None = None

    @property
    def rms(self) -> float:
        """Error over all drives and samples [N]."""
        return self.comparison.rms

    @property
    def verdict(self) -> str:
        """How good the model is, in one sentence."""
        return self.comparison.verdict

    @property
    def where(self) -> tuple[Statement, ...]:
        """Where it fails, what explains most of the squared error first."""
        return self.comparison.where

    def to_dict(self) -> dict[str, Any]:
        """Return what `pprs compare --json` writes."""
        content = {**self.comparison.to_dict(), 'verdict': self.verdict,
                   'effort_looks_like': effort_looks_like(
                       recording.findings for recording in self.inputs.fitted)}
        return content if self.beside is None else {**content, 'beside': self.beside.to_dict()}

    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows."""
        return comparison_view(self.comparison, self._next, details, self.beside)

    def page(self) -> Page:
        """Return the page of `pprs compare --report`."""
        return comparison_page(self.inputs.model, self.inputs.fitted, self.residuals,
                               self.comparison, self.notes, self._next, self.beside)

    def write_bag(self, path: str | PathLike[str], progress: Progress | None = None) -> None:
        """Write measured effort, model, parts and residual as a bag, .mcap or .db3.

        Raises
        ------
        PprsError
            Where it cannot be written.
        """
        write_comparison(Path(path), self.inputs.model, self.inputs.fitted,
                         [self.verdict, *(statement.text for statement in self.where)],
                         stage(progress, 'bag'))

    def table(self) -> DataFrame:
        """Return a row per drive: rms, bias, peak, noise [N], relative error and grade."""
        drives = self.comparison.drives
        return data_frame([{'rms': drive.rms, 'relative': drive.relative, 'bias': drive.bias,
                            'peak': drive.peak, 'noise': drive.noise_floor, 'grade': drive.grade,
                            'unit': drive.unit} for drive in drives.values()],
                          list(drives), 'drive')

    def plot(self) -> Figure:
        """Return a picture: error and noise of every drive, and the worst drive over time."""
        drives = self.comparison.drives
        figure = plot_errors(
            {'error': {name: drive.rms for name, drive in drives.items()},
             'noise': {name: drive.noise_floor for name, drive in drives.items()
                       if drive.noise_floor is not None}},
            self.comparison.unit, rows=2)
        worst = max(drives, key=lambda name: drives[name].unexplained)
        d, residuals = self.residuals.drives.index(worst), self.residuals
        plot_series(figure.axes[1], residuals.time,
                    {'measured': residuals.measured[:, d],
                     'measured minus model': residuals.error[:, d]},
                    f'{worst} [{drives[worst].unit}]')
        return figure

    @property
    def _next(self) -> tuple[str, str]:
        other = no_measurements(recording.findings for recording in self.inputs.fitted)
        if other and not self.inputs.as_it_is:
            return measure_first(other, self.inputs.files)
        if self.comparison.little:
            return first_step(self.inputs.model, self.inputs.files, next(iter(self.where), None))
        return ('Find out which physical effect is missing',
                self.inputs.files.command('diagnose', '--report', 'why.html'))


def compare(model: Model, recordings: Recordings, *, topic: str | None = None,
            beside: str | PathLike[str] | None = None, progress: Progress | None = None,
            as_it_is: bool = False) -> ComparisonResult:
    """Hold a model against recordings: how wrong it is, on which drive, in which situations.

    Parameters
    ----------
    model : DriveModel or path
    recordings : path, Recording, or a sequence of them
        A path is read, and its units and signs are checked; a Recording is not checked.
    topic : str, optional
        Of sensor_msgs/JointState, where a bag holds several.
    beside : path, optional
        Another model file, compared with the same recordings.
    progress : callable, optional
        Called with what is being done and the share of it that is done.
    as_it_is : bool
        Whether files are taken as their names and units say, whatever they look like.

    Returns
    -------
    ComparisonResult

    Raises
    ------
    PprsError
        For files that cannot be read, or that look as if they were in other units or signs than
        they say, and a motion that the model cannot follow.

    Examples
    --------
    >>> print(compare('config/paper.yaml', 'run.mcap'))  # doctest: +SKIP
    """
    inputs = Inputs.of(
        model, recordings, (), topic, progress, whole=True,
        as_it_is=as_it_is).require_recordings()
    measuring = stage(progress, 'motion and model')
    columns, residuals, notes = measure_columns(inputs.model, inputs.fitted, measuring)
    where = localise(residuals, progress=stage(progress, 'where it fails'))
    comparison = compare_residuals(
        residuals, where,
        noise_floors(columns, residuals.period) if columns else {},
        little_explained(inputs.model, residuals))
    return ComparisonResult(
        inputs, residuals, comparison, tuple(notes),
        None if beside is None else _beside(inputs, Path(beside)))


def _beside(inputs: Inputs, path: Path) -> Beside:
    """Return the errors of another model on the same recordings."""
    other = DriveModel.load(path)
    if other.drives != inputs.model.drives:
        raise ModelError('--beside', displayed(path), 'have the drives of the model: '
                         f'{", ".join(inputs.model.drives)}')
    residuals, _ = measure_residuals(other, inputs.fitted)
    return Beside(displayed(path.name), rms_by_drive(residuals), rms(residuals))
