"""Tables in the terminal, drawn with rich."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pprs_dynamics.errors import MissingLibraryError
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
