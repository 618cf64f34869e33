# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Progress of long work in the terminal, drawn with rich."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def progress_bar(console: Any, what: str) -> Iterator[Callable[[float, float], None]]:
    """Show a bar while the block lasts; call the given function with (done, total).

    It never goes back, whatever it is called with.
    """
    with staged_bar(console) as advance:
        yield lambda done, total: advance(what, done / total if total else 0.0)


@contextmanager
def staged_bar(console: Any) -> Iterator[Callable[[str, float], None]]:
    """Show a bar while the block lasts; call the given function with (stage, share done).

    Each stage has a bar of its own in place of the one before; none goes back.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn('{task.description}', markup=False), BarColumn(),
               TextColumn('{task.percentage:3.0f} %'), TimeElapsedColumn())
    # In a file or a pipe it would leave an empty line.
    with Progress(*columns, console=console, transient=True,
                  disable=not console.is_terminal) as bar:
        task, stage, furthest = None, '', 0.0

        def advance(what: str, share: float) -> None:
            nonlocal task, stage, furthest
            if task is None or what != stage:
                if task is not None:
                    bar.remove_task(task)
                task, stage, furthest = bar.add_task(what, total=1.0), what, 0.0
            furthest = max(furthest, share)
            bar.update(task, completed=furthest)

        yield advance


@contextmanager
def counting_bar(console: Any, what: str, total: int) -> Iterator[Callable[[], None]]:
    """Show a bar with count, rate and remaining time; call the given function for each done."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f'{60 * task.speed:.0f}/min' if task.speed else '')

    columns = (TextColumn('{task.description}', markup=False), BarColumn(), MofNCompleteColumn(),
               Rate(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True,
                  disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.update(task, advance=1)
