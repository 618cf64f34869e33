# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Names of a model's drives on the machine: in messages, and in the columns of files.

A model file may hold `joint_prefix`, `joint_map: {DRIVE: JOINT}` and `columns: {time: COLUMN,
time_fraction: COLUMN, time_scale: NUMBER, rate: NUMBER, decimal: ",", files: {position: FILE, …},
DRIVE: {position: COLUMN, velocity: COLUMN, effort: COLUMN or current: COLUMN, temperature: COLUMN,
pressure: COLUMN, effort_scale: NUMBER, position_scale: NUMBER, position_offset: NUMBER,
velocity_scale: NUMBER, effort_sign_bit: NUMBER}}`, a `temperature: COLUMN` or `pressure: COLUMN` of
the whole machine there, and `effort_kind`: what efforts are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from pprs_dynamics.drives import CHANNELS, Column, DriveColumns, RecordedColumns
from pprs_dynamics.errors import ModelError, UnknownNameError
from pprs_dynamics.physics.model.keys import GAIN, Key, below

PREFIX, MAP, COLUMNS = 'joint_prefix', 'joint_map.', 'columns.'
TIME, FRACTION, FILES = 'time', 'time_fraction', 'files.'
LARGEST_BIT = 31
QUANTITIES = ('position', 'velocity', 'effort', 'current', *CHANNELS)
SCALES = ('effort_scale', 'position_scale', 'velocity_scale')
Check = Callable[[str, Any], Any]  # from a key and its value to the value, checked
OFFSET, SIGN_BIT = 'position_offset', 'effort_sign_bit'
EFFORT_KIND = 'effort_kind'
MEASURED, CURRENT, COMMANDED, WITHOUT_GRAVITY, EXTERNAL = EFFORT_KINDS = (
    'measured', 'current', 'commanded', 'without_gravity', 'external')


def joint_names(values: Mapping[str, Any], drives: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the drives in messages and recordings, in their order.

    Parameters
    ----------
    values : mapping
        Flat keys and values of a model file.
    drives : sequence of D str

    Raises
    ------
    ModelError
        For a prefix or name that is no word, a drive that is not there, two drives of one name.
    """
    prefix = Key(PREFIX, 'what joints have before the names of drives', is_text=True,
                 may_be_empty=True).check(values.get(PREFIX, ''))
    for key in values:
        if key.startswith(MAP) and key.removeprefix(MAP) not in drives:
            raise UnknownNameError('drive', key.removeprefix(MAP), drives, key)
    names = tuple(_name(f'{MAP}{drive}', values.get(f'{MAP}{drive}', f'{prefix}{drive}'))
                  for drive in drives)
    for number, name in enumerate(names):
        if name in names[:number]:
            raise ModelError(f'{MAP}{drives[number]}', name, 'be another name than that of '
                             f'{drives[names.index(name)]}')
    return names


def effort_kind(values: Mapping[str, Any]) -> str:
    """Return the kind of recorded efforts by a model file: one of `EFFORT_KINDS`.

    Raises
    ------
    ModelError
        For another word, and for currents of a model without a gain.
    """
    kind: str = Key(EFFORT_KIND, 'what the efforts of recordings are',
                    choices=EFFORT_KINDS).check(values.get(EFFORT_KIND, MEASURED))
    if kind == CURRENT and GAIN not in values:
        raise ModelError(EFFORT_KIND, kind, 'be another one: a 3-PPRS has no gain by which '
                         'currents become efforts')
    return kind


def gravity_in_efforts(values: Mapping[str, Any], key: str) -> Any:
    """Return the gravity in the base that the efforts of a model's drives contain [m/s^2].

    Parameters
    ----------
    values : mapping
        Of all keys of a model.
    key : str
        That of gravity.
    """
    return (0.0,) * 3 if effort_kind(values) == WITHOUT_GRAVITY else values[key]


def recorded_columns(values: Mapping[str, Any], drives: Sequence[str]) -> RecordedColumns | None:
    """Return the columns that a model file names; None where it names none.

    Raises
    ------
    ModelError
        For keys that are none, columns that are neither names nor numbers, scales and rates that
        are no numbers.
    """
    given = below(values, COLUMNS)
    if not given:
        return None
    known = {**OF_TABLE, **{f'{drive}.{quantity}': check for drive in drives
                            for quantity, check in OF_DRIVE.items()}}
    for key, value in given.items():
        drive, _, quantity = key.partition('.')
        if quantity and drive not in (*drives, 'files'):
            raise UnknownNameError('drive', drive, drives, f'{COLUMNS}{key}')
        if key not in known:
            raise UnknownNameError('key', f'{COLUMNS}{key}', [f'{COLUMNS}{name}' for name in known])
        given[key] = known[key](f'{COLUMNS}{key}', value)
    found = {}
    for drive in drives:
        own = below(given, f'{drive}.')
        position = own.get('position_scale', 1.0)
        # Degrees of a position are those of its velocity, but where that says otherwise.
        found[drive] = DriveColumns(
            {quantity: own[quantity] for quantity in QUANTITIES if quantity in own},
            own.get('effort_scale', 1.0), position, own.get('velocity_scale', position),
            own.get(OFFSET, 0.0), own.get(SIGN_BIT))
    files = below(given, FILES)
    if files and 'position' not in files:
        raise ModelError(f'{COLUMNS}{FILES}position', '', 'name the file of positions')
    return RecordedColumns(
        given.get(TIME), found, given.get('time_scale'), given.get('rate'),
        given.get('decimal', '.'), files,
        {name: given[name] for name in CHANNELS if name in given}, given.get(FRACTION))


def _column(key: str, value: Any) -> Column:
    """Return a column's name, or its number from 1, which a node's parameter has as a float."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, int) and not isinstance(value, bool):
        if value < 1:
            raise ModelError(key, value, 'be a name, or a number from 1')
        return value
    if not isinstance(value, str) or not value.strip():
        raise ModelError(key, value, 'be the name of a column, or its number')
    return value


def _factor(key: str, value: Any) -> float:
    factor: float = Key(key, 'what values are multiplied by').check(value)
    if factor == 0:
        raise ModelError(key, value, 'be a finite number other than 0')
    return factor


def _bit(key: str, value: Any) -> int:
    if isinstance(value, bool) or value not in range(1, LARGEST_BIT + 1):
        raise ModelError(key, value, f'be the number of a bit, 1 to {LARGEST_BIT}')
    return int(value)


def _as(declared: Key) -> Check:
    return lambda key, value: replace(declared, name=key).check(value)


_name = _as(Key('', 'of a joint, or a file', is_text=True))
OF_TABLE: dict[str, Check] = {
    TIME: _column, FRACTION: _column, 'time_scale': _factor,
    'rate': _as(Key('', 'samples per second', 'Hz', positive=True)),
    'decimal': _as(Key('', 'mark of decimals', choices=('.', ','))),
    **dict.fromkeys(CHANNELS, _column),
    **{f'{FILES}{quantity}': _name for quantity in (TIME, *QUANTITIES)}}
OF_DRIVE: dict[str, Check] = {
    **dict.fromkeys(QUANTITIES, _column), **dict.fromkeys(SCALES, _factor),
    OFFSET: _as(Key('', 'what is added to positions')), SIGN_BIT: _bit}
