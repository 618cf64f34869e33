# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Results that several test files need: computed once, shared by workers, files and later runs."""

from __future__ import annotations

import fcntl
import hashlib
import pickle
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

PROJECT = Path(__file__).parents[2]
FOLDER = PROJECT / '.pytest_cache' / 'pprs_dynamics'
SIMULATION = ('pprs_dynamics/physics', 'pprs_dynamics/measurement', 'pprs_dynamics/simulation',
              'benchmarks/hidden', 'config')
KEPT = 7 * 86400.0  # [s]
COMMANDS = ('pprs_dynamics', 'config')  # of whatever `pprs` runs


@cache
def fingerprint(sources: tuple[str, ...]) -> str:
    """Return the hash of all source files below some folders of the project."""
    found = hashlib.sha256()
    for folder in sources:
        for path in sorted((PROJECT / folder).rglob('*')):
            if path.suffix in ('.py', '.yaml', '.urdf', '.js', '.mjs', '.css', '.html'):
                found.update(f'{path.relative_to(PROJECT)}\0'.encode() + path.read_bytes())
    return found.hexdigest()


def cached(
    compute: Callable[..., Any], *arguments: str | float, sources: tuple[str, ...] = SIMULATION,
) -> Any:
    """Return what a function of a module returns for strings and numbers.

    The file of the function belongs to the key as well as the sources.
    """
    key = hashlib.sha256(repr((arguments, fingerprint(sources))).encode() + Path(
        compute.__code__.co_filename).read_bytes()).hexdigest()[:24]
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f'{compute.__name__}-{key}.pickle'
    with path.with_suffix('.lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # another worker may compute it
        if path.exists():
            return pickle.loads(path.read_bytes())
        result = compute(*arguments)
        part = path.with_suffix('.part')
        part.write_bytes(pickle.dumps(result))
        part.replace(path)
    for old in FOLDER.glob(f'{compute.__name__}-*'):
        if old.stat().st_mtime < time.time() - KEPT:
            old.unlink(missing_ok=True)
    return result
