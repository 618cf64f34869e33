"""Tables in the terminal, drawn with rich."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pprs_dynamics.errors import MissingLibraryError
from pprs_dynamics.measurement.recording import Summary
from pprs_dynamics.model.reproduction import Claim


def console() -> Any:
    """Return rich's console, or raise MissingLibraryError."""
    try:
        from rich.console import Console
    except ImportError:
        raise MissingLibraryError('rich', 'showing tables', 'report') from None
    return Console()


def claims_table(claims: Iterable[Claim]) -> Any:
    """Return the paper's claims against what comes out."""
    from rich.table import Table

    table = Table(title='The paper\'s claims, and what comes out', show_lines=True)
    for heading, width in (('claim', 34), ('paper', 16), ('found', 42)):
        table.add_column(heading, max_width=width)
    table.add_column('reproduced')
    for claim in claims:
        table.add_row(claim.claim, claim.paper, claim.found,
                      '[green]yes[/]' if claim.reproduced else '[red]no[/]')
    return table


def recording_table(summary: Summary) -> Any:
    """Return what is in a recording, drive by drive."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(
        f'{summary.name}: {summary.used} of {summary.samples} samples in {len(summary.segments)} '
        f'segment{"s" * (len(summary.segments) != 1)}, {summary.duration:.2f} s at '
        f'{summary.rate:.6g} Hz'), caption=escape(summary.source))
    for heading in ('drive', 'position [m]', 'velocity [m/s]', 'effort [N]', 'measured'):
        table.add_column(heading, justify='left' if heading == 'drive' else 'right')
    for drive, found in summary.drives.items():
        table.add_row(drive, _span(found.position), _span(found.velocity), _span(found.effort),
                      f'{found.measured:.1%}')
    return table


def _span(bounds: tuple[float, float] | None) -> str:
    return 'none' if bounds is None else f'{bounds[0]:.4g} … {bounds[1]:.4g}'
