# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Sanitised text for terminals and files: control characters, undecodable file names."""

from __future__ import annotations

import codecs
from collections.abc import Sequence
from typing import Any

# Name of the error handler for streams that are not UTF-8.
PLAIN = 'pprs_plain'
# What the package prints beyond ASCII, and what comes near it there.
SUBSTITUTES = {'…': '...', '±': '+/-', '²': '^2', '°': ' deg', '·': '*', '→': '->',
               '\u2013': '-', '\u2014': '-', 'µ': 'u', 'μ': 'u', '█': '#', '▏': '|'}


def displayed(name: object) -> str:
    r"""Return a name, of a file or in one, without what cannot be shown or written as UTF-8.

    Bytes that are not UTF-8 become `\xff`, control characters what Python writes for them.
    """
    return ''.join(character if character.isprintable() else _escaped(character)
                   for character in str(name))


def counted(count: int, thing: str) -> str:
    """Return '1 step', '3 steps' or '2 bodies'; `thing` may go on: 'number of the model'."""
    noun, _, rest = thing.partition(' ')
    if count != 1:
        noun = f'{noun[:-1]}ies' if noun.endswith('dy') else f'{noun}s'
    return f'{count} {noun}{" " * bool(rest)}{rest}'


def first_of(names: Sequence[str], most: int) -> str:
    """Return 'a, b, c and 4 more'."""
    more = f' and {len(names) - most} more' if len(names) > most else ''
    return ', '.join(names[:most]) + more


def _escaped(character: str) -> str:
    # Python keeps a file name's undecodable byte 0xff as the lone surrogate U+DCFF.
    if '\udc80' <= character <= '\udcff':
        return f'\\x{ord(character) - 0xdc00:02x}'
    return character.encode('unicode_escape').decode('ascii')


def _in_plain(error: Any) -> tuple[str, int]:
    return ''.join(SUBSTITUTES.get(character) or _escaped(character)
                   for character in error.object[error.start:error.end]), error.end


codecs.register_error(PLAIN, _in_plain)
