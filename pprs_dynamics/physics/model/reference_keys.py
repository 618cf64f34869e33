# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Reference runs of a model file: the recordings of the day on which its numbers were right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pprs_dynamics.errors import ModelError, UnknownNameError
from pprs_dynamics.physics.model.keys import ANY, Key

REFERENCE = 'reference'
HASHES = 'reference_sha256'
KEYS = {REFERENCE: Key(REFERENCE, 'runs that pprs fit wrote', size=ANY, is_text=True),
        HASHES: Key(HASHES, 'SHA-256 of each, that pprs fit wrote', size=ANY, is_text=True)}


class ReferenceFile(NamedTuple):
    """A reference run as a model file names it."""

    path: Path
    sha256: str


def reference_files(values: Mapping[str, Any], source: str) -> tuple[ReferenceFile, ...]:
    """Return the reference runs that values name, paths from the folder of their file."""
    folder = Path(source).absolute().parent if source else Path()
    return tuple(ReferenceFile(folder / name, sha256) for name, sha256 in zip(
        values.get(REFERENCE, ()), values.get(HASHES, ()), strict=True))


def with_reference(values: Mapping[str, Any], files: Sequence[ReferenceFile]) -> dict[str, Any]:
    """Return values that name reference runs, in place of others."""
    new = {REFERENCE: [str(file.path) for file in files], HASHES: [file.sha256 for file in files]}
    return {**{key: value for key, value in values.items() if key not in KEYS},
            **{key: value for key, value in new.items() if value}}


def check_reference(parameters: Mapping[str, Any]) -> None:
    """Raise ModelError for reference runs that are none."""
    for key, value in parameters.items():
        if key.partition('_')[0] != REFERENCE:
            continue
        if key not in KEYS:
            raise UnknownNameError('key', key, tuple(KEYS))
        KEYS[key].check(value)
    if len(parameters.get(REFERENCE, ())) != len(parameters.get(HASHES, ())):
        raise ModelError(REFERENCE, list(parameters.get(REFERENCE, ())),
                         f'have a SHA-256 each under {HASHES}: pprs fit writes both')
