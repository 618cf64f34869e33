# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Writer of model files: every key in its place, as ROS 2 and people read them.

A file that exists is edited: what does not change keeps its place and its comments, so that a
diff against the old one shows what was changed and nothing else. The blocks `effects` and
the ledger, which commands write, are written anew at the end of the model and of the file.

A library that keeps comments, ruamel.yaml, formats the whole file anew. It changed untouched
lines in nine of 15 forms of a model file, among them indentation by four spaces, values in a
column and lists over several lines. It also writes 1e-05, which is a word for YAML 1.1.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import yaml

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import ModelError, PprsError
from pprs_dynamics.physics.effects.catalogue import find_parameter
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import DRIVES_KEY, FILES, Key, as_list, keys_of
from pprs_dynamics.physics.model.ledger import BLOCK
from pprs_dynamics.physics.model.parameter_file import (
    LEDGER,
    other_nodes,
    parse_parameters,
    read_parameters,
)
from pprs_dynamics.physics.model.parameter_values import LISTS, REFERENCE, UNCERTAINTIES
from pprs_dynamics.system.bounded_yaml import check_size, parse
from pprs_dynamics.system.files import write_text
from pprs_dynamics.system.package_files import located
from pprs_dynamics.system.plain_yaml import as_yaml

WRITTEN = ('effects', UNCERTAINTIES, BLOCK)  # blocks of commands; the rest is people's
INDENT = '  '
DEPTH = 2  # of the keys, below /** and ros__parameters
COMMENT_COLUMN = 46
# A key and its value, if that is on the same line, with the comment after it.
ENTRY = re.compile(r'(?P<start> *(?P<name>[^\s#:][^:#]*): *)(?P<value>[^#\n]*?)(?P<space> *)'
                   r'(?P<comment>#.*)?\n?$')


def write_model(path: str | PathLike[str], values: Mapping[str, Any],
                base: str | PathLike[str] | None = None) -> None:
    """Write a model file atomically.

    Parameters
    ----------
    path : path
    values : mapping
        Flat keys and values, as of `DriveModel.values` or `read_parameters`.
    base : path, optional
        The model file that is to be edited; its keys that `values` does not name, as those of
        nodes, stay.

    Raises
    ------
    ModelError
        For values that are no model, or a path that is the base itself.
    UnreadableFileError
        Where a file cannot be read or written.
    """
    values = moved(values, Path(base or path).absolute().parent, Path(path).absolute().parent)
    if base is not None:
        refuse_same_file(path, base)
        values = {**kept_parameters(base), **values}
    DriveModel.from_parameters(values, str(path))
    text = format_model(values) if base is None else edit_model(
        Path(base).read_text(encoding='utf-8'), values)
    check_size(text.encode('utf-8'), path)  # what could not be read again is not written
    write_text(path, text)


def moved(values: Mapping[str, Any], before: Path, after: Path) -> dict[str, Any]:
    """Return values whose files are named from another folder."""
    return {key: os.path.relpath(located(value, before), after) if key in FILES and value
            else [os.path.relpath(before / name, after) for name in value] if key == REFERENCE
            else value for key, value in values.items()}


def refuse_same_file(path: str | PathLike[str], base: str | PathLike[str]) -> None:
    """Raise ModelError where an output would replace the model it was made from."""
    if os.path.exists(path) and os.path.samefile(path, base):
        raise ModelError('--output', str(path), 'be another file than the model: the old one is '
                         'never touched')


def kept_parameters(base: str | PathLike[str]) -> dict[str, Any]:
    """Return the keys of nodes in a model file, and their values."""
    parameters = read_parameters(base)
    keys = keys_of(parameters)
    return {key: value for key, value in parameters.items()
            if key not in keys and key.split('.')[0] not in (*WRITTEN, 'tolerances')}


def format_model(values: Mapping[str, Any]) -> str:
    """Return a complete model file, its keys in order and with their units."""
    keys = keys_of(values)
    ordered = {key: values[key] for key in keys if key in values}
    ordered.update((key, value) for key, value in values.items() if key not in ordered
                   and not key.startswith(tuple(f'{block}.' for block in WRITTEN)))
    lines = ['/**:', f'{INDENT}ros__parameters:', *_lines(ordered, DEPTH, keys),
             *_effects_block(values), *_ledger_section(values)]
    text = '\n'.join(lines) + '\n'
    assert _same(parse_parameters(text), values), 'a model file must contain what was written'
    return text


def edit_model(text: str, values: Mapping[str, Any]) -> str:
    """Return the text of a model file with other values.

    Parameters
    ----------
    text : str
        Of a model file.
    values : mapping
        All flat keys and values that it shall hold; keys that it does not hold and that have
        their default stay out.
    """
    old = parse_parameters(text)
    keys = keys_of(values)
    wanted = {key: value for key, value in values.items()
              if key in old or key not in keys or as_list(value) != as_list(keys[key].default)}
    edited = _edited(text, old, wanted)
    try:
        if _same(parse_parameters(edited), wanted):
            return edited
    except PprsError:
        pass
    # A file of a form that cannot be edited line by line.
    others = other_nodes(text)
    return format_model(values) + (yaml.safe_dump(others, sort_keys=False) if others else '')


