# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Values of a model's keys: known, each checked, and complete with defaults."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.model.effects_block import check_tolerances, check_uncertainties
from pprs_dynamics.physics.model.keys import (
    ADDED,
    NAMED_BLOCKS,
    NAMES,
    NODE_KEYS,
    NODE_PREFIXES,
    is_described,
    keys_of,
)
from pprs_dynamics.physics.model.reference_keys import check_reference


@contextmanager
def source_of_errors(source: str) -> Iterator[None]:
    """Name a source, e.g. a file, in a ModelError that names none."""
    try:
        yield
    except ModelError as error:
        error.source = error.source or source
        raise


def checked_values(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of all keys, complete with defaults, and the added blocks as given."""
    values: dict[str, Any] = {}
    keys = keys_of(parameters)
    _require_known(parameters)
    for name, key in keys.items():
        if name in parameters:
            values[name] = key.check(parameters[name])
        elif key.default is None:
            raise ModelError(name, MISSING, key.rule)
        else:
            values[name] = key.default
    check_tolerances(parameters, keys)
    check_uncertainties(parameters)
    check_reference(parameters)
    return {**values, **{name: value for name, value in parameters.items()
                         if name.startswith(ADDED)}}


def _require_known(parameters: Mapping[str, Any]) -> None:
    keys = keys_of(parameters)
    named: Iterable[str] = NAMED_BLOCKS if is_described(parameters) else ()
    blocks = {prefix for key in (*keys, *ADDED, *named) for prefix in _prefixes(key)}
    for name, value in parameters.items():
        if name in keys or _is_for_others(name):
            continue
        if name not in blocks:
            raise UnknownNameError('key', name, (*keys, *NODE_KEYS, *sorted(blocks)))
        if value not in (None, {}):  # a block that somebody left empty says nothing
            raise ModelError(name, value, 'be a mapping, of names to what they hold')


def _prefixes(key: str) -> Iterator[str]:
    """Yield the blocks that a key is in: a and a.b of a.b.c."""
    parts = key.split('.')
    yield from ('.'.join(parts[:count]) for count in range(1, len(parts)))


def is_known(name: str) -> bool:
    """Return whether a model file may hold a key of that name."""
    return name in NAMES or _is_for_others(name)


def _is_for_others(name: str) -> bool:
    """Return whether a key is a node's, or of a block whose keys are not listed one by one."""
    return name in NODE_KEYS or name.startswith((*NODE_PREFIXES, *ADDED))
