# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""YAML as ROS 2 parameter files have it: small, with each key once, without aliases and tags."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar

import yaml

from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.system.files import readable, require_file

LARGEST = 5_000_000  # bytes: a ledger of a thousand steps
# The parser in C is ten times faster, and not everywhere.
_SafeLoader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
NUMBERS = {
    'tag:yaml.org,2002:int': r'[-+]?(0x[0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)$',
    'tag:yaml.org,2002:float': (r'[-+]?((\d+\.\d*|\.\d+)([eE][-+]?\d+)?|\d+[eE][-+]?\d+)$'
                                r'|[-+]?\.(inf|Inf|INF)$|\.(nan|NaN|NAN)$')}


def read_text(path: str | PathLike[str]) -> str:
    """Return the text of a YAML file.

    Raises
    ------
    UnreadableFileError
        If it cannot be read, is too large, or is not text.
    """
    require_file(path)
    with readable(path), Path(path).open('rb') as file:
        content = file.read(LARGEST + 1)
    check_size(content, path)
    try:
        return content.decode('utf-8')
    except UnicodeDecodeError:
        raise UnreadableFileError(path, 'not a text file in UTF-8') from None


def check_size(content: bytes, path: str | PathLike[str] = '') -> None:
    """Raise UnreadableFileError for more than is read."""
    if len(content) > LARGEST:
        raise UnreadableFileError(
            path, f'it is larger than {LARGEST // 1_000_000} MB, which no parameter file needs')


def parse(text: str, path: str | PathLike[str] = '') -> Any:
    """Return the content of a YAML text.

    Raises
    ------
    UnreadableFileError
        If it is not YAML, or has an alias, a tag or the same key twice.
    """
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except RecursionError:
        raise UnreadableFileError(path, 'not valid YAML: it is nested too deep') from None
    except (yaml.YAMLError, ValueError, OverflowError, KeyError, AttributeError) as error:
        raise UnreadableFileError(
            path, f'not valid YAML: {" ".join(str(error).split())[:200]}') from None


class _StrictLoader(_SafeLoader):  # type: ignore[misc]
    """YAML with numbers as ROS 2 reads them. An alias may expand to 10^9 values."""

    yaml_implicit_resolvers: ClassVar[Any] = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag not in NUMBERS]
        for first, resolvers in _SafeLoader.yaml_implicit_resolvers.items()}

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        if node in self.constructed_objects or node in self.recursive_objects:
            raise yaml.constructor.ConstructorError(
                None, None, 'an alias, which ROS 2 does not know: write the value itself',
                node.start_mark)
        return super().construct_object(node, deep=deep)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(
                    None, None, 'a key must be a word', key_node.start_mark)
            key = key_node.value
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f'the key {key!r} is given twice', key_node.start_mark)
            seen.add(key)
        mapping: dict[Any, Any] = super().construct_mapping(node, deep=deep)
        return mapping


for _tag, _pattern in NUMBERS.items():
    _StrictLoader.add_implicit_resolver(_tag, re.compile(_pattern, re.ASCII), list('-+.0123456789'))
