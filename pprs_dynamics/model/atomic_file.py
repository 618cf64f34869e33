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
        handle = _nameless(target.parent)
        if handle is None:
            _write_named(target, content)
            return
        with os.fdopen(handle, 'wb') as file:
            _fill(file.fileno(), content)
            _give_name(file.fileno(), target)
    except OSError as error:
        raise UnreadableFileError(target, f'cannot be written: {error.strerror}') from None


def _nameless(folder: Path) -> int | None:
    """Open a file without a name, which a kill in mid-write leaves nothing of; None: not here."""
    flag = getattr(os, 'O_TMPFILE', None)
    if flag is None or not os.path.isdir('/proc/self/fd'):
        return None
    try:
        return os.open(folder, flag | os.O_WRONLY, PERMISSIONS)
    except OSError:
        return None  # a file system without; what else is wrong the other way will tell


def _give_name(handle: int, target: Path) -> None:
    name = f'.{target.name}.{uuid4().hex}'
    folder = os.open(target.parent, os.O_RDONLY)
    try:
        # With a folder given, Python follows the link in /proc to the file itself.
        os.link(f'/proc/self/fd/{handle}', name, dst_dir_fd=folder, follow_symlinks=True)
        try:
            os.replace(name, target.name, src_dir_fd=folder, dst_dir_fd=folder)
        except OSError:
            os.unlink(name, dir_fd=folder)
            raise
        with suppress(OSError):
            os.fsync(folder)  # the new entry on the disk, too
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
