"""Files that commands write: whole or not at all."""

from __future__ import annotations

import json
import os
import tempfile
from os import PathLike
from pathlib import Path
from typing import Any

from pprs_dynamics.errors import UnreadableFileError


def make_folder(path: str | PathLike[str]) -> Path:
    """Return the folder, made where it does not exist."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UnreadableFileError(folder, f'cannot be a folder for output: {error.strerror}'
                                  ) from None
    return folder


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a text file atomically: a reader sees the old content or the new one, never half."""
    target = Path(path)
    try:
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f'.{target.name}.')
    except OSError as error:
        raise UnreadableFileError(target, f'cannot be written: {error.strerror}') from None
    try:
        with os.fdopen(handle, 'w', encoding='utf-8') as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes files that only their owner may read.
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, target)
    except OSError as error:
        Path(temporary).unlink(missing_ok=True)
        raise UnreadableFileError(target, f'cannot be written: {error.strerror}') from None
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_json(path: str | PathLike[str], content: Any) -> None:
    """Write JSON atomically; numbers that are not finite become null, as JSON has none."""
    write_text(path, json.dumps(_finite(content), indent=2, ensure_ascii=False) + '\n')


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    if isinstance(content, float) and content - content != 0.0:
        return None
    return content
