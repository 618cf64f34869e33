# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Diagnoses and simulated recordings of tests: one of each for all files, workers and runs.

A result is stored under the hash of its function, arguments, and the sources that it comes from.
Recordings of closed forms are made anew: they take a few milliseconds.
"""

from __future__ import annotations

import os
import pickle
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from hashlib import sha256
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from pprs_dynamics.inference.diagnosis import diagnose as diagnosing
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis

PACKAGE = Path(__file__).parents[2] / 'pprs_dynamics'


@cache
def folder() -> Path:
    """Return where results of the present sources are stored; those of others are removed."""
    digest = sha256(str(sorted(f'{d.name} {d.version}' for d in distributions())).encode())
    for file in sorted(PACKAGE.rglob('*.py')):
        if file.relative_to(PACKAGE).parts[0] not in ('app', 'ros'):  # no result needs them
            digest.update(file.read_bytes())
    found = PACKAGE.parent / '.pytest_cache' / 'made_once' / digest.hexdigest()
    for other in found.parent.glob('*') if not found.is_dir() else ():
        shutil.rmtree(other, ignore_errors=True)
    found.mkdir(parents=True, exist_ok=True)
    return found


def made_once(make: Callable[..., Any], *arguments: Any) -> Any:
    """Return make(*arguments), or what it has returned before."""
    asked = pickle.dumps((make.__module__, make.__qualname__, arguments))
    path = folder() / sha256(asked).hexdigest()
    if path.is_file():
        return pickle.loads(path.read_bytes())
    made = make(*arguments)
    path.parent.mkdir(parents=True, exist_ok=True)  # tests of sources that changed meanwhile
    new = path.with_suffix(f'.{os.getpid()}')
    new.write_bytes(pickle.dumps(made))
    new.replace(path)
    return made


def diagnose(*arguments: Any, **options: Any) -> Diagnosis:
    """Return what the package's `diagnose` does, without its table of sets, which is large."""
    return made_once(_diagnosed, arguments, options)


def _diagnosed(arguments: Any, options: Any) -> Diagnosis:
    return replace(diagnosing.diagnose(*arguments, **options), selection=None)
