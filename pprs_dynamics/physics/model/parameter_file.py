# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""ROS 2 parameter files, in YAML, as flat keys and values of a model."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any

from pprs_dynamics.errors import ModelError, UnreadableFileError, beside
from pprs_dynamics.physics.model.keys import ADDED, NAMES
from pprs_dynamics.system.bounded_yaml import parse, read_text
from pprs_dynamics.system.plain_text import displayed

PACKAGE = 'pprs_dynamics'
DEFAULT_MODEL = 'config/paper.yaml'
# Section of the ledger. ROS 2 reads only sections of nodes; no node has this name, so that the
# ledger is no node's parameter. Files of before have it among the model's keys.
LEDGER = '/pprs_dynamics/ledger'


def find_file(path: str | PathLike[str]) -> Path:
    """Return the file itself, or the package's own of that name (e.g. config/paper.yaml).

    Raises
    ------
    UnreadableFileError
        Where there is neither, and for what is no path.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise UnreadableFileError(
            path, f"it is of type {type(path).__name__}, must be a model's file, such as "
            f"'{DEFAULT_MODEL}'")
    if not os.fspath(path):  # which would be the present folder
        raise UnreadableFileError("''", 'the name of a model file must not be empty')
    given = Path(path)
    if given.exists() or given.is_absolute():
        return given
    own = Path(str(files(PACKAGE) / str(given)))
    if own.is_file():
        return own
    close = beside(given)
    raise UnreadableFileError(path, 'no such file, nor one of that name in the package'
                              + (f' (did you mean {displayed(close)}?)' if close else ''))


def default_parameters() -> dict[str, Any]:
    """Return the flat keys and values of the paper's robot."""
    return read_parameters(find_file(DEFAULT_MODEL))


def read_parameters(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the flat keys and values of a ROS 2 parameter file.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read, is not YAML within bounds, or has no `ros__parameters`.
    ModelError
        For a list that mixes whole and decimal numbers, which ROS 2 refuses.
    """
    text = read_text(path)
    if text.lstrip('\ufeff \r\n\t').startswith('<'):
        raise UnreadableFileError(
            path, 'a description of a robot, must be a model file: `pprs init '
            f'{displayed(path)} RECORDING --output robot.yaml` writes one')
    return parse_parameters(text, path)


def parse_parameters(text: str, path: str | PathLike[str] = '') -> dict[str, Any]:
    """Return the flat keys and values of a parameter file's text; `path` is named in errors."""
    flat: dict[str, Any] = {}
    model, ledger = _parameters_blocks(path, parse(text, path))
    for key, value in (*flatten(model), *flatten(ledger)):
        if key in flat:
            raise ModelError(key, value, 'occur once: nested, with dots, or in a section of its '
                             'own', str(path))
        flat[key] = value
        if isinstance(value, list) and len({type(element) for element in value}) > 1:
            raise ModelError(key, value, 'contain elements of one type, as ROS 2 demands '
                             '(write 0.0, not 0, among decimal numbers)', str(path))
    return flat


def other_nodes(text: str) -> dict[str, Any]:
    """Return the blocks of a parameter file's text that are for single nodes, not the model."""
    content = parse(text)
    chosen = _parameters_blocks('', content)
    return {node: block for node, block in content.items()
            if not any(block['ros__parameters'] is parameters for parameters in chosen)}


def _parameters_blocks(path: object, content: Any) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Return the block of the model and that of its ledger."""
    if not isinstance(content, Mapping) or not content:
        raise UnreadableFileError(path, 'not a model file: it must map /** to ros__parameters')
    blocks: dict[str, Mapping[str, Any]] = {}
    for node, block in content.items():
        if not isinstance(block, Mapping) or not isinstance(block.get('ros__parameters'), Mapping):
            raise UnreadableFileError(
                path, f'not a model file: {node} must contain a mapping ros__parameters')
        blocks[node] = block['ros__parameters']
    ledger = blocks.pop(LEDGER, {})
    for key, value in flatten(ledger):
        if not key.startswith('history'):
            raise ModelError(key, value, f'not be under {LEDGER}, which contains history alone',
                             str(path))
    if '/**' in blocks:
        for node, block in blocks.items():
            for key, _ in flatten(block) if node != '/**' else ():
                if key in NAMES or key.startswith(ADDED):
                    raise UnreadableFileError(
                        path, f'{key} of the model is under {node}: put it under /**, for '
                        'every node and command alike')
        return blocks['/**'], ledger
    if len(blocks) != 1:
        raise UnreadableFileError(
            path, f'parameters of {len(blocks)} nodes and none for all: put the model under /**')
    return next(iter(blocks.values())), ledger


def flatten(block: Mapping[Any, Any], prefix: str = '') -> Iterator[tuple[str, Any]]:
    """Yield flat keys and values of nested ones; an empty block is a value."""
    for key, value in block.items():
        if isinstance(value, Mapping) and value:
            yield from flatten(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value
