# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Provenance in ~/status: file, fingerprint and effects of the model that a node runs."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import FILES
from pprs_dynamics.physics.model.parameter_file import DEFAULT_MODEL, find_file
from pprs_dynamics.system.plain_text import displayed

OPTION = '--params-file'


@dataclass(frozen=True)
class Provenance:
    """Provenance of the model that is in force on a node.

    Parameters
    ----------
    files : list of dict
        `file` and `sha256` of each parameter file.
    sha256 : str
        Hash of the model.
    """

    files: list[dict[str, str]]
    sha256: str


def files_given(arguments: Sequence[str]) -> list[dict[str, str]]:
    """Return path and SHA-256 of the parameter files on a command line, in order.

    Without any it is the package's own model that a node runs.
    """
    paths = _paths(arguments) or [find_file(DEFAULT_MODEL)]
    return [{'file': displayed(path.resolve()),
             'sha256': hashlib.sha256(path.read_bytes()).hexdigest()}
            for path in paths if path.is_file()]


def hardware_of(model: DriveModel) -> str:
    """Return the name of the robot that a model describes: an arm by its URDF."""
    name = model.title.partition(' ')[2]
    described = [Path(model.values[key]).stem for key in FILES if model.values.get(key)]
    return ' '.join((name, *described))


def _paths(arguments: Sequence[str]) -> list[Path]:
    return [Path(value) for option, value in pairwise(arguments) if option == OPTION]


def arguments_of(options: Mapping[str, Any]) -> Sequence[str]:
    """Return the command line of a node: its own options, or those of the process."""
    return options.get('cli_args') or sys.argv


def folder_of(file: str, arguments: Sequence[str]) -> Path:
    """Return the folder that a relative path in a parameter counts from.

    That of the last parameter file in whose folder it exists, else the present one.
    """
    folders = [path.resolve().parent for path in reversed(_paths(arguments))]
    return next((folder for folder in folders if (folder / file).exists()), Path.cwd())
