# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Comparison of a model with recordings: its error, and where it is largest."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.api.inputs import Inputs, Model, Progress, Recordings, stage
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.app.report import figures
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.pictures import plot_errors, plot_series
from pprs_dynamics.app.report.terminal import PlainTable, escape, shell_command, stacked, text_table
from pprs_dynamics.inference.diagnosis.comparison import Comparison, localise
from pprs_dynamics.inference.diagnosis.comparison import compare as compare_residuals
from pprs_dynamics.inference.diagnosis.next_step import first_step, measure_first
from pprs_dynamics.inference.diagnosis.quantities import measured, percent, rounded_as
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.inference.readings.findings import effort_looks_like, no_measurements
from pprs_dynamics.inference.residuals.comparison_bag import write_comparison
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.explained_effort import little_explained
from pprs_dynamics.inference.search.noise_floors import measure_columns, noise_floors

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure

NOWHERE = 'The error is not concentrated in any region.'
FIRST = 3  # statements in the terminal, and on the first screen of the page
COLOURS = {'noise': 'green', 'good': 'green', 'fair': 'yellow', 'poor': 'red'}


@dataclass(frozen=True, repr=False, eq=False)
class ComparisonResult(Result):
    """Result of `pprs compare`.

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

    json_of = 'comparison'
    json_keys = ('verdict', 'effort_looks_like')

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
        """Error and grade of the model, in at most two sentences."""
        return self.comparison.verdict

    @property
    def where(self) -> tuple[Statement, ...]:
        """Where it fails, what explains most of the squared error first."""
        return self.comparison.where

    @property
    def effort_looks_like(self) -> dict[str, str] | None:
        """Kind of each drive's effort that is no measurement; null for none."""
        return effort_looks_like(recording.findings for recording in self.inputs.fitted)

    def _drives(self) -> PlainTable:
        """Return the numbers of every drive; the grade comes last."""
        comparison = self.comparison
        headings = ('rms', 'relative', 'bias', 'peak', 'explained', 'noise')
        # One unit for all: names of joints need the room.
        marked = ('rms',) if len(comparison.unit) > 1 else ('rms', 'bias', 'peak', 'noise')
        return ('drive', *(f'{name} [{comparison.unit}]' if name in marked else name
                           for name in headings), 'grade'), [
            (name, measured(drive.rms), percent(drive.relative),
             rounded_as(drive.bias, drive.rms, '+'), rounded_as(drive.peak, drive.rms),
             percent(drive.explained_variance),
             '' if drive.noise_floor is None else measured(drive.noise_floor, 2),
             drive.grade)
            for name, drive in comparison.drives.items()]

    def view(self) -> Any:
        """Return errors, places and the next step for the terminal."""
        headings, rows = self._drives()
        table = text_table(headings[:-1], [
            (f'[{COLOURS[row[-1]]}]{escape(row[0])}[/]', *row[1:-1]) for row in rows],
            frame='none')
        lines = [f'{number}. {escape(statement.text)}'
                 for number, statement in enumerate(self.where, start=1)]
        parts = [table, escape(self.verdict), *(lines[:FIRST] or [NOWHERE])]
        if len(lines) > FIRST:
            parts.append(f'… and {len(lines) - FIRST} more, with --json or --report')
        if self.comparison.is_beyond_noise:
            words, command = self._next
            parts += [f'[bold]Next[/] {escape(words)}:', shell_command(command)]
        return stacked(*parts)

    def page(self) -> Page:
        """Return the page of `pprs compare --report`: where it fails first, the rest folded."""
        comparison, residuals = self.comparison, self.residuals
        recordings, statements = self.inputs.fitted, self.where
        page = Page('Model against measurement')
        page.text(self.verdict, 'lead')
        page.sources(self.inputs.model.source, *self.inputs.names)
        with page.columns():
            with page.block():
                page.errors([ErrorRow(name, drive.rms, noise=drive.noise_floor)
                             for name, drive in comparison.drives.items()],
                            f'Error, rms [{comparison.unit}]; dotted: the noise.')
                if statements:
                    page.bullets([statement.text for statement in statements[:FIRST]],
                                 numbered=True)
                else:
                    page.text(NOWHERE)
            if statements:
                noise = comparison.noise.get(statements[0].drive)
                picture = noise and figures.along(residuals, noise, statements[0], 'error')
                if picture is not None:
                    page.figure(picture, f'Where it fails most: {statements[0].drive}. Bars: two '
                                'standard deviations under the noise.')
        if comparison.is_beyond_noise:
            page.command(*self._next)
        page.folded_list(f'{len(statements) - FIRST} more places',
                         [statement.text for statement in statements[FIRST:]])
        with page.fold('Drive by drive'):
            page.table(*self._drives(), [drive.grade for drive in comparison.drives.values()])
        with page.fold('Over time'):
            page.text('Drag to zoom, on all drives at once; double-click to return. No peak is '
                      'lost by thinning.', 'note')
            for drive, name in enumerate(residuals.drives):
                if name in comparison.drives:
                    page.figure(figures.over_time(residuals, drive),
                                f'{name}: effort, model and their difference.', over_time=True)
        names = list(comparison.drives)
        with page.fold('Error over other variables'):
            page.text('Mean error over bins, with two standard deviations under noise that is '
                      'correlated in time.', 'note')
            page.menu('Drive', names, self._worst)
            with page.columns():
                for figure, caption in figures.against_variables(residuals, comparison):
                    page.figure(figure, caption)
        with page.fold('Spectrum of the error'):
            page.menu('Drive', names, self._worst)
            page.figure(figures.spectrum(residuals, comparison),
                        'Power of the error and of the noise.')
        page.folded_list('Method', self.notes)
        page.folded_list('Faults of the recordings', [
            f'{recording.name}: {finding.text}' for recording in recordings
            for finding in recording.findings])
        return page

    @property
    def _worst(self) -> str:
        """Drive of which the model explains least."""
        drives = self.comparison.drives
        return max(drives, key=lambda name: drives[name].unexplained)

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
        return data_frame({name: {
            'rms': drive.rms, 'relative': drive.relative, 'bias': drive.bias, 'peak': drive.peak,
            'noise': drive.noise_floor, 'grade': drive.grade, 'unit': drive.unit}
            for name, drive in self.comparison.drives.items()})

    def plot(self) -> Figure:
        """Return a picture: error and noise of every drive, and the worst drive over time."""
        drives = self.comparison.drives
        figure = plot_errors(
            {'error': {name: drive.rms for name, drive in drives.items()},
             'noise': {name: drive.noise_floor for name, drive in drives.items()
                       if drive.noise_floor is not None}},
            self.comparison.unit, rows=2)
        worst, residuals = self._worst, self.residuals
        d = residuals.drives.index(worst)
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
        is_friction = bool(self.where) and self.where[0].kind == 'friction'
        if self.comparison.little and (self.inputs.model.has_links or not is_friction):
            return first_step(self.inputs.model, self.inputs.files)
        return ('Find out which physical effect is missing',
                self.inputs.files.command('diagnose', '--report', 'why.html'))


def compare(model: Model, recordings: Recordings, *, topic: str | None = None,
            progress: Progress | None = None, as_it_is: bool = False) -> ComparisonResult:
    """Compare a model with recordings: its error, on which drive, in which situations.

    Parameters
    ----------
    model : DriveModel or path
    recordings : path, Recording, or a sequence of them
        A path is read, and its units and signs are checked; a Recording is not checked.
    topic : str, optional
        Of sensor_msgs/JointState, where a bag holds several.
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
    where = localise(columns.design.residuals if columns else residuals,
                     stage(progress, 'where it fails'))
    comparison = compare_residuals(
        residuals, where,
        noise_floors(columns, residuals.period) if columns else {},
        little_explained(inputs.model, residuals))
    return ComparisonResult(inputs, residuals, comparison, tuple(notes))
