# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs` called within the test's own process: what it prints, and how it ends.

Starting Python and importing NumPy, SciPy and rich again takes longer than most commands run. What
a process alone shows (streams that close, signals, the environment, the installed script) is in
test_terminal.py, test_files_of_commands.py and test_mistakes.py, which start one.
"""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Iterator
from contextlib import chdir, contextmanager, nullcontext, redirect_stderr, redirect_stdout
from dataclasses import dataclass

import pytest

from pprs_dynamics.app.commands.pprs import main


@dataclass(frozen=True)
class Ended:
    """What a command printed, and its exit status."""

    returncode: int
    stdout: str
    stderr: str


def pprs(
    *arguments: object, cwd: str | os.PathLike[str] | None = None, columns: int = 80,
    encoding: str = 'utf-8',
) -> Ended:
    """Call `pprs` on a terminal so wide; what would be a traceback on the screen is raised."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding=encoding, newline='') for _ in range(2))
    with chdir(cwd) if cwd else nullcontext(), as_a_new_process(columns), \
            redirect_stdout(out), redirect_stderr(err):
        try:
            status: object = main([os.fspath(word) if isinstance(word, os.PathLike) else str(word)
                                   for word in arguments])
        except SystemExit as ended:  # of argparse
            status = ended.code
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode(encoding, 'surrogateescape'))  # type: ignore[attr-defined]
    assert isinstance(status, int), status
    return Ended(status, *texts)


@contextmanager
def as_a_new_process(columns: int) -> Iterator[None]:
    """Show warnings as a new interpreter would, and leave what a command decides for itself."""
    with warnings.catch_warnings(), pytest.MonkeyPatch.context() as patch:
        warnings.resetwarnings()
        for category in (DeprecationWarning, PendingDeprecationWarning, ImportWarning,
                         ResourceWarning):
            warnings.simplefilter('ignore', category)
        patch.setenv('COLUMNS', str(columns))
        yield
