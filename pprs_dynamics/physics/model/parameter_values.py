# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Values of a model's keys: known, each checked, and complete with defaults.

Reference runs of a model file are the recordings of the day on which its numbers were right.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.effects.catalogue import catalogue, find_effect, find_parameter
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model import keys

REFERENCE = 'reference'
HASHES = 'reference_sha256'
REFERENCE_KEYS = {
    REFERENCE: keys.Key(REFERENCE, 'runs that pprs fit wrote', size=keys.ANY, is_text=True),
    HASHES: keys.Key(HASHES, 'SHA-256 of each, that pprs fit wrote', size=keys.ANY, is_text=True)}
UNCERTAINTIES = 'uncertainties'
# Keys of the block `effects` that are no effect.
ACTIVE = keys.Key('effects.active', 'effects in force', size=keys.ANY, is_text=True)
LISTS = (ACTIVE.name, 'effects.measured')


class ReferenceFile(NamedTuple):
    """A reference run as a model file names it."""

    path: Path
    sha256: str


def reference_files(values: Mapping[str, Any], source: str) -> tuple[ReferenceFile, ...]:
    """Return the reference runs that values name, paths from the folder of their file."""
    folder = Path(source).absolute().parent if source else Path()
    return tuple(ReferenceFile(folder / name, sha256) for name, sha256 in zip(
        values.get(REFERENCE, ()), values.get(HASHES, ()), strict=True))


def with_reference(values: Mapping[str, Any], files: Sequence[ReferenceFile]) -> dict[str, Any]:
    """Return values that name reference runs, in place of others."""
    new = {REFERENCE: [str(file.path) for file in files], HASHES: [file.sha256 for file in files]}
    return {**{key: value for key, value in values.items() if key not in REFERENCE_KEYS},
            **{key: value for key, value in new.items() if value}}


def check_reference(parameters: Mapping[str, Any]) -> None:
    """Raise ModelError for reference runs that are none."""
    for key, value in parameters.items():
        if key.partition('_')[0] != REFERENCE:
            continue
        if key not in REFERENCE_KEYS:
            raise UnknownNameError('key', key, tuple(REFERENCE_KEYS))
        REFERENCE_KEYS[key].check(value)
    if len(parameters.get(REFERENCE, ())) != len(parameters.get(HASHES, ())):
        raise ModelError(REFERENCE, list(parameters.get(REFERENCE, ())),
                         f'have a SHA-256 each under {HASHES}: pprs fit writes both')


def effect_uncertainties(values: Mapping[str, Any], effect: str) -> dict[str, float]:
    """Return the standard deviation of each parameter of an effect, by drive.parameter.

    A parameter for which the file has none is taken as exact.
    """
    below = keys.below(values, f'{UNCERTAINTIES}.{effect}.')
    return {key: float(std) for key, std in below.items()}


def check_uncertainties(parameters: Mapping[str, Any]) -> None:
    """Raise ModelError for an uncertainty that is none, or of nothing that an effect has."""
    active = parameters.get('effects.active') or ()
    for of, value in keys.below(parameters, f'{UNCERTAINTIES}.').items():
        key, (name, _, rest) = f'{UNCERTAINTIES}.{of}', of.partition('.')
        if find_effect(name) is None or not rest:
            raise UnknownNameError('key', key, [
                f'{UNCERTAINTIES}.{effect}' for effect in active])
        if name in active and f'effects.{of}' not in parameters:
            raise ModelError(key, value, f'belong to effects.{of}, which is not there: take the '
                             'line out')
        keys.Key(key, 'a standard deviation', lower=0).check(value)


