# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Paths in files: from the file's folder, or `package://NAME/PATH` in an installed ROS package.

A package is looked for in the ament index, in `ROS_PACKAGE_PATH`, and around the file; nothing of
ROS is imported.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from pprs_dynamics.errors import UnreadableFileError

SCHEME = 'package://'
NAME = re.compile(r'<name>\s*([^<\s]+)\s*</name>')
INDEX = 'share/ament_index/resource_index/packages'


def located(path: str, folder: Path) -> Path:
    """Return the absolute path of what a file in a folder names.

    Raises
    ------
    UnreadableFileError
        For `package://` of a package that is nowhere.
    """
    if not path.startswith(SCHEME):
        return (folder / path).resolve()
    name, _, rest = path.removeprefix(SCHEME).partition('/')
    found = next(_places(name, folder.resolve()), None)
    if found is None:
        raise UnreadableFileError(
            path, f'package {name} is in none of AMENT_PREFIX_PATH, ROS_PACKAGE_PATH and the '
            f'folders around {folder.resolve()}: source its workspace, or write the path of the '
            'file')
    return (found / rest).resolve()


def _places(name: str, folder: Path) -> Iterator[Path]:
    """Yield the folders of a package."""
    for prefix in _listed('AMENT_PREFIX_PATH'):
        if (prefix / INDEX / name).exists():
            yield prefix / 'share' / name
    for root in (*_listed('ROS_PACKAGE_PATH'), folder, *folder.parents):
        if _is_package(root, name):
            yield root
        if (root / name).is_dir():  # it may have been copied without its package.xml
            yield root / name


def _listed(variable: str) -> list[Path]:
    return [Path(path) for path in os.environ.get(variable, '').split(os.pathsep) if path]


def _is_package(place: Path, name: str) -> bool:
    """Return whether a folder is that of the package, by its package.xml."""
    try:
        found = NAME.search((place / 'package.xml').read_text(encoding='utf-8', errors='replace'))
    except OSError:
        return False
    return found is not None and found[1] == name
