# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Check that an input is a regular file: a pipe would block, a device has no end."""

from __future__ import annotations

import os
import stat
from os import PathLike

from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.system.output_files import kind_of


def require_file(path: str | PathLike[str]) -> None:
    """Raise UnreadableFileError where a path is nothing that can be read to its end."""
    try:
        mode = os.stat(path).st_mode
    except OSError as error:
        raise UnreadableFileError(path, error.strerror or str(error)) from None
    if not stat.S_ISREG(mode):
        raise UnreadableFileError(path, f'it is {kind_of(mode)}, must be a file')


def require_files(model: str, parameters: str) -> list[str]:
    """Return a launch's model file and its further file of parameters, '' for none.

    Raises
    ------
    UnreadableFileError
        Where one is no file: launch would leave it out, in a line among many.
    """
    files = [model, *([parameters] if parameters else [])]
    for file in files:
        require_file(file)
    return files
