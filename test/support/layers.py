# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Who may import whom, as the tests of the code and of docs/architecture.md both ask it."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / 'pprs_dynamics'
# Each layer uses itself and those named; arrows point from what stands on to what it stands on.
MAY_USE = {
    'system': set(),
    'physics': {'system'},
    'measurement': {'system'},
    'inference': {'system', 'physics', 'measurement'},
    'simulation': {'system', 'physics', 'measurement', 'inference'},
    'ros': {'system', 'physics', 'measurement', 'simulation', 'inference'},
    'app': {'system', 'physics', 'measurement', 'simulation', 'inference', 'ros'},
}
# Inside a layer, a folder uses itself and those before it.
FOLDERS = {
    'physics': ['mechanism', 'effects', 'three_pprs', 'model'],
    'measurement': ['files', 'motion'],
    'inference': ['residuals', 'readings', 'regression', 'search', 'fit', 'diagnosis', 'adoption',
                  'experiments'],
    'ros': ['messages', 'node'],
    'app': ['fleet', 'report', 'api', 'workbench', 'commands'],
}


def imports(file: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


def imported_files(file: Path) -> set[Path]:
    """Return the files of the package that a file imports anywhere, in functions too."""
    names = imports(file)
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {f'{node.module}.{alias.name}' for alias in node.names}
    paths = (PACKAGE.parent.joinpath(*name.split('.')).with_suffix('.py') for name in names)
    return {path for path in paths if path.is_file() and PACKAGE in path.parents}


def circles(graph: dict[Path, set[Path]]) -> set[Path]:
    """Return the files of a graph of imports that import each other, over however many files."""
    left = {file: set(used) for file, used in graph.items()}
    # Files are taken away that import none of the rest, then those that none of the rest imports.
    for _ in range(2):
        while free := {file for file, used in left.items() if not used & left.keys()}:
            left = {file: used for file, used in left.items() if file not in free}
        left = {file: {other for other in left if file in left[other]} for file in left}
    return set(left)


def files() -> list[Path]:
    return sorted(file for file in PACKAGE.rglob('*.py') if file.parent != PACKAGE)
