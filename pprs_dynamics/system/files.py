# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Atomic writing of files and folders: readers see the old content or the new one.

Only regular files are replaced. Of a symbolic link the target is written.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from secrets import token_hex
from tempfile import TemporaryDirectory
from typing import IO

from pprs_dynamics.errors import UnreadableFileError

# Of what is not finished. Short: with the target's own name it could be too long.
PREFIX = '.pprs_'
KINDS = {stat.S_IFDIR: 'a folder', stat.S_IFIFO: 'a pipe', stat.S_IFSOCK: 'a socket',
         stat.S_IFCHR: 'a device', stat.S_IFBLK: 'a device'}


def require_file(path: str | PathLike[str]) -> None:
    """Raise UnreadableFileError where a path is nothing that can be read to its end."""
    with readable(path):
        mode = os.stat(path).st_mode
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


@contextmanager
def new_file(path: str | PathLike[str]) -> Iterator[IO[bytes]]:
    """Give a binary file to write to, which takes the place of `path` where the block ends well.

    Raises
    ------
    UnreadableFileError
        If it cannot be written. The old content then remains; a kill may leave a file `.pprs_*`.
    """
    target = writable_file(path)
    partial = target.parent / f'{PREFIX}{token_hex(8)}'
    with readable(path, 'cannot be written: '):
        try:
            with partial.open('x+b') as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)


@contextmanager
def new_folder(path: str | PathLike[str]) -> Iterator[Path]:
    """Give a folder that does not exist yet, which takes the name `path` where the block ends well.

    Raises
    ------
    UnreadableFileError
        Where it cannot be written, or something has the name already.
    """
    target = Path(path)
    if os.path.lexists(target):
        raise UnreadableFileError(target, 'exists already, and folders are never overwritten')
    with scratch_folder(target) as scratch:
        yield scratch / target.name
        (scratch / target.name).rename(target)


@contextmanager
def scratch_folder(path: Path) -> Iterator[Path]:
    """Give a temporary folder next to `path`, which is removed with its content at the end.

    Raises
    ------
    UnreadableFileError
        Where anything that is done in the block cannot be written.
    """
    with readable(path, 'cannot be written: '), TemporaryDirectory(
            prefix=PREFIX, dir=path.parent, ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a text file in UTF-8; see `new_file`."""
    with new_file(path) as file:
        file.write(text.encode('utf-8'))


def writable_file(path: str | PathLike[str]) -> Path:
    """Return the file that is written for a path, behind links.

    Raises
    ------
    UnreadableFileError
        For what is there and is no regular file, a folder that does not exist, and a name that
        the file system does not take.
    """
    target = Path(os.path.realpath(path))
    with readable(path, 'cannot be written: '):
        try:
            mode = os.stat(path).st_mode
        except FileNotFoundError:
            mode = stat.S_IFREG
        if not stat.S_ISREG(mode):
            raise UnreadableFileError(
                path, f'cannot be written: it is {kind_of(mode)}, must be a file')
        if not target.parent.is_dir():
            raise UnreadableFileError(path, 'cannot be written: its folder does not exist')
    return target


def kind_of(mode: int) -> str:
    """Return the kind of a mode of `os.stat` that is no regular file's, in words."""
    return KINDS.get(stat.S_IFMT(mode), 'something else')


@contextmanager
def readable(path: str | PathLike[str], before: str = '') -> Iterator[None]:
    """Name the file and the reason, after some words, where the system refuses.

    Raises
    ------
    UnreadableFileError
    """
    try:
        yield
    except UnreadableFileError:
        raise
    except OSError as error:
        raise UnreadableFileError(path, f'{before}{error.strerror or error}') from None
