# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model files with the names that effects had as long as only a 3-PPRS had them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pprs_dynamics.physics.effects.former_names import FORMER, general_name, told_general_name
from pprs_dynamics.physics.model.ledger import BLOCK, PREVIOUS

ACTIVE = 'effects.active'


def with_general_names(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return flat keys and values with the names of today, and tell them in a warning.

    Where a key stands under both names, that of today counts.
    """
    found: dict[str, Any] = {}
    for key, value in parameters.items():
        name = _key(key)
        if name == key or name not in parameters:
            found[name] = _value(key, value, parameters)
    active = parameters.get(ACTIVE)
    for name in active if isinstance(active, (list, tuple)) else ():
        if isinstance(name, str):
            told_general_name(name)
    return found


def _key(key: str) -> str:
    """Return the name of a key today."""
    block, _, rest = key.partition('.')
    if block == BLOCK:
        step, _, name = rest.partition('.')
        kept = f'{PREVIOUS}.'
        return (f'{BLOCK}.{step}.{kept}{_key(name.removeprefix(kept))}'
                if name.startswith(kept) else key)
    effect, _, parameter = rest.partition('.')
    if block not in ('effects', 'uncertainties') or effect not in FORMER:
        return key
    return f'{block}.{FORMER[effect].effect}.{FORMER[effect].parameter(parameter)}'


def _value(key: str, value: Any, parameters: Mapping[str, Any]) -> Any:
    """Return the value of a key with the names of today."""
    step, _, name = key.rpartition('.')
    if key.endswith(ACTIVE) and isinstance(value, (list, tuple)):
        return list(dict.fromkeys(map(general_name, value)))
    if not key.startswith(f'{BLOCK}.') or f'.{PREVIOUS}.' in key:
        return value
    if name == 'effect':
        return general_name(value)
    if name == 'rivals' and isinstance(value, (list, tuple)):
        return list(map(general_name, value))
    if name in ('added', 'removed') and isinstance(value, (list, tuple)):
        return list(map(_key, value))
    effect = parameters.get(f'{step}.effect')
    if name == 'parameters' and effect in FORMER and isinstance(value, (list, tuple)):
        return list(map(FORMER[effect].parameter, value))
    return value
