# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Tables in the terminal, drawn with rich."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.report import charts
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.terminal import escape, text_table
from pprs_dynamics.drives import CHANNELS, DriveColumns, common_unit
from pprs_dynamics.system.plain_text import counted

if TYPE_CHECKING:
    from pprs_dynamics.arrays import Array
    from pprs_dynamics.drives import DriveUnits, RecordedDrives
    from pprs_dynamics.measurement.files.recording import Recording, Summary
    from pprs_dynamics.physics.model.reproduction import Claim


def claims_table(claims: Iterable[Claim]) -> Any:
    """Return the paper's claims against what comes out."""
    return text_table(
        ('claim', 'paper', 'found', 'reproduced'),
        [(escape(claim.claim), escape(claim.paper), escape(claim.found),
          '[green]yes[/]' if claim.reproduced else '[red]no[/]') for claim in claims],
        right=(), whole=(3,), show_lines=True, title='The paper\'s claims and their reproduction')


def reading_table(summary: Summary, recorded: RecordedDrives) -> Any:
    """Return how the columns of a recording are read: column, drive, quantity, unit, range."""
    rows = []
    joints = recorded.joints or recorded.names
    for drive, joint, units in zip(recorded.names, joints, recorded.units, strict=True):
        found = summary.drives[drive]
        columns = (DriveColumns() if recorded.columns is None
                   else recorded.columns.drives.get(drive, DriveColumns()))
        current = 'current' in columns.names
        in_amperes = any(finding.kind == 'no_gain' and drive in finding.drives
                         for finding in summary.findings)
        for quantity, bounds, unit, factor in (
                ('position', found.position, units.position, columns.position_scale),
                ('velocity', found.velocity, f'{units.position}/s', columns.velocity_scale),
                ('current' if current else 'effort', found.effort,
                 'A' if in_amperes else units.effort, columns.effort_scale),
                *((name, each, units.of(CHANNELS[name]), 1.0)
                  for name, each in found.channels.items())):
            if bounds is not None:
                column = columns.names.get(quantity, f'{joint}/{quantity}')
                rows.append((escape(str(column)), escape(drive), quantity, unit + (
                    f', {factor:.4g} of the column' if factor != 1 else ''), _span(bounds) + (
                        f' ({found.measured:.1%} measured)'
                        if quantity in ('current', 'effort') and found.measured < 1 else '')))
    return text_table(('column', 'drive', 'quantity', 'unit', 'range'), rows, right=(),
                      caption=escape(summary.source), title=escape(
                          f'{summary.name}: {summary.used} of {summary.samples} samples in '
                          f'{counted(len(summary.segments), "segment")}, '
                          f'{summary.duration:.2f} s at {summary.rate:.6g} Hz'))


def _span(bounds: tuple[float, float] | None) -> str:
    return 'none' if bounds is None else f'{bounds[0]:.4g} … {bounds[1]:.4g}'


def simulation_view(samples: int, rate: float, hidden: int) -> str:
    """Return the size of a simulated recording, without the names of its injected effects."""
    return f'{samples} samples at {rate:g} Hz, {hidden} hidden effect{"s" * (hidden != 1)}'


def recording_rows(recording: Recording, units: Sequence[DriveUnits],
                   ) -> dict[str, dict[str, Array]]:
    """Return positions and efforts of every drive, by quantity."""
    return {f'{what} [{common_unit(units, unit)}]': dict(
        zip(recording.drives, values.T, strict=True)) for what, unit, values in (
            ('position', 'm', recording.position), ('effort', 'N', recording.effort))}


def recording_page(recording: Recording, units: Sequence[DriveUnits]) -> Page:
    """Return a page with positions and efforts of every drive over time."""
    page = Page(recording.name)
    page.figure(charts.stacked(recording.time, recording_rows(recording, units), 300),
                'Position and effort of every drive.', over_time=True)
    return page
