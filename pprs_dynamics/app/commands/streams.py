# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Standard output and error: characters that the encoding lacks, closed pipes, full disks."""

from __future__ import annotations

import locale
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from pprs_dynamics.system.plain_text import PLAIN


class LastingOutput:
    """A text stream that goes on in silence after it failed.

    A reader like `head` that goes away, or a disk that is full, must not take the files with it
    that a command writes after its text.

    Parameters
    ----------
    stream : text stream

    Attributes
    ----------
    error : OSError or None
        Why it fell silent.
    """

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.error: OSError | None = None

    def write(self, text: str) -> int:
        """Write a text."""
        try:
            self._stream.write(text)
        except OSError as error:
            self._fall_silent(error)
        return len(text)

    def flush(self) -> None:
        """Write what is in the buffer."""
        try:
            self._stream.flush()
        except OSError as error:
            self._fall_silent(error)

    def _fall_silent(self, error: OSError) -> None:
        self.error = self.error or error
        # What is left in the buffer goes there, now or when the interpreter ends.
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def lasting_output() -> Iterator[LastingOutput]:
    """Make standard output last while the block does, and both streams take every character."""
    _open_closed()
    before = sys.stdout
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, 'reconfigure'):
            encoding = _wanted_encoding()
            stream.reconfigure(errors=PLAIN, **({'encoding': encoding} if encoding else {}))
    output = LastingOutput(before)
    sys.stdout = output
    try:
        yield output
    finally:
        output.flush()
        sys.stdout = before


def _open_closed() -> None:
    """Open what was closed (`>&-`): the next file that is opened would take its place."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free: this one
    for name in ('stdout', 'stderr'):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, 'w', encoding='utf-8'))  # noqa: SIM115


def _wanted_encoding() -> str | None:
    """Return the terminal's own encoding where Python has put UTF-8 in its place.

    It does so in the locales C and POSIX; who asked for UTF-8 by name gets it.
    """
    asked = ('PYTHONUTF8', 'PYTHONIOENCODING')
    if not sys.flags.utf8_mode or 'utf8' in sys._xoptions or any(map(os.environ.get, asked)):
        return None
    own = locale.getencoding()
    return None if own.lower().replace('-', '') == 'utf8' else own
