# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What commands read, print and write; files are written whole or not at all."""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.report.terminal import shown, staged_bar
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.system.files import write_text
from pprs_dynamics.system.plain_text import for_json

if TYPE_CHECKING:
    from pprs_dynamics.app.api.inputs import Inputs
    from pprs_dynamics.app.api.result import Result
    from pprs_dynamics.app.report.page import Page


def read_inputs(options: argparse.Namespace, screen: Any, whole: bool = False) -> Inputs:
    """Read model and recordings of the arguments, and print what is wrong with the latter.

    Excerpts of what is too long for a fit, but where the `whole` is asked for.

    Raises
    ------
    PprsError
        As `Inputs.of`.
    """
    # Here, as what only writes needs no statistics.
    from pprs_dynamics.app.api.inputs import Inputs

    with staged_bar(screen) as progress:
        inputs = Inputs.of(options.model, options.recordings, getattr(options, 'validate', ()),
                           options.topic, progress, whole, getattr(options, 'as_it_is', False))
    for recording in (*inputs.fitted, *inputs.held_out):
        # That velocities are computed is no fault; `pprs info` says so.
        for finding in (each for each in recording.findings if each.kind != 'missing_velocity'):
            screen.print(f'[yellow]![/] {shown(recording.name)}: {shown(finding.text)}')
    return inputs


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
         page: Callable[[], Page] | None = None, view: Any = None, **beside: str) -> None:
    """Print a result, and write what --json and --report ask for: its view and page by default.

    What else is given stands in the JSON, too.
    """
    if options.json:
        write_json(options.json, {**result.to_dict(), **beside})
    if getattr(options, 'report', None):
        with staged_bar(screen) as progress:
            progress('page', 0.0)
            made = (page or result.page)()
            made.record(result.record(shlex.join(['pprs', *getattr(options, 'words', ())])))
            made.write(options.report)
    # Last: a reader of the text that goes away, as `head` does, ends the command.
    screen.print(result.view(details=getattr(options, 'details', False)) if view is None else view)
    if getattr(options, 'report', None):
        screen.print(f'page: {shown(options.report)}', soft_wrap=True)
