# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Where the model fails, in the terminal and as a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pprs_dynamics.app.report import comparison_figures as figures
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.terminal import PlainTable, escape, shell_command, stacked, text_table
from pprs_dynamics.inference.diagnosis.comparison import Beside, Comparison
from pprs_dynamics.inference.diagnosis.quantities import percent, plain, rounded_as
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel

NOWHERE = 'The error is not concentrated in any region.'
FIRST = 3  # statements on the first screen, and without --details
EFFORTS = ('rms', 'bias', 'peak', 'noise')


def drives_table(comparison: Comparison) -> PlainTable:
    """Return the numbers of every drive; the page shows all of them, the terminal the first."""
    headings = ('rms', 'relative', 'bias', 'peak', 'explained', 'noise', 'grade')
    return ('drive', *(f'{name} [{comparison.unit}]' if name in EFFORTS else name
                       for name in headings)), [
        (name, plain(drive.rms), percent(drive.relative),
         rounded_as(drive.bias, drive.rms, '+'), rounded_as(drive.peak, drive.rms),
         percent(drive.explained_variance),
         '' if drive.noise_floor is None else plain(drive.noise_floor, 2), drive.grade)
        for name, drive in comparison.drives.items()]


def comparison_view(comparison: Comparison, following: tuple[str, str], details: bool = False,
                    beside: Beside | None = None) -> Any:
    """Return how wrong the model is, where, and what to do next.

    Parameters
    ----------
    comparison : Comparison
    following : (str, str)
        What to do next, in words and for a shell.
    details : bool
        Everything, instead of at most 25 lines of 80 columns.
    beside : Beside, optional
    """
    lines = [f'{number}. {statement.text}'
             for number, statement in enumerate(comparison.where, start=1)]
    shown = lines if details else lines[:FIRST]
    parts = [_drives_table(comparison, details), escape(comparison.verdict), *map(escape, shown)]
    if not lines:
        parts.append(NOWHERE)
    if len(lines) > len(shown):
        parts.append(f'… and {len(lines) - len(shown)} more, with --details, --json or --report')
    if comparison.is_beyond_noise:
        words, command = following
        parts += [f'[bold]Next[/] {escape(words)}:', shell_command(command)]
    if beside is not None:
        parts.append(_beside_table(comparison, beside))
    return stacked(*parts)


def _beside_table(comparison: Comparison, beside: Beside) -> Any:
    rows = [*((name, drive.rms, beside.drives.get(name))
              for name, drive in comparison.drives.items()),
            ('all', comparison.rms, beside.rms)]
    return text_table(
        ('drive', f'rms [{comparison.unit}]', f'rms, {beside.name}', 'change'),
        [(escape(name), plain(before), 'none' if after is None else plain(after),
          '' if not after or not before else f'{100 * (after / before - 1):+.0f}%')
         for name, before, after in rows], frame='none')


def _drives_table(comparison: Comparison, details: bool) -> Any:
    colours = {'noise': 'green', 'good': 'green', 'fair': 'yellow', 'poor': 'red'}
    headings, rows = drives_table(comparison)
    last = len(headings) if details else -1
    # One unit for all: names of joints need the room.
    short = len(comparison.unit) > 1
    return text_table(
        [heading.partition(' [')[0] if short and not heading.startswith('rms') else heading
         for heading in headings[:last]],
        [(f'[{colours[drive.grade]}]{escape(row[0])}[/]', *row[1:last])
         for row, drive in zip(rows, comparison.drives.values(), strict=True)], frame='none')


def comparison_page(
    model: DriveModel, recordings: Sequence[Recording], residuals: Residuals,
    comparison: Comparison, notes: Sequence[str], following: tuple[str, str] = ('', ''),
    beside: Beside | None = None,
) -> Page:
    """Return the page of one comparison: where it fails on one screen, the rest to be unfolded.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
    residuals : Residuals
    comparison : Comparison
        Of them.
    notes : sequence of str
        How it was computed.
    following : (str, str), optional
        What to do next, in words and for a shell.
    beside : Beside, optional
        Drawn as what the error becomes.
    """
    page = Page('Model against measurement')
    page.text(comparison.verdict, 'lead')
    page.sources(model.source, [recording.name for recording in recordings])
    statements = comparison.where
    with page.columns():
        with page.block():
            page.errors([ErrorRow(name, drive.rms, beside.drives.get(name) if beside else None,
                                  drive.noise_floor)
                         for name, drive in comparison.drives.items()],
                        f'Error, rms [{comparison.unit}]; dotted: the noise.'
                        + (f' Second bar: {beside.name}.' if beside else ''))
            if statements:
                page.bullets([statement.text for statement in statements[:FIRST]], numbered=True)
            else:
                page.text(NOWHERE)
        if statements:
            noise = comparison.localisation.noise.get(statements[0].drive)
            picture = noise and figures.along(residuals, noise, statements[0], 'error')
            if picture is not None:
                page.figure(picture, f'Where it fails most: {statements[0].drive}. Bars: two '
                            'standard deviations under the noise.')
    if following[1] and comparison.is_beyond_noise:
        page.command(*following)
    page.folded_list(f'{len(statements) - FIRST} more places',
                     [statement.text for statement in statements[FIRST:]])
    with page.fold('Drive by drive'):
        page.table(*drives_table(comparison),
                   [drive.grade for drive in comparison.drives.values()])
    with page.fold('Over time'):
        page.text('Drag to zoom, on all drives at once; double-click to return. No peak is lost by '
                  'thinning.', 'note')
        for drive, name in enumerate(residuals.drives):
            if name in comparison.drives:
                page.figure(figures.over_time(residuals, drive),
                            f'{name}: effort, model and their difference.', over_time=True)
    _by_drive(page, residuals, comparison)
    page.folded_list('Method', notes)
    findings = [f'{recording.name}: {finding.text}' for recording in recordings
                for finding in recording.findings]
    page.folded_list('Faults of the recordings', findings)
    return page


def _by_drive(page: Page, residuals: Residuals, comparison: Comparison) -> None:
    """Add figures of one drive at a time, the worst first."""
    names = list(comparison.drives)
    worst = max(names, key=lambda name: comparison.drives[name].unexplained)
    with page.fold('Error over other variables'):
        page.text('Mean error over bins, with two standard deviations under noise that is '
                  'correlated in time.', 'note')
        page.menu('Drive', names, worst)
        with page.columns():
            for figure, caption in figures.against_variables(residuals, comparison):
                page.figure(figure, caption)
    with page.fold('Spectrum of the error'):
        page.menu('Drive', names, worst)
        page.figure(figures.spectrum(residuals, comparison),
                    'Power of the error and of the noise.')
