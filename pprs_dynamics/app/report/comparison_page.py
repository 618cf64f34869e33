# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The page that shows where the model fails."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pprs_dynamics.app.report import comparison_figures as figures
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.tables import comparison_headings, comparison_rows
from pprs_dynamics.inference.diagnosis.comparison import Beside, Comparison
from pprs_dynamics.inference.diagnosis.quantities import sentence
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.force_model import ForceModel

FIRST = 3  # statements on the first screen


def comparison_page(
    model: ForceModel, recordings: Sequence[Recording], residuals: Residuals,
    comparison: Comparison, notes: Sequence[str], command: str = '',
    beside: Beside | None = None,
) -> Page:
    """Return the page of one comparison: where it fails on one screen, the rest to be unfolded.

    Parameters
    ----------
    model : ForceModel
    recordings : sequence of Recording
    residuals : Residuals
    comparison : Comparison
        Of them.
    notes : sequence of str
        How it was computed.
    command : str, optional
        That finds out why.
    beside : Beside, optional
        Drawn as what the error becomes.
    """
    page = Page('Model against measurement')
    page.text(sentence(comparison.verdict), 'lead')
    page.text(f'Model: {Path(model.source).name or "built in memory"}. Recordings: '
              f'{", ".join(recording.name for recording in recordings)}.', 'note')
    statements = comparison.where
    with page.columns():
        with page.block():
            page.errors([ErrorRow(name, drive.rms, beside.drives.get(name) if beside else None,
                                  drive.noise_floor)
                         for name, drive in comparison.drives.items()],
                        f'Error, rms [{comparison.unit}]; dotted: the noise.'
                        + (f' Second bar: {beside.name}.' if beside else ''))
            if statements:
                page.bullets([one.text for one in statements[:FIRST]], numbered=True)
            else:
                page.text('Nowhere in particular: nothing stands out against noise.')
        if statements:
            noise = comparison.localisation.drives[statements[0].drive].noise
            picture = noise and figures.along(residuals, noise, statements[0], 'error')
            if picture is not None:
                page.figure(picture, f'Where it fails most: {statements[0].drive}. Bars: two '
                            'standard deviations under the noise.')
    if command and comparison.is_beyond_noise:
        page.command('Find out which physical effect is missing', command)
    if len(statements) > FIRST:
        with page.fold(f'{len(statements) - FIRST} more places'):
            page.bullets([one.text for one in statements[FIRST:]])
    with page.fold('Drive by drive'):
        page.table(comparison_headings(comparison), comparison_rows(comparison),
                   [drive.grade for drive in comparison.drives.values()])
        page.bullets([drive.verdict for drive in comparison.drives.values()])
    with page.fold('Over time'):
        page.text('The three worst seconds of each drive are marked. Drag to zoom, on all drives '
                  'at once; double-click to return. No peak is lost by thinning.', 'note')
        for drive, name in enumerate(residuals.drives):
            if name in comparison.drives:
                page.figure(figures.over_time(residuals, drive, figures.worst_spans(
                    residuals, drive)), f'{name}: effort, model and their difference.',
                    over_time=True)
    _by_drive(page, residuals, comparison)
    with page.fold('How it was computed'):
        page.bullets(notes)
    findings = [f'{recording.name}: {finding.text}' for recording in recordings
                for finding in recording.findings]
    if findings:
        with page.fold('What is wrong with the recordings'):
            page.bullets(findings)
    return page


def _by_drive(page: Page, residuals: Residuals, comparison: Comparison) -> None:
    """Add figures of one drive at a time, the worst first."""
    names = list(comparison.drives)
    worst = max(names, key=lambda name: comparison.drives[name].unexplained)
    with page.fold('Against what it may depend on'):
        page.text('Mean error over bins, with two standard deviations under noise that is '
                  'correlated in time.', 'note')
        page.menu('Drive', names, worst)
        with page.columns():
            for figure, caption in figures.against_variables(residuals, comparison):
                page.figure(figure, caption)
    chart = figures.over_workspace(residuals)
    if chart is not None:
        with page.fold('Over the workspace'):
            page.menu('Drive', names, worst)
            page.figure(chart, 'Error, rms [N], over the platform\'s position.')
    with page.fold('Spectrum of the error'):
        page.menu('Drive', names, worst)
        page.figure(figures.spectrum(residuals, comparison),
                    'Power of the error and of the noise.')
