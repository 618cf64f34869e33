# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Diagnoses kept between commands, so that `adopt` after `diagnose` need not diagnose again.

An entry belongs to the contents of the recordings, the numbers of the model and the code of the
package and of further effects. Entries are pickles, which may do anything when they are read:
only files of a folder that belongs to the user, and that nobody else can write to, are.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import pickle
import stat
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import NamedTemporaryFile

import numpy as np
import scipy

import pprs_dynamics
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis
from pprs_dynamics.measurement.files.fingerprint import fingerprint
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.model.force_model import ForceModel

FOLDER = 'pprs_dynamics'  # within the cache folder of the platform
MOST_ENTRIES = 8
MOST_BYTES = 200_000_000  # of all entries together


def diagnosis_key(model: ForceModel, recordings: Sequence[str], topic: str | None) -> str:
    """Return what tells the diagnosis of a model on recordings from every other.

    Raises
    ------
    UnreadableFileError
        Where a recording cannot be read.
    """
    parts = [pprs_dynamics.__version__, sys.version, np.__version__, scipy.__version__,
             repr(sorted(model.values.items())), model.content, type(model).__qualname__,
             str(topic), *map(fingerprint, recordings), *_code()]
    return hashlib.sha256('\0'.join(parts).encode()).hexdigest()


def keep(key: str, diagnosis: Diagnosis) -> None:
    """Keep a diagnosis; without a folder that is the user's alone, nothing is kept.

    The columns of its searches are left out: they are large, and only for looking closer.
    """
    folder = _folder()
    if folder is None:
        return
    kept = replace(diagnosis, selection=None, chosen=None)
    with suppress(OSError, pickle.PicklingError, TypeError, AttributeError):
        content = pickle.dumps(kept, pickle.HIGHEST_PROTOCOL)
        with NamedTemporaryFile(dir=folder, delete=False) as file:
            file.write(content)
        Path(file.name).replace(folder / f'{key}.pickle')
        _drop_oldest(folder)


def kept_diagnosis(key: str) -> Diagnosis | None:
    """Return the diagnosis that is kept, None where there is none that can be trusted."""
    folder = _folder()
    if folder is None:
        return None
    path = folder / f'{key}.pickle'
    try:
        with open(path, 'rb', opener=_open_own) as file:
            found = pickle.load(file)
    # A pickle that is cut short or of another time may raise anything.
    except Exception:
        return None
    return found if isinstance(found, Diagnosis) else None


def _folder() -> Path | None:
    """Return the folder, made where it does not exist; None where others could write to it."""
    home = os.environ.get('XDG_CACHE_HOME', '')
    try:
        base = Path(home) if Path(home).is_absolute() else Path.home() / '.cache'
        folder = base / FOLDER
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.lstat()
    except (OSError, RuntimeError):
        return None
    own = not hasattr(os, 'getuid') or found.st_uid == os.getuid()
    private = not found.st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    return folder if stat.S_ISDIR(found.st_mode) and own and private else None


def _open_own(path: str, flags: int) -> int:
    """Open a file that is no link and belongs to the user."""
    found = os.open(path, flags | getattr(os, 'O_NOFOLLOW', 0))
    if hasattr(os, 'getuid') and os.fstat(found).st_uid != os.getuid():
        os.close(found)
        raise PermissionError(path)
    return found


def _drop_oldest(folder: Path) -> None:
    entries = sorted(folder.glob('*.pickle'), key=lambda path: -path.stat().st_mtime)
    total = 0
    for number, path in enumerate(entries):
        total += path.stat().st_size
        if number >= MOST_ENTRIES or total > MOST_BYTES:
            path.unlink(missing_ok=True)


def _code() -> list[str]:
    """Return what changes when the code does: names, sizes and times of all modules."""
    root = Path(pprs_dynamics.__file__).parent
    modules = {str(path) for path in root.rglob('*.py')}
    modules |= {inspect.getfile(effect) for effect in catalogue().values()}
    found = []
    for name in sorted(modules):
        with suppress(OSError):
            seen = Path(name).stat()
            found.append(f'{name} {seen.st_size} {seen.st_mtime_ns}')
    return [*found, *catalogue()]
