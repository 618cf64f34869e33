# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Quantities, units, joints, and commands or measurements, by the names of columns."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence, Sized

from pprs_dynamics.drives import Column, DriveColumns
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.table import CURRENT, EFFORT, POSITION, VELOCITY
from pprs_dynamics.measurement.files.samples import Series

QUANTITIES = {word for words in table.WORDS.values() for word in words}
KNOWN = QUANTITIES | table.OTHERS
ROLE = '(ist|soll|act|cmd|meas|fbk|des|ref)'
# Words that another may precede in one: Gelenkmoment, but not timestamp nor payload.
LONG, LONGER = ('|'.join(sorted((word for word in QUANTITIES if len(word) >= least), reverse=True))
                for least in (3, 5))
COMPOUND = re.compile(f'(?:j|{ROLE})?({LONG}|d?qd?)(?:e?[ns])?(?:{ROLE}(?:wert)?)?'
                      f'|([a-z]{{3,}})({LONGER})(?:e?[ns])?(?:{ROLE}(?:wert)?)?')


def words_of(title: str) -> list[str]:
    """Return the words and numbers of a name, in lower case; a unit as its quantity, `<effort>`."""
    plain, unit = _without_unit(title)
    return plain if unit is None else [*plain, f'<{unit[0]}>']


def unit_of(title: str) -> tuple[str, float] | None:
    """Return the quantity that the unit in a name is of, and its factor to SI; None for none."""
    return _without_unit(title)[1]


def _without_unit(title: str) -> tuple[list[str], tuple[str, float] | None]:
    """Return the words of a name without its unit, and the unit."""
    for bracket in re.finditer(r'[\[(]([^\])]*)[\])]', title):
        if unit := _unit(re.sub(r'[ ._*·^-]', '', bracket[1].lower())):
            return _words(title[:bracket.start()] + ' ' + title[bracket.end():]), unit
    words = _words(title)
    for length in (2, 1):
        for at in range(len(words) - length, -1, -1):
            some = words[at:at + length]
            # Single letters are units in brackets alone.
            if (len(some[0]) > 1 or not some[0].isalpha()) and (
                    unit := _unit('/'.join(some)) or _unit(''.join(some))):
                return words[:at] + words[at + length:], unit
    return words, None


def _unit(name: str) -> tuple[str, float] | None:
    return next(((quantity, units[name]) for quantity, units in table.UNITS.items()
                 if name in units), None)


def _words(text: str) -> list[str]:
    parts = re.sub(r'([a-z])(?<!\bm)([A-Z])', r'\1 \2', text.replace('_', ' '))  # not in mA
    found = re.findall(r'[^\W\d_]+|\d+|[°%‰]', parts.lower())
    return [part for word in found for part in _split(word)]


def _split(word: str) -> list[str]:
    """Return the parts of a word that is several in one: posa, taum, Istposition, Gelenkwinkel.

    The last letter of a quantity says actual or desired. A German or joined word ends in a
    quantity, perhaps followed by ist or soll.
    """
    if word in KNOWN or not word.isalpha():
        return [word]
    if word[:-1] in QUANTITIES and (len(word) > 3 or word[0] in 'qd') and (
            word[-1] in table.LETTERS):
        return [word[:-1], table.LETTERS[word[-1]]]
    compound = COMPOUND.fullmatch(word)
    return [part for part in compound.groups() if part] if compound else [word]


def kinds_of(words: Collection[str]) -> set[str]:
    """Return the quantities that the words of a name may name; empty where they name none."""
    words = {*words}
    if words & table.OTHERS:
        return {table.NEITHER}
    kinds = {kind for kind in table.UNITS if f'<{kind}>' in words} - {table.SHARE}
    # A single letter next to a word is a prefix of programmers.
    for known in ({word for word in words if len(word) > 1}, words):
        kinds = kinds or {kind for kind, named in table.WORDS.items() if known & {*named}}
    if not kinds and words & table.OF_JOINTS:
        return {POSITION}  # "joint torque" is no position
    return kinds - {EFFORT} if CURRENT in kinds else kinds


def fit_of_name(key: tuple[str, ...], members: Sized, quantity: str, given: str | None,
                ) -> tuple[float, ...]:
    """Return how well a group of columns fits a quantity; not at all below 0."""
    kinds = kinds_of(key)
    # The name of the joint alone is a position, as in `shoulder_pan`.
    plain = not kinds and not {*key} - {'*', 'observation'} - table.MEASURED
    fits = quantity in kinds or (given is not None and table.NEITHER not in kinds) or (
        quantity == POSITION and plain)
    if not fits or (quantity == POSITION and VELOCITY in kinds):
        return (-1.0,)
    return (float(len(members)), float(not {*key} & (table.COMMANDS | table.FROM_OUTSIDE)),
            float(not {*key} & table.SECONDARY), float(bool({*key} & table.MEASURED)),
            -float(len(key)))


def may_be(title: str, quantity: str) -> bool:
    """Return whether the words of a name say no other quantity."""
    kinds = kinds_of(words_of(title))
    return not kinds or quantity in kinds or (quantity == EFFORT and CURRENT in kinds)


def joint_in(words: Sequence[str], joints: Sequence[str]) -> tuple[str, int, int] | None:
    """Return the joint whose name is among the words, where, and how long it is."""
    found = []
    for joint in joints:
        own = words_of(joint)
        shorter = [word for word in own if word != 'joint']
        found += [(joint, at, len(name)) for name in (own, shorter)
                  if name != ['joint'] and not all(word.isdigit() for word in name)
                  for at in range(len(words)) if [*words[at:at + len(name)]] == name]
    return max(found, key=lambda place: place[2], default=None)


def numbered(series: Sequence[Series]) -> dict[tuple[str, ...], dict[int, Column]]:
    """Return columns that differ in a number alone, by their other words; gaps end them."""
    found: dict[tuple[str, ...], dict[int, Column]] = {}
    for item in series:
        words = words_of(item.title)
        for at, word in enumerate(words):
            if word.isdigit() and len(word) < 4:
                key = (*words[:at], '*', *words[at + 1:])
                found.setdefault(key, {}).setdefault(int(word), item.column)
    return {key: numbers for key, numbers in found.items()
            if len(numbers) > 1 and max(numbers) - min(numbers) == len(numbers) - 1}


def scale_of(title: str, quantity: str) -> float | None:
    """Return the factor to SI of a quantity by the unit in a name; None for none and for 1."""
    unit = unit_of(title)
    return unit[1] if unit and unit[1] != 1 and (
        unit[0] == quantity or (unit[0] == table.SHARE and quantity == EFFORT)) else None


def is_share(columns: DriveColumns) -> bool:
    """Return whether efforts are read as a share of an unknown effort."""
    title = columns.names.get(EFFORT)
    return isinstance(title, str) and f'<{table.SHARE}>' in words_of(title) and (
        columns.effort_scale in (1.0, scale_of(title, EFFORT)))
