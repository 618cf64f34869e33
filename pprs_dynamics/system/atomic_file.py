# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Text files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from os import PathLike
from pathlib import Path
from uuid import uuid4

from pprs_dynamics.errors import UnreadableFileError

PERMISSIONS = 0o666  # less the umask, as of any new file


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a text file atomically: a reader sees the old content or the new one, never half.

    Raises
    ------
    UnreadableFileError
        Where it cannot be written; the old content is as it was, and nothing else is left.
    """
    target = Path(path)
    try:
        content = text.encode('utf-8')
        if not _write_nameless(target, content):
            _write_named(target, content)
    except OSError as error:
        raise UnreadableFileError(target, f'cannot be written: {error.strerror}') from None


def _write_nameless(target: Path, content: bytes) -> bool:
    """Write by way of a file without a name, of which a kill in mid-write leaves nothing.

    False where the file system or the system does not know such files; what else is wrong, the
    other way will tell.
    """
    flag = getattr(os, 'O_TMPFILE', None)
    if flag is None:
        return False
    try:
        handle = os.open(target.parent, flag | os.O_WRONLY, PERMISSIONS)
    except OSError:
        return False
    with os.fdopen(handle, 'wb') as file:
        _fill(file.fileno(), content)
        return _give_name(file.fileno(), target)


def _give_name(handle: int, target: Path) -> bool:
    name = f'.{target.name}.{uuid4().hex}'
    folder = os.open(target.parent, os.O_RDONLY)
    try:
        try:
            # With a folder given, Python follows the link in /proc to the file itself.
            os.link(f'/proc/self/fd/{handle}', name, dst_dir_fd=folder, follow_symlinks=True)
        except OSError:
            return False
        try:
            os.replace(name, target.name, src_dir_fd=folder, dst_dir_fd=folder)
        except OSError:
            os.unlink(name, dir_fd=folder)
            raise
        with suppress(OSError):
            os.fsync(folder)  # the new entry on the disk, too
        return True
    finally:
        os.close(folder)


def _write_named(target: Path, content: bytes) -> None:
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f'.{target.name}.')
    try:
        with os.fdopen(handle, 'wb') as file:
            _fill(file.fileno(), content)
        # mkstemp makes files that only their owner may read.
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, PERMISSIONS & ~umask)
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _fill(handle: int, content: bytes) -> None:
    view = memoryview(content)
    while view:
        view = view[os.write(handle, view):]
    os.fsync(handle)
