# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Tables in the terminal, drawn with rich."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.report.terminal import text_table
from pprs_dynamics.inference.diagnosis.quantities import percent, plain

if TYPE_CHECKING:
    from pprs_dynamics.drives import DriveUnits
    from pprs_dynamics.inference.diagnosis.comparison import Beside, Comparison
    from pprs_dynamics.measurement.files.recording import Summary
    from pprs_dynamics.physics.model.reproduction import Claim
    from pprs_dynamics.simulation.drive_control import Note

# Lines that places take without --details, and characters of a line of 80 columns, which words
# seldom fill.
MOST_LINES, LINE = 9, 70


def claims_table(claims: Iterable[Claim]) -> Any:
    """Return the paper's claims against what comes out."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title='The paper\'s claims, and what comes out', show_lines=True)
    for heading, width in (('claim', 34), ('paper', 16), ('found', 42)):
        table.add_column(heading, max_width=width)
    table.add_column('reproduced')
    for claim in claims:
        table.add_row(escape(claim.claim), escape(claim.paper), escape(claim.found),
                      '[green]yes[/]' if claim.reproduced else '[red]no[/]')
    return table


def recording_table(summary: Summary, units: Sequence[DriveUnits]) -> list[Any]:
    """Return what is in a recording, drive by drive; drives of one kind in one table."""
    return [_recording_table(summary, kind, [name for name, one in zip(
        summary.drives, units, strict=True) if one == kind]) for kind in dict.fromkeys(units)]


def _recording_table(summary: Summary, units: DriveUnits, drives: Sequence[str]) -> Any:
    from rich.markup import escape

    position = units.of('m')
    return text_table(
        ('drive', f'position [{position}]', f'velocity [{position}/s]', f'effort [{units.effort}]',
         'measured'),
        [(escape(drive), *map(_span, (found.position, found.velocity, found.effort)),
          f'{found.measured:.1%}') for drive in drives for found in [summary.drives[drive]]],
        caption=escape(summary.source), title=escape(
            f'{summary.name}: {summary.used} of {summary.samples} samples in '
            f'{len(summary.segments)} segment{"s" * (len(summary.segments) != 1)}, '
            f'{summary.duration:.2f} s at {summary.rate:.6g} Hz'))


def _span(bounds: tuple[float, float] | None) -> str:
    return 'none' if bounds is None else f'{bounds[0]:.4g} … {bounds[1]:.4g}'


def simulation_view(samples: int, rate: float, hidden: int, notes: Iterable[Note]) -> Any:
    """Return what a simulation made and what happened on the way; not what was hidden."""
    from rich.console import Group
    from rich.markup import escape

    return Group(*(f'[yellow]{note.time:.2f} s {note.code}[/]: {escape(note.message)}'
                   for note in notes),
                 f'{samples} samples at {rate:g} Hz, {hidden} hidden effect{"s" * (hidden != 1)}')


EFFORTS = ('rms', 'bias', 'peak', 'noise')


def comparison_headings(comparison: Comparison) -> tuple[str, ...]:
    """Return the headings of `comparison_rows`."""
    unit = comparison.unit
    return ('drive', *(f'{name} [{unit}]' if name in EFFORTS else name for name in (
        'rms', 'relative', 'bias', 'peak', 'explained', 'noise', 'independent samples')))


def comparison_rows(comparison: Comparison) -> Sequence[tuple[str, ...]]:
    """Return one row of text per drive; the page and the terminal show them."""
    return [(name, f'{drive.rms:.3f}', percent(drive.relative), f'{drive.bias:+.3f}',
             f'{drive.peak:.3f}', percent(drive.explained_variance), f'{drive.noise_floor:.3f}',
             f'{drive.effective_samples:.0f} of {drive.samples}')
            for name, drive in comparison.drives.items()]


def comparison_view(comparison: Comparison, command: str, details: bool = False,
                    beside: Beside | None = None) -> Any:
    """Return how wrong the model is, where, and what to do next.

    Parameters
    ----------
    comparison : Comparison
    command : str
        That finds out why.
    details : bool
        Everything, instead of at most 25 lines of 80 columns.
    beside : Beside, optional
    """
    from rich.console import Group
    from rich.markup import escape

    lines = [f'{number}. {one.text}' for number, one in enumerate(comparison.where, start=1)]
    taken = accumulate(-(-len(line) // LINE) for line in lines)
    told = [line for line, total in zip(lines, taken, strict=True)
            if details or total <= MOST_LINES]
    parts = [_comparison_table(comparison), escape(comparison.verdict), *map(escape, told)]
    if not lines:
        parts.append('Nowhere in particular: nothing stands out against noise.')
    if len(lines) > len(told):
        parts.append(f'… and {len(lines) - len(told)} more, with --details, --json or --report')
    if details:
        parts += [escape(drive.verdict) for drive in comparison.drives.values()]
    if comparison.is_beyond_noise:
        parts += ['[bold]Next[/] Find out which physical effect is missing:',
                  f'  [bold cyan]{escape(command)}[/]']
    if beside is not None:
        parts.append(_beside_table(comparison, beside))
    return Group(*parts)


def _beside_table(comparison: Comparison, beside: Beside) -> Any:
    from rich.markup import escape

    rows = [*((name, one.rms, beside.drives.get(name)) for name, one in comparison.drives.items()),
            ('all', comparison.rms, beside.rms)]
    return text_table(
        ('drive', f'rms [{comparison.unit}]', f'rms, {beside.name}', 'change'),
        [(escape(name), plain(before), 'none' if after is None else plain(after),
          '' if not after or not before else f'{100 * (after / before - 1):+.0f}%')
         for name, before, after in rows], frame='none')


def _comparison_table(comparison: Comparison) -> Any:
    from rich.markup import escape

    colours = {'noise': 'green', 'good': 'green', 'fair': 'yellow', 'poor': 'red'}
    # One unit for all: names of joints need the room.
    short = len(comparison.unit) > 1
    return text_table(
        [heading.partition(' [')[0] if short and not heading.startswith('rms') else heading
         for heading in comparison_headings(comparison)[:7]],
        [(f'[{colours[drive.grade]}]{escape(row[0])}[/]', *row[1:7]) for row, drive in zip(
            comparison_rows(comparison), comparison.drives.values(), strict=True)], frame='none')
