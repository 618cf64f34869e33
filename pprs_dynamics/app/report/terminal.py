# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The terminal as rich sees it, in characters that the terminal has: text, tables, progress."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from typing import Any

from pprs_dynamics.errors import optional_library
from pprs_dynamics.system.plain_text import PLAIN, displayed

# A notebook's output cell: what it shows has the width and the font of a terminal.
HTML = '<pre style="line-height:1.2;white-space:pre;overflow-x:auto">{code}</pre>'

LOGGED_EVERY = 10.0  # [s] between lines of progress in a log


def console(**options: Any) -> Any:
    """Return rich's console, or raise MissingLibraryError."""
    _rich('console')  # or raises MissingLibraryError
    from rich.console import Console

    class PlainConsole(Console):
        """Puts plain characters in place before widths are counted, so that tables stay even."""

        def render_str(self, text: str, *args: Any, **options: Any) -> Any:
            plain = text.encode(self.encoding, PLAIN).decode(self.encoding)
            return super().render_str(plain, *args, **options)

        def print(self, *objects: Any, **options: Any) -> None:
            super().print(*objects, **{'crop': False, **options})  # as of `shell_command`

    # A name such as a:bug:.csv is no picture.
    return PlainConsole(emoji=False, **options)


def _rich(name: str) -> Any:
    """Return a module of rich, or raise MissingLibraryError."""
    return optional_library(f'rich.{name}', 'rich', 'showing tables', 'report')


def escape(text: str) -> str:
    """Return a text in which rich finds no markup."""
    return str(_rich('markup').escape(text))


def stacked(*parts: Any) -> Any:
    """Return parts of a view, one below the other."""
    return _rich('console').Group(*parts)


def as_text(view: Any, width: int) -> str:
    """Return a view as text, without colours."""
    screen = console(force_jupyter=False, width=width)
    with screen.capture() as captured:
        screen.print(view)
    return str(captured.get()).rstrip('\n')


def as_html(view: Any, width: int) -> str:
    """Return a view as HTML, with its colours."""
    # In a notebook rich would show it at once, too.
    screen = console(record=True, width=width, file=io.StringIO(), force_jupyter=False)
    screen.print(view)
    return str(screen.export_html(inline_styles=True, code_format=HTML))


def shell_command(command: str) -> Any:
    """Return a command that is printed on one line of any length, so that it can be copied."""
    # In a group, as `print` joins texts into a new one that is wrapped.
    return stacked(_rich('text').Text(f'  {command}', style='bold cyan', no_wrap=True,
                                      overflow='ignore'))


def verdict_panel(word: str, colour: str, text: str) -> Any:
    """Return an answer in a frame, its one word above it."""
    return _rich('panel').Panel(escape(text), title=f'[bold {colour}]{word}[/]',
                                border_style=colour, title_align='left')


def shown(name: object) -> str:
    """Return a name, or other text from data, for a line that may hold rich's markup."""
    return escape(displayed(name))


def text_table(headings: Sequence[str], rows: Iterable[Sequence[str]], *,
               right: Collection[int] | None = None, whole: Collection[int] = (),
               frame: str = 'box', **options: Any) -> Any:
    """Return a table for the console.

    Parameters
    ----------
    headings : sequence of str
    rows : iterable of sequence of str
        With rich's markup.
    right : collection of int, optional
        Columns of numbers; by default all but the first.
    whole : collection of int, optional
        Columns that are not wrapped.
    frame : {'box', 'head', 'none'}
        Around and in it; 'head' has a line below the headings and a bold title.
    **options
        Of rich's Table.
    """
    frames: dict[str, dict[str, Any]] = {
        'box': {}, 'none': {'box': None, 'padding': (0, 1)},
        'head': {'box': _rich('box').SIMPLE_HEAD, 'title_justify': 'left', 'title_style': 'bold'}}
    table = _rich('table').Table(**{**frames[frame], **options})
    numbers = range(1, len(headings)) if right is None else right
    for number, heading in enumerate(headings):
        table.add_column(escape(heading), justify='right' if number in numbers else 'left',
                         no_wrap=number in whole, overflow='fold')
    for row in rows:
        table.add_row(*row)
    return table


PlainTable = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Headings and rows of plain text, for the terminal and for a page."""


def plain_rows(table: PlainTable) -> PlainTable:
    """Return a table whose rows no longer hold what rich would take for markup."""
    headings, rows = table
    return headings, [tuple(map(escape, row)) for row in rows]


def titled_table(title: str, table: PlainTable, right: Collection[int] | None = None) -> Any:
    """Return a table of plain text below its title, which may be wider than the table."""
    return stacked(f'[bold]{escape(title)}[/]',
                   text_table(*plain_rows(table), right=right, frame='head'))


@contextmanager
def staged_bar(console: Any) -> Iterator[Callable[[str, float], None]]:
    """Show progress while the block lasts; call the given function with (stage, share done).

    In a terminal a bar for each stage, elsewhere a line on stderr every ten seconds.
    """
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    stage, furthest = 'starting', 0.0
    began, over = monotonic(), Event()

    def advance(what: str, share: float) -> None:
        nonlocal stage, furthest
        if what != stage:
            bar.reset(task, description=what, visible=True)
            stage, furthest = what, 0.0
        furthest = max(furthest, share)  # a bar never goes back
        bar.update(task, completed=furthest)

    def log() -> None:
        while not over.wait(LOGGED_EVERY):
            print(f'{stage} {furthest:.0%} after {monotonic() - began:.0f} s', file=sys.stderr,
                  flush=True)

    with Progress(TextColumn('{task.description}', markup=False), BarColumn(),
                  TaskProgressColumn(), TimeElapsedColumn(), console=console, transient=True,
                  disable=not console.is_terminal) as bar:
        task = bar.add_task(stage, total=1.0, visible=False)
        if not console.is_terminal:
            Thread(target=log, daemon=True).start()
        try:
            yield advance
        finally:
            over.set()