def _edited(text: str, old: Mapping[str, Any], wanted: Mapping[str, Any]) -> str:
    """Return the text with wanted values, each key on a line of its own.

    The written blocks go, and come anew after the last key of the model and at the end.
    """
    model = next(iter(sorted(parse(text), key=lambda node: node != '/**')))
    new = {key: value for key, value in wanted.items() if key.split('.')[0] not in WRITTEN
           and as_list(old.get(key)) != as_list(value)}
    lines: list[str] = []
    parents: list[tuple[int, str]] = []  # indents and names of the blocks that a line is in
    end, margin, dropped, there = 0, DEPTH * len(INDENT), -1, set()
    for line in text.splitlines(keepends=True):
        indent, content = len(line) - len(line.lstrip(' ')), line.strip()
        if dropped >= 0 and content:
            if indent > dropped:
                continue
            dropped = -1
        entry = ENTRY.match(line)
        if entry is not None:
            while parents and parents[-1][0] >= indent:
                parents.pop()
            parents.append((indent, entry['name'].strip('"\'')))
            node, _, *names = [name for _, name in parents] + [''] * (len(parents) < 2)
            key = '.'.join(names)
            if node == LEDGER or (node == model and key.split('.')[0] in WRITTEN):
                dropped = indent
                continue
            if node == model and key:
                there.add(key.split('.')[0])
                margin = indent if len(names) == 1 else margin
                if key in new and entry['value']:
                    line = f"{entry['start']}{as_yaml(as_list(new.pop(key)))}"
                    if entry['comment']:
                        line = f"{line.ljust(entry.start('comment') - 2)}  {entry['comment']}"
                    line += '\n'
        lines.append(line)
        if parents and parents[0][1] == model and content and not content.startswith('#'):
            end = len(lines)
    keys = keys_of(wanted)
    whole = {key: value for key, value in new.items()
             if key in keys and key.split('.')[0] not in there}
    shift = ' ' * (margin - DEPTH * len(INDENT))
    added = [*(f'{" " * margin}{key}: {as_yaml(as_list(value))}' for key, value in new.items()
               if key not in whole),
             *(shift + line for line in _lines(whole, DEPTH, keys)),
             *_effects_block(wanted, margin)]
    lines[:end] = [line if line.endswith('\n') else f'{line}\n' for line in lines[:end]]
    return ''.join((*lines[:end], *(f'{line}\n' for line in added), *lines[end:],
                    *(f'{line}\n' for line in _ledger_section(wanted))))


def _ledger_section(values: Mapping[str, Any]) -> list[str]:
    found = {key: value for key, value in values.items() if key.startswith(f'{BLOCK}.')}
    return [f'{LEDGER}:', f'{INDENT}ros__parameters:', *_lines(found, DEPTH, {})] if found else []


def _effects_block(values: Mapping[str, Any], indent: int = DEPTH * len(INDENT)) -> list[str]:
    """Return the blocks of effects and uncertainties, effects as added, drives in order.

    `effects.active` is the last of its block: `ros2 param load` sets one key after the other,
    and a node takes no effect whose parameters it does not have.
    """
    order = [*(values.get('effects.active') or ()), *values.get(DRIVES_KEY, DRIVES)]
    keys = [key for key in values if key.startswith(('effects.', f'{UNCERTAINTIES}.'))]
    found = {key: values[key] for key in sorted(keys, key=lambda key: (
        key.startswith(UNCERTAINTIES), key in LISTS,
        *(order.index(name) if name in order else len(order) for name in key.split('.')[1:3])))}
    return [' ' * (indent - DEPTH * len(INDENT)) + line for line in _lines(found, DEPTH, {})]


def _lines(values: Mapping[str, Any], depth: int, keys: Mapping[str, Key],
           prefix: str = '') -> list[str]:
    """Return flat keys as nested lines, each with its comment."""
    found: list[str] = []
    done = set()
    for key in values:
        rest = key.removeprefix(prefix)
        name = rest.split('.')[0]
        if name in done:
            continue
        done.add(name)
        start = INDENT * depth + f'{name}:'
        below = {k: v for k, v in values.items() if k.startswith(f'{prefix}{name}.')}
        if below:
            found += [start, *_lines(below, depth + 1, keys, f'{prefix}{name}.')]
            continue
        line = f'{start} {as_yaml(as_list(values[key]))}'
        comment = _comment(key, keys)
        found.append(f'{line.ljust(COMMENT_COLUMN)}  # {comment}' if comment else line)
    return found


def _comment(key: str, keys: Mapping[str, Key]) -> str:
    known = keys.get(key)
    if known is not None:
        return known.description + (f' [{known.unit}]' if known.unit else '')
    block, _, rest = key.partition('.')
    parameter = find_parameter(rest) if block == 'effects' else None
    return ('' if parameter is None
            else f'{parameter.symbol}, {parameter.description} [{parameter.unit}]')


def _same(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> bool:
    return {k: as_list(v) for k, v in found.items()} == {k: as_list(v) for k, v in wanted.items()}
