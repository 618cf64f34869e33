# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""YAML as ROS 2 parameter files have it, within bounds that keep reading it below a second.

A few lines of YAML can expand to 10^9 values, or nest so deep that parsers give up: such files
are refused with a sentence before anything is made of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import yaml

from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.system.input_files import require_file

LARGEST = 5_000_000  # bytes: a ledger of a thousand steps
MOST_VALUES = 100_000  # what takes the time; the paper's robot has 150, a step some 70
DEEPEST = 20  # /** and ros__parameters included, a model file has 7
DEEPER = 'maximum nesting depth'  # in what the C parser of PyYAML 6.0.4 and later says of 1 000
LONGEST = 1_000  # characters of a value without quotes: no number is that long
# 10 and 90 for YAML 1.1, words for ROS 2.
ANCIENT_NUMBER = re.compile(r'[-+]?[0-9][0-9_.]*(_[0-9_.]*|(:[0-5]?[0-9])+(\.[0-9_]*)?)', re.ASCII)
STRING_TAG = 'tag:yaml.org,2002:str'

# The parser in C is ten times faster, and not everywhere.
_SafeLoader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


def read_text(path: str | PathLike[str]) -> str:
    """Return the text of a YAML file, which is within bounds.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read, is not text or YAML, or is out of bounds.
    """
    require_file(path)
    try:
        with Path(path).open('rb') as file:
            content = file.read(LARGEST + 1)
    except OSError as error:
        raise UnreadableFileError(path, error.strerror or str(error)) from None
    check_size(content, path)
    try:
        text = content.decode('utf-8')
    except UnicodeDecodeError:
        raise UnreadableFileError(path, 'not a text file in UTF-8') from None
    check_bounds(text, path)
    return text


def check_size(content: bytes, path: str | PathLike[str] = '') -> None:
    """Raise UnreadableFileError for more than is read."""
    if len(content) > LARGEST:
        raise UnreadableFileError(
            path, f'it is larger than {LARGEST // 1_000_000} MB, which no parameter file needs')


def check_bounds(text: str, path: str | PathLike[str] = '') -> None:
    """Raise UnreadableFileError where a text is no YAML, or holds what may not be there.

    The parser's events are looked at one by one: nothing is built, and the first that is out of
    bounds ends it.
    """
    depth = values = 0
    try:
        events: Iterator[Any] = yaml.parse(text, Loader=_SafeLoader)
        for event in events:
            line = event.start_mark.line + 1
            values += isinstance(event, yaml.ScalarEvent)
            if values > MOST_VALUES:
                raise UnreadableFileError(
                    path, f'line {line}: it has more than {MOST_VALUES} keys and values, which no '
                    'parameter file needs')
            if isinstance(event, (yaml.MappingStartEvent, yaml.SequenceStartEvent)):
                depth += 1
            elif isinstance(event, (yaml.MappingEndEvent, yaml.SequenceEndEvent)):
                depth -= 1
            if depth > DEEPEST:
                raise _too_deep(line, path)
            if isinstance(event, yaml.AliasEvent):
                raise UnreadableFileError(
                    path, f'line {line}: *{event.anchor} is an alias, which ROS 2 parameter files '
                    'do not know: write the value itself')
            if getattr(event, 'tag', None) not in (None, STRING_TAG):
                raise UnreadableFileError(
                    path, f'line {line}: {event.tag} is a tag, which ROS 2 parameter files do not '
                    'know: write the value alone')
            if isinstance(event, yaml.ScalarEvent) and not event.style:
                _check_unquoted(event.value, line, path)
    except yaml.YAMLError as error:
        if DEEPER in str(error):  # it looks ahead, and gives up before the event is there
            mark = getattr(error, 'problem_mark', None)
            raise _too_deep(mark.line + 1 if mark else 1, path) from None
        raise UnreadableFileError(path, f'not valid YAML: {_one_line(error)}') from None


def _too_deep(line: int, path: str | PathLike[str]) -> UnreadableFileError:
    return UnreadableFileError(path, f'line {line}: it is nested more than {DEEPEST} deep')


def _check_unquoted(value: str, line: int, path: str | PathLike[str]) -> None:
    if len(value) > LONGEST:
        raise UnreadableFileError(
            path, f'line {line}: a value has {len(value)} characters, but without quotes it must '
            f'have at most {LONGEST}')
    if ANCIENT_NUMBER.fullmatch(value):
        raise UnreadableFileError(
            path, f'line {line}: {value:.20} is a number for YAML and a word for ROS 2: write '
            'digits alone, or quotes around a word')


def parse(text: str, path: str | PathLike[str] = '') -> Any:
    """Return what a YAML text within bounds holds.

    Raises
    ------
    UnreadableFileError
        Where it is no YAML, or the same key stands twice.
    """
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise UnreadableFileError(path, f'not valid YAML: {_one_line(error)}') from None


def _one_line(error: Exception) -> str:
    return ' '.join(str(error).split())


class _StrictLoader(_SafeLoader):  # type: ignore[misc]
    """YAML that refuses the same key twice: the later one would win in silence."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(
                    None, None, 'a key must be a word', key_node.start_mark)
            key = key_node.value
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f'the key {key!r} stands twice', key_node.start_mark)
            seen.add(key)
        mapping: dict[Any, Any] = super().construct_mapping(node, deep=deep)
        return mapping


# ROS 2 reads 1e-3 and 1.0e2 as numbers; YAML 1.1, which PyYAML follows, as words.
_StrictLoader.add_implicit_resolver(
    'tag:yaml.org,2002:float', re.compile(r'[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$', re.ASCII),
    list('-+0123456789.'))
