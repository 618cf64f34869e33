"""Files that commands write: whole or not at all."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import Any

from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.model.atomic_file import write_text as write_text


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
