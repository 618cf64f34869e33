"""Progress of long work in the terminal, drawn with rich."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def progress_bar(console: Any, what: str) -> Iterator[Callable[[float, float], None]]:
    """Show a bar while the block lasts; call the given function with (done, total)."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn('{task.description}', markup=False), BarColumn(),
               TextColumn('{task.percentage:3.0f} %'), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
