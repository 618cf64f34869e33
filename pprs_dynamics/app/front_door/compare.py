# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How wrong a model is on recordings, and where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.front_door.inputs import Inputs, Model, Progress, Recordings
from pprs_dynamics.app.front_door.result import Result, data_frame
from pprs_dynamics.inference.diagnosis.comparison import Comparison
from pprs_dynamics.inference.diagnosis.comparison import compare as compare_residuals
from pprs_dynamics.inference.diagnosis.localisation import localise
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.measurement.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.residuals.residuals import Residuals

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from pprs_dynamics.app.report.page import Page


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
    """

    inputs: Inputs
    residuals: Residuals
    comparison: Comparison
    notes: tuple[str, ...]

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
        return {**self.comparison.to_dict(), 'verdict': self.verdict}

    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows."""
        from pprs_dynamics.app.report.tables import comparison_view

        return comparison_view(self.comparison, self._next, details)

    def page(self) -> Page:
        """Return the page of `pprs compare --report`."""
        from pprs_dynamics.app.report.comparison_page import comparison_page

        return comparison_page(self.inputs.model, self.inputs.fitted, self.residuals,
                               self.comparison, self.notes, self._next)

    def table(self) -> pd.DataFrame:
        """Return a row per drive: rms, bias, peak, noise [N], relative error and grade."""
        drives = self.comparison.drives
        return data_frame([{'rms': one.rms, 'relative': one.relative, 'bias': one.bias,
                            'peak': one.peak, 'noise': one.noise_floor, 'grade': one.grade,
                            'unit': one.unit} for one in drives.values()], list(drives), 'drive')

    def plot(self) -> Figure:
        """Return a picture: the error of every drive beside its noise, and the worst over time."""
        from pprs_dynamics.app.report.plots import plot_errors, plot_series

        drives = self.comparison.drives
        figure = plot_errors(
            {'error': {name: one.rms for name, one in drives.items()},
             'noise': {name: one.noise_floor for name, one in drives.items()}},
            self.comparison.unit, rows=2)
        worst = max(drives, key=lambda name: drives[name].unexplained)
        d, residuals = self.residuals.drives.index(worst), self.residuals
        plot_series(figure.axes[1], residuals.time,
                    {'measured': residuals.measured[:, d],
                     'measured minus model': residuals.error[:, d]},
                    f'{worst} [{drives[worst].unit}]')
        return figure

    @property
    def _next(self) -> str:
        return self.inputs.files.command('diagnose', '--report', 'why.html')


def compare(model: Model, recordings: Recordings, *, topic: str | None = None,
            progress: Progress | None = None) -> ComparisonResult:
    """Hold a model against recordings: how wrong it is, on which drive, in which situations.

    Parameters
    ----------
    model : ForceModel or path
    recordings : path, Recording, or a sequence of them
        A path is read, and its units and signs are checked; a Recording is taken as it is.
    topic : str, optional
        Of sensor_msgs/JointState, where a bag holds several.
    progress : callable, optional
        Called with what is being done and the share of it that is done.

    Returns
    -------
    ComparisonResult

    Raises
    ------
    PprsError
        For files that cannot be read, and a motion that the model cannot follow.

    Examples
    --------
    >>> print(compare('config/paper.yaml', 'run.mcap'))  # doctest: +SKIP
    """
    inputs = Inputs.of(model, recordings, (), topic, progress).require_recordings()
    report = progress or (lambda what, share: None)
    residuals, notes = measure_residuals(
        inputs.model, inputs.fitted,
        lambda done, total: report('motion and model', done / total if total else 0.0))
    where = localise(residuals, progress=lambda share: report('where it fails', share))
    return ComparisonResult(inputs, residuals, compare_residuals(residuals, where), tuple(notes))
