# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Identity of a recording: the SHA-256 of its file or of its samples."""

from __future__ import annotations

import hashlib
from os import PathLike
from pathlib import Path

from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.system.files import readable, require_file


def fingerprint(path: str | PathLike[str]) -> str:
    """Return the hash of a file; of a folder, of its files' names and hashes in order.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read.
    """
    path = Path(path)
    with readable(path):
        if not path.is_dir():
            require_file(path)
            with path.open('rb') as file:
                return hashlib.file_digest(file, 'sha256').hexdigest()
        whole = hashlib.sha256()
        for file_path in sorted(entry for entry in path.rglob('*') if entry.is_file()):
            name = file_path.relative_to(path).as_posix()
            whole.update(f'{name}\0{fingerprint(file_path)}\n'.encode())
        return whole.hexdigest()


def samples_fingerprint(recording: Recording) -> str:
    """Return the hash of a recording that came from no file."""
    whole = hashlib.sha256(repr((recording.drives, recording.epoch)).encode())
    for values in (recording.time, *recording.measured.values()):
        whole.update(values.astype('<f8').tobytes())
    return whole.hexdigest()
