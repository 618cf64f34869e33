# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Text for every terminal and file: plain characters, and names of files as they can be shown."""

from __future__ import annotations

import codecs

# Name of the error handler for streams that are not UTF-8.
PLAIN = 'pprs_plain'
# What the package prints beyond ASCII, and what comes near it there.
SUBSTITUTES = {'…': '...', '±': '+/-', '²': '^2', '°': ' deg', '·': '*', '→': '->',
               '\u2013': '-', '\u2014': '-', 'µ': 'u', 'μ': 'u', '█': '#', '▏': '|'}


def displayed(name: object) -> str:
    """Return a name, of a file or in one, without what cannot be shown or written as UTF-8.

    Bytes that are not UTF-8 become `\\xff`, control characters what Python writes for them.
    """
    return ''.join(character if character.isprintable() else _escaped(character)
                   for character in str(name))


def _escaped(character: str) -> str:
    # Python keeps a file name's undecodable byte 0xff as the lone surrogate U+DCFF.
    if '\udc80' <= character <= '\udcff':
        return f'\\x{ord(character) - 0xdc00:02x}'
    return character.encode('unicode_escape').decode('ascii')


def _in_plain(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return ''.join(SUBSTITUTES.get(character) or _escaped(character)
                   for character in error.object[error.start:error.end]), error.end


codecs.register_error(PLAIN, _in_plain)
