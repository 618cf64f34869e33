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
# What nodes do to arrays: make, arrange and check them, and sum up how old and how long. The rest
# of numpy and math is mathematics, and belongs to physics.
ARRANGING = frozenset(f'numpy.{name}' for name in (
    'abs', 'all', 'any', 'append', 'arange', 'array', 'asarray', 'ascontiguousarray', 'clip',
    'concatenate', 'divmod', 'dtype', 'empty', 'frombuffer', 'inf', 'int64', 'isfinite', 'median',
    'minimum', 'nan', 'nanmax', 'ndarray', 'percentile', 'ptp', 'random.default_rng', 'stack',
    'tile', 'typing.NDArray', 'where', 'zeros', 'zeros_like')) | {'math.inf', 'math.isfinite'}
MATHEMATICS = ('numpy', 'math', 'cmath', 'scipy')
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


def mathematics(text: str) -> set[str]:
    """Return what a file's code calculates that a node must not, under whatever name it has it."""
    tree = ast.parse(text)
    meant: dict[str, str] = {}  # what a name in the file stands for
    inner = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                meant[alias.asname or alias.name.split('.')[0]] = (
                    alias.name if alias.asname else alias.name.split('.')[0])
                found |= {alias.name} if '.' in alias.name else set()
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f'{node.module}.{alias.name}' for alias in node.names}
        elif isinstance(node, (ast.BinOp, ast.AugAssign)):
            powers = (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow)
                      and not isinstance(node.left, ast.Constant))
            found |= {'@'} if isinstance(node.op, ast.MatMult) else {'**'} if powers else set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and id(node) not in inner:
            chain = ast.unparse(node)
            if chain.replace('.', '').isidentifier():  # else it belongs to what a call returns
                first, *rest = chain.split('.')
                found.add('.'.join([meant.get(first, first), *rest]))
    return {name for name in found if name in ('@', '**') or (
        name.split('.')[0] in MATHEMATICS and name not in ARRANGING)}
