# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Provenance in ~/status: file, fingerprint and effects of the model that a node runs."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import FILES
from pprs_dynamics.physics.model.parameter_file import DEFAULT_MODEL, LEDGER, find_file
from pprs_dynamics.system.bounded_yaml import parse, read_text
from pprs_dynamics.system.plain_text import displayed

OPTION = '--params-file'
BLOCK = 'ros__parameters.'


def files_given(arguments: Sequence[str]) -> list[dict[str, str]]:
    """Return path and SHA-256 of the parameter files on a command line, in order.

    Without any it is the package's own model that a node runs.
    """
    paths = _paths(arguments) or [find_file(DEFAULT_MODEL)]
    return [{'file': displayed(path.resolve()),
             'sha256': hashlib.sha256(path.read_bytes()).hexdigest()}
            for path in paths if path.is_file()]


def hardware_of(model: DriveModel) -> str:
    """Return which robot a model is of: an arm by its URDF."""
    name = model.title.partition(' ')[2]
    described = [Path(model.values[key]).stem for key in FILES if model.values.get(key)]
    return ' '.join((name, *described))


def _paths(arguments: Sequence[str]) -> list[Path]:
    return [Path(value) for option, value in pairwise(arguments) if option == OPTION]


def arguments_of(options: Mapping[str, Any]) -> Sequence[str]:
    """Return the command line of a node with such options: its own, or that of the process."""
    return options.get('cli_args') or sys.argv


def folder_of(name: str, arguments: Sequence[str]) -> Path:
    """Return the folder that a path in a parameter counts from: its file's, or the present one."""
    files = [path for path in _paths(arguments) if path.is_file() and name in _names_in(path)]
    return Path.cwd() if not files or name in _names_on(arguments) else (
        files[-1].resolve().parent)


def _names_in(path: Path) -> list[str]:
    return [name.partition(BLOCK)[2] for name in _flat(parse(read_text(path), path))
            if BLOCK in name and not name.startswith(LEDGER)]


def _names_on(arguments: Sequence[str]) -> list[str]:
    return [value.partition(':=')[0].rpartition(':')[2]
            for option, value in pairwise(arguments) if option in ('-p', '--param')]


def _flat(tree: Mapping[str, Any]) -> Iterator[str]:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from (f'{name}.{rest}' for rest in _flat(value))
        else:
            yield str(name)
