# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The blocks `effects` and `tolerances` of a model file, for models of every kind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.effects.catalogue import catalogue, find_effect
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.keys import Key, title_of

# Keys of the block `effects` that are no effect.
LISTS = ('effects.active', 'effects.measured')


def added_effects(
    parameters: Mapping[str, Any], robot: Any,
) -> Iterator[CatalogueEffect]:
    """Yield the effects that are active on a robot, all blocks checked."""
    active = parameters.get('effects.active', [])
    if not isinstance(active, (list, tuple)) or not all(isinstance(n, str) for n in active):
        raise ModelError('effects.active', active, 'be a list of names of effects')
    if len(set(active)) < len(active):
        raise ModelError('effects.active', list(active), 'name each effect once')
    for name in active:
        if find_effect(name) is None:
            raise _unknown(name, 'effects.active')
    blocks = _nested('effects', {key: value for key, value in parameters.items()
                                 if key.startswith('effects.') and key not in LISTS})
    of_sensors = _effects_of_sensors(parameters)
    for name, block in blocks.items():
        found = find_effect(name)
        if found is None:
            raise _unknown(name, 'effects')
        _check_place(name, block, found, robot.kind, robot.drives, title_of(parameters))
        found = found.bound(robot)
        # A block that is not active is checked all the same, but may still be incomplete.
        if issubclass(found, DriveEffect):
            found.check_bounds(block, robot.turning)
        effect = found.from_file(block, complete=name in active)
        if name in active:
            if name in of_sensors:
                effect.is_measurement = True
            yield effect
    missing = [name for name in active if name not in blocks]
    if missing:
        raise ModelError(f'effects.{missing[0]}', MISSING, 'be given: effects.active names it')


def _unknown(name: str, place: str) -> UnknownNameError:
    return UnknownNameError('effect', name, catalogue(), place)


def _check_place(name: str, block: Any, effect: type[CatalogueEffect], kind: str,
                 drives: tuple[str, ...], title: str) -> None:
    """Raise ModelError where an effect is not one of this kind of model, or on another drive."""
    if kind not in effect.acts_in:
        raise ModelError(f'effects.{name}', block, 'be an effect that acts in ' + title)
    if issubclass(effect, DriveEffect) and isinstance(block, Mapping):
        for drive in block:
            if drive not in drives:
                raise UnknownNameError('drive', drive, drives, f'effects.{name}')


def _effects_of_sensors(parameters: Mapping[str, Any]) -> list[str]:
    names = parameters.get('effects.measured', [])
    if not isinstance(names, (list, tuple)) or not all(
            isinstance(name, str) and (kind := find_effect(name)) is not None
            and kind.may_be_measurement for name in names):
        raise ModelError('effects.measured', names, "be a list of effects that may be a sensor's:"
                         ' effort_offset')
    return list(names)


def check_tolerances(parameters: Mapping[str, Any], keys: Mapping[str, Key]) -> None:
    """Raise ModelError for a tolerance that is none, or of nothing that has one.

    Numbers of the model have one, in proportion to them; and what is usually small where a file
    says nothing, such as the error of a zero, in its unit.
    """
    for name, value in parameters.items():
        target = name.removeprefix('tolerances.')
        if target == name:
            continue
        if (target not in keys or not keys[target].is_number) and _expected(target) is None:
            raise UnknownNameError('key', name, [f'tolerances.{key}' for key in keys
                                                 if keys[key].is_number])
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= 1:
            raise ModelError(name, value, 'be a relative tolerance between 0 and 1')


def _expected(target: str) -> tuple[float, float] | None:
    """Return how large `effect.parameter` usually is, None for what has no usual size."""
    name, _, last = target.partition('.')
    effect = find_effect(name) if last else None
    return next((p.expected for p in effect.parameters if p.name == last),
                None) if effect is not None and hasattr(effect, 'parameters') else None


def _nested(root: str, flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tree below `root`; a name cannot be a value and a block at once."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *folders, leaf = name.removeprefix(f'{root}.').split('.')
        branch = tree
        for folder in folders:
            branch = branch.setdefault(folder, {})
            if not isinstance(branch, dict):
                raise ModelError(name, value, f'not stand below {folder}, which has a value')
        if isinstance(branch.get(leaf), dict):
            raise ModelError(name, value, 'not be a value: keys stand below it')
        branch[leaf] = value
    return tree
