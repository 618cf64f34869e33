# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How a model's drives are called on the machine: in messages, and in the columns of files.

A model file may hold `joint_prefix`, `joint_map: {DRIVE: JOINT}` and `columns: {time: COLUMN,
time_scale: NUMBER, rate: NUMBER, decimal: ",", files: {position: FILE, …}, DRIVE: {position:
COLUMN, velocity: COLUMN, effort: COLUMN or current: COLUMN, temperature: COLUMN, pressure: COLUMN,
effort_scale: NUMBER, position_scale: NUMBER, position_offset: NUMBER, velocity_scale: NUMBER,
effort_sign_bit: NUMBER}}`, a `temperature: COLUMN` or `pressure: COLUMN` of the whole machine
there, and `effort_kind`: what efforts are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pprs_dynamics.drives import CHANNELS, Column, DriveColumns, RecordedColumns
from pprs_dynamics.errors import ModelError, UnknownNameError
from pprs_dynamics.physics.model.keys import GAIN

PREFIX, MAP, COLUMNS = 'joint_prefix', 'joint_map.', 'columns.'
TIME, FILES = 'time', 'files.'
LARGEST_BIT = 31
QUANTITIES = ('position', 'velocity', 'effort', 'current', *CHANNELS)
SCALES = ('effort_scale', 'position_scale', 'velocity_scale')
OFFSET, SIGN_BIT = 'position_offset', 'effort_sign_bit'
OF_TABLE = (TIME, 'time_scale', 'rate', 'decimal', *CHANNELS)
OF_FILES = (TIME, *QUANTITIES)
EFFORT_KIND = 'effort_kind'
MEASURED, CURRENT, COMMANDED, WITHOUT_GRAVITY, EXTERNAL = EFFORT_KINDS = (
    'measured', 'current', 'commanded', 'without_gravity', 'external')


