# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Where recordings of real robots are; they are not part of the package."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def find_data(name: str, file: str) -> Path | None:
    """Return the folder of a robot's recordings that has a file, None where there is none.

    Looked for are `name` below the folder that PPRS_DATA names, that folder itself, and
    ../shared/data/`name` next to the project.
    """
    places = [Path(__file__).resolve().parents[3] / 'shared/data' / name]
    if 'PPRS_DATA' in os.environ:
        given = Path(os.environ['PPRS_DATA'])
        places = [given / name, given, *places]
    return next((place for place in places if (place / file).is_file()), None)


def missing(name: str) -> str:
    """Return what is said where there is no such folder."""
    return f'no recordings in ../shared/data/{name} or below PPRS_DATA'


def need_data(name: str, file: str) -> Path:
    """Return the same folder; a program ends where there is none."""
    found = find_data(name, file)
    return found if found is not None else sys.exit(missing(name))
