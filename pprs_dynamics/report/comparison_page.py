"""The page that shows where the model fails."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pprs_dynamics.diagnosis.comparison import Comparison
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.report import comparison_figures as figures
from pprs_dynamics.report.page import Page
from pprs_dynamics.report.tables import comparison_rows
from pprs_dynamics.residuals.residuals import Residuals

HEADINGS = ('drive', 'rms [N]', 'relative', 'bias [N]', 'peak [N]', 'explained', 'noise floor [N]',
            'independent samples', 'verdict')


def comparison_page(
    model: ForceModel, recordings: Sequence[Recording], residuals: Residuals,
    comparison: Comparison, notes: Sequence[str],
) -> Page:
    """Return the page of one comparison, most important first."""
    page = Page('Model against measurement')
    page.text(comparison.verdict, 'lead')
    page.text(f'Model: {Path(model.source).name or "built in memory"}. Recordings: '
              f'{", ".join(recording.name for recording in recordings)}.', 'note')
    page.table(HEADINGS, comparison_rows(comparison),
               [drive.grade for drive in comparison.drives.values()])
    page.heading('Where it fails')
    statements = comparison.localisation.statements
    if statements:
        page.bullets([statement.text for statement in statements], numbered=True)
    else:
        page.text('Nowhere in particular: nothing stands out against what noise like this one '
                  'would give.')
    page.heading('Over time')
    page.text('The three worst seconds of each drive are marked. Drag to zoom, double-click to '
              'return. Curves are thinned to the extremes of equal spans: no peak is lost.', 'note')
    for drive, name in enumerate(residuals.drives):
        if name in comparison.drives:
            page.figure(figures.over_time(residuals, drive, figures.worst_spans(residuals, drive)))
    page.heading('Against what it may depend on')
    page.text('Mean error over bins, with twice its standard deviation under noise that is '
              'correlated in time. Choose the drive in the menu.', 'note')
    page.figure(figures.against_variables(residuals, comparison))
    chart = figures.over_workspace(residuals)
    if chart is not None:
        page.heading('Over the workspace')
        page.figure(chart)
    page.heading('Spectrum of the error')
    page.figure(figures.spectrum(residuals, comparison))
    page.heading('How it was computed')
    page.bullets(notes)
    findings = [f'{recording.name}: {finding.text}' for recording in recordings
                for finding in recording.findings]
    if findings:
        page.heading('What is wrong with the recordings')
        page.bullets(findings)
    return page