def joint_names(values: Mapping[str, Any], drives: Sequence[str]) -> tuple[str, ...]:
    """Return what messages and recordings call the drives, in their order.

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
    prefix = _word(PREFIX, values.get(PREFIX, ''), may_be_empty=True)
    for key in values:
        if key.startswith(MAP) and key.removeprefix(MAP) not in drives:
            raise UnknownNameError('drive', key.removeprefix(MAP), drives, key)
    names = tuple(_word(f'{MAP}{drive}', values[f'{MAP}{drive}']) if f'{MAP}{drive}' in values
                  else f'{prefix}{drive}' for drive in drives)
    for number, name in enumerate(names):
        if name in names[:number]:
            raise ModelError(f'{MAP}{drives[number]}', name, 'be another name than that of '
                             f'{drives[names.index(name)]}')
    return names


def effort_kind(values: Mapping[str, Any]) -> str:
    """Return what the efforts of recordings are, by a model file: one of `EFFORT_KINDS`.

    Raises
    ------
    ModelError
        For another word, and for currents of a model without a gain.
    """
    kind = values.get(EFFORT_KIND, MEASURED)
    if not isinstance(kind, str) or kind not in EFFORT_KINDS:
        raise ModelError(EFFORT_KIND, kind, f'be one of {", ".join(EFFORT_KINDS)}')
    if kind == CURRENT and GAIN not in values:
        raise ModelError(EFFORT_KIND, kind, 'be another one: a 3-PPRS has no gain by which '
                         'currents become efforts')
    return kind


def gravity_in_efforts(values: Mapping[str, Any], key: str) -> Any:
    """Return the gravity that the efforts of a model's drives hold [m/s^2].

    Parameters
    ----------
    values : mapping
        Of all keys of a model.
    key : str
        That of gravity: a number, or the vector in the base.
    """
    gravity = values[key]
    if effort_kind(values) != WITHOUT_GRAVITY:
        return gravity
    return 0.0 if isinstance(gravity, float) else (0.0,) * len(gravity)


def recorded_columns(values: Mapping[str, Any], drives: Sequence[str]) -> RecordedColumns | None:
    """Return the columns that a model file names; None where it names none.

    Raises
    ------
    ModelError
        For keys that are none, columns that are neither names nor numbers, scales and rates that
        are no numbers.
    """
    given = {key.removeprefix(COLUMNS): value
             for key, value in values.items() if key.startswith(COLUMNS)}
    if not given:
        return None
    for key in given:
        _require_known(key, drives)
    found = {}
    for drive in drives:
        names = {quantity: _column(f'{drive}.{quantity}', given[f'{drive}.{quantity}'])
                 for quantity in QUANTITIES if f'{drive}.{quantity}' in given}
        effort, position, velocity = (
            _factor(f'{drive}.{scale}', given[f'{drive}.{scale}'])
            if f'{drive}.{scale}' in given else None for scale in SCALES)
        offset, bit = (given.get(f'{drive}.{key}') for key in (OFFSET, SIGN_BIT))
        # Degrees of a position are those of its velocity, but where that says otherwise.
        found[drive] = DriveColumns(
            names, effort or 1.0, position or 1.0, velocity or position or 1.0,
            0.0 if offset is None else _factor(f'{drive}.{OFFSET}', offset, may_be_zero=True),
            None if bit is None else _bit(f'{drive}.{SIGN_BIT}', bit))
    if given.get('decimal', '.') not in ('.', ','):
        raise ModelError(f'{COLUMNS}decimal', given['decimal'], 'be "." or ","')
    rate = _factor('rate', given['rate']) if 'rate' in given else None
    if rate is not None and rate < 0:
        raise ModelError(f'{COLUMNS}rate', rate, 'be greater than 0 (samples per second [Hz])')
    files = {quantity: _word(f'{COLUMNS}{FILES}{quantity}', given[f'{FILES}{quantity}'])
             for quantity in OF_FILES if f'{FILES}{quantity}' in given}
    if files and 'position' not in files:
        raise ModelError(f'{COLUMNS}{FILES}position', '', 'name the file of positions')
    return RecordedColumns(
        _column(TIME, given[TIME]) if TIME in given else None, found,
        _factor('time_scale', given['time_scale']) if 'time_scale' in given else None, rate,
        given.get('decimal', '.'), files,
        {name: _column(name, given[name]) for name in CHANNELS if name in given})


def _require_known(key: str, drives: Sequence[str]) -> None:
    """Raise UnknownNameError for a key of the block that is none."""
    if key in OF_TABLE or key.removeprefix(FILES) in (OF_FILES if FILES in key else ()):
        return
    drive, _, quantity = key.partition('.')
    if drive not in drives:
        raise UnknownNameError('drive', drive, (*drives, *OF_TABLE, 'files'), f'{COLUMNS}{key}')
    known = (*QUANTITIES, *SCALES, OFFSET, SIGN_BIT)
    if quantity not in known:
        raise UnknownNameError('key', f'{COLUMNS}{key}', [
            f'{COLUMNS}{drive}.{name}' for name in known])


def _column(key: str, value: Any) -> Column:
    """Return a column's name, or its number from 1, which a node's parameter has as a float."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, int) and not isinstance(value, bool):
        if value < 1:
            raise ModelError(f'{COLUMNS}{key}', value, 'be a name, or a number from 1')
        return value
    if not isinstance(value, str) or not value.strip():
        raise ModelError(f'{COLUMNS}{key}', value, 'be the name of a column, or its number')
    return value


def _word(key: str, value: Any, may_be_empty: bool = False) -> str:
    if not isinstance(value, str) or not (value.strip() or (may_be_empty and not value)):
        raise ModelError(key, value, 'be a name')
    return value


def _factor(key: str, value: Any, may_be_zero: bool = False) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or (
            not math.isfinite(value) or (value == 0 and not may_be_zero)):
        raise ModelError(f'{COLUMNS}{key}', value, 'be a finite number'
                         + ('' if may_be_zero else ' other than 0'))
    return float(value)


def _bit(key: str, value: Any) -> int:
    if isinstance(value, bool) or value not in range(1, LARGEST_BIT + 1):
        raise ModelError(f'{COLUMNS}{key}', value, f'be the number of a bit, 1 to {LARGEST_BIT}')
    return int(value)
