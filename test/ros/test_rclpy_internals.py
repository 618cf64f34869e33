# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Names of rclpy that are not public are all in one module."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from rclpy import node as rclpy_node

import pprs_dynamics

PROJECT = Path(__file__).parents[2]


def private_names(file: Path) -> list[str]:
    """Return what a file takes from modules or objects that is not public."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f'{node.module}.{alias.name}' for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            names = []
        found += [name for name in names if re.match(r'rclpy\.(impl|_)', name)]
        if (isinstance(node, ast.Attribute) and re.match('_[^_]', node.attr)
                and not (isinstance(node.value, ast.Name) and node.value.id in ('self', 'cls'))):
            found.append(node.attr)
    return found


def test_no_other_file_of_the_nodes_uses_names_that_are_not_public() -> None:
    files = [*(PROJECT / 'pprs_dynamics' / 'ros').rglob('*.py'),
             *(PROJECT / 'benchmarks' / 'node').glob('*.py'), *(PROJECT / 'demo').glob('*.py')]
    found = {file.name: private_names(file) for file in files}
    assert found.pop('rclpy_internals.py')
    # The system's own way to end a process.
    assert {name for names in found.values() for name in names} <= {'_exit'}


def test_no_attribute_of_a_node_takes_the_place_of_rclpys() -> None:
    """A node of ours that had its own `_subscriptions` heard no /clock any more."""
    def nodes(path: Path) -> dict[str, set[str]]:
        """Return the private attributes that each class of nodes in a file sets."""
        found = {}
        for definition in ast.walk(ast.parse(path.read_text())):
            if isinstance(definition, ast.ClassDef) and (definition.name == 'Node' or any(
                    'Node' in ast.unparse(base) for base in definition.bases)):
                found[definition.name] = {
                    node.attr for node in ast.walk(definition)
                    if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
                    and ast.unparse(node.value) == 'self' and node.attr.startswith('_')}
        return found
    taken = nodes(Path(rclpy_node.__file__))['Node']
    assert {'_subscriptions', '_publishers', '_timers'} <= taken
    ours = {name: found for path in (Path(pprs_dynamics.__file__).parent / 'ros').rglob('*.py')
            for name, found in nodes(path).items()}
    assert len(ours) >= 5
    assert {name: found & taken for name, found in ours.items() if found & taken} == {}
