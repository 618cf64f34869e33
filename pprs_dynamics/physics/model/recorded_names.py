# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How a model's drives are called on the machine: in messages, and in the columns of files.

A model file may hold `joint_prefix`, `joint_map: {DRIVE: JOINT}` and `columns: {time: NAME, DRIVE:
{position: NAME, velocity: NAME, effort: NAME, scale: NUMBER, position_scale: NUMBER}}`, and what
the efforts are: `effort_kind`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pprs_dynamics.drives import DriveColumns, RecordedColumns
from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.model.keys import is_gain

PREFIX, MAP, COLUMNS = 'joint_prefix', 'joint_map.', 'columns.'
TIME = 'columns.time'
EFFORT_KIND = 'effort_kind'
MEASURED, CURRENT, COMMANDED, WITHOUT_GRAVITY = EFFORT_KINDS = (
    'measured', 'current', 'commanded', 'without_gravity')
QUANTITIES = ('position', 'velocity', 'effort')
SCALES = {'scale': 'effort', 'position_scale': 'position'}


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
    if kind == CURRENT and not any(is_gain(key) for key in values):
        raise ModelError(EFFORT_KIND, kind, 'be another one: only an arm and a robot with loops '
                         'have a gain, by which currents become efforts')
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
        For keys that are none, names that are no words, scales that are no numbers, and where
        the column of time or of a drive's position is missing.
    """
    given = {key: value for key, value in values.items() if key.startswith(COLUMNS)}
    if not given:
        return None
    for key in given:
        drive, _, quantity = key.removeprefix(COLUMNS).partition('.')
        if key != TIME and drive not in drives:
            raise UnknownNameError('drive', drive, (*drives, 'time'), key)
        if key != TIME and quantity not in (*QUANTITIES, *SCALES):
            raise UnknownNameError('key', key, [f'{COLUMNS}{drive}.{one}'
                                                for one in (*QUANTITIES, *SCALES)])
    if TIME not in given:
        raise ModelError(TIME, MISSING, 'name the column of time [s]')
    found = {}
    for drive in drives:
        keys = {quantity: f'{COLUMNS}{drive}.{quantity}' for quantity in QUANTITIES}
        names = {quantity: _word(key, given[key]) for quantity, key in keys.items()
                 if key in given}
        if 'position' not in names:
            raise ModelError(f'{COLUMNS}{drive}.position', MISSING, 'name the column of positions')
        scales = {of: _factor(f'{COLUMNS}{drive}.{key}', given.get(f'{COLUMNS}{drive}.{key}', 1.0))
                  for key, of in SCALES.items()}
        found[drive] = DriveColumns(names, scales['effort'], scales['position'])
    return RecordedColumns(_word(TIME, given[TIME]), found)


def _word(key: str, value: Any, may_be_empty: bool = False) -> str:
    if not isinstance(value, str) or not (value.strip() or (may_be_empty and not value)):
        raise ModelError(key, value, 'be a name')
    return value


def _factor(key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or (
            not math.isfinite(value) or value == 0):
        raise ModelError(key, value, 'be a finite number other than 0')
    return float(value)
