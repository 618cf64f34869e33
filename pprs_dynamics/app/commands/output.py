# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Files that commands write: whole or not at all."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.report.progress import staged_bar
from pprs_dynamics.app.report.terminal import shown
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.system.output_files import write_text
from pprs_dynamics.system.plain_text import for_json

if TYPE_CHECKING:
    from pprs_dynamics.app.front_door.result import Result
    from pprs_dynamics.app.report.page import Page


def make_folder(path: str | PathLike[str]) -> Path:
    """Return the folder, made where it does not exist."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UnreadableFileError(folder, f'cannot be a folder for output: {error.strerror}'
                                  ) from None
    return folder


def write_json(path: str | PathLike[str], content: Any) -> None:
    """Write JSON atomically; see `for_json`."""
    write_text(path, json.dumps(for_json(content), indent=2, ensure_ascii=False) + '\n')


def tell(result: Result, options: argparse.Namespace, screen: Any,
         page: Callable[[], Page] | None = None, view: Any = None) -> None:
    """Print a result, and write what --json and --report ask for: its view and page by default."""
    screen.print(result.view(options.details) if view is None else view)
    if options.json:
        write_json(options.json, result.to_dict())
    if options.report:
        with staged_bar(screen) as progress:
            progress('page', 0.0)
            written = (page or result.page)().write(options.report)
        screen.print(f'page: {shown(written)}')