def added_effects(parameters: Mapping[str, Any], robot: Any) -> Iterator[CatalogueEffect]:
    """Yield the effects that are active on a robot, all blocks checked."""
    active = ACTIVE.check(parameters.get(ACTIVE.name, []))
    if len(set(active)) < len(active):
        raise ModelError('effects.active', list(active), 'name each effect once')
    for name in active:
        if find_effect(name) is None:
            raise _unknown(name, 'effects.active')
    of_sensors = _effects_of_sensors(parameters)
    blocks = keys.blocks_below({k: value for k, value in parameters.items() if k not in LISTS},
                               'effects.')
    for name, values in blocks.items():
        # Of a key that ends with the name, or with a dot behind it.
        if (value := values.pop('', None)) not in (None, {}):
            raise ModelError(f'effects.{name}', value, 'be a mapping of its parameters')
        found = find_effect(name)
        if found is None:
            raise _unknown(name, 'effects')
        _check_place(name, values, found, robot, keys.title_of(parameters))
        # A block that is not active is checked all the same, but may still be incomplete.
        bound = found.bound(robot)
        if name not in active:
            bound.checked(values, is_complete=False, turning=robot.turning)
            continue
        effect = bound.from_file(values, robot.turning)
        if name in of_sensors:
            effect.is_measurement = True
        yield effect
    missing = [name for name in active if name not in blocks]
    if missing:
        raise ModelError(f'effects.{missing[0]}', MISSING, 'be given: effects.active names it')


def _unknown(name: str, place: str) -> UnknownNameError:
    return UnknownNameError('effect', name, catalogue(), place)


def _check_place(name: str, values: Mapping[str, Any], effect: type[CatalogueEffect], robot: Any,
                 title: str) -> None:
    """Raise ModelError where an effect is not one of this kind of robot, or on another drive."""
    if robot.kind not in effect.acts_in:
        raise ModelError(f'effects.{name}', dict(values), 'be an effect that acts in ' + title)
    for key in values if issubclass(effect, DriveEffect) else ():
        if (drive := key.rpartition('.')[0] or key) not in robot.drives:
            raise UnknownNameError('drive', drive, robot.drives, f'effects.{name}')


def _effects_of_sensors(parameters: Mapping[str, Any]) -> Any:
    if (key := LISTS[1]) not in parameters:
        return ()
    known = tuple(name for name, effect in catalogue().items() if effect.may_be_measurement)
    return keys.Key(key, "effects that may be a sensor's", size=keys.ANY, choices=known).check(
        parameters[key])


def check_tolerances(parameters: Mapping[str, Any], known: Mapping[str, keys.Key]) -> None:
    """Raise ModelError for a tolerance that is none, or of nothing that has one.

    Numbers of the model have one, in proportion to them; and what is usually small where a file
    says nothing, such as the error of a zero, in its unit.
    """
    for target, value in keys.below(parameters, 'tolerances.').items():
        name, parameter = f'tolerances.{target}', find_parameter(target)
        if not (known[target].is_number if target in known else parameter and parameter.expected):
            raise UnknownNameError('key', name, [f'tolerances.{key}' for key in known
                                                 if known[key].is_number])
        keys.Key(name, 'a relative tolerance', lower=0, upper=1).check(value)


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
    known = keys.keys_of(parameters)
    _require_known(parameters, known)
    for name, key in known.items():
        if name in parameters:
            values[name] = key.check(parameters[name])
        elif key.default is None:
            raise ModelError(name, MISSING, key.rule)
        else:
            values[name] = key.default
    check_tolerances(parameters, known)
    check_uncertainties(parameters)
    check_reference(parameters)
    return {**values, **{name: value for name, value in parameters.items()
                         if name.startswith(keys.ADDED)}}


def _require_known(parameters: Mapping[str, Any], known: Mapping[str, keys.Key]) -> None:
    in_blocks = (*known, *keys.ADDED, *(keys.NAMED if keys.is_described(parameters) else ()))
    for name, value in parameters.items():
        if name in known or _is_for_others(name):
            continue
        if not any(key.startswith(f'{name}.') for key in in_blocks):
            raise UnknownNameError('key', name, (*known, *keys.NODE_KEYS))
        if value not in (None, {}):  # an empty block says nothing
            raise ModelError(name, value, 'be a mapping, of names to their content')


def is_known(name: str) -> bool:
    """Return whether a model file may hold a key of that name."""
    return name in keys.NAMES or _is_for_others(name)


def _is_for_others(name: str) -> bool:
    """Return whether a key is a node's, or of a block whose keys are not listed one by one."""
    return name in keys.NODE_KEYS or name.startswith((*keys.NODE_PREFIXES, *keys.ADDED))
