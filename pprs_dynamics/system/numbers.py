# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Numbers in text: of the command line and of CSV files.

Python's own `float` and `int` read more than people mean: `1_0` as ten, and digits of every
script.
"""

from __future__ import annotations

import re

LONGEST = 400  # characters; Python refuses to read whole numbers of thousands
NUMBER = re.compile(r'[+-]?((\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|nan|inf|infinity)',
                    re.ASCII | re.IGNORECASE)
WHOLE = re.compile(r'\d+', re.ASCII)


def parse_number(text: str) -> float:
    """Return the number that a text is, blanks around it aside; may be infinite or NaN.

    Raises
    ------
    ValueError
        Where it is none.
    """
    text = text.strip(' \t\r\n')
    if len(text) > LONGEST or not NUMBER.fullmatch(text):
        raise ValueError(f'{text[:30]!r} is no number')
    return float(text)


def parse_whole(text: str) -> int:
    """Return the whole number, at least 0, that a text is.

    Raises
    ------
    ValueError
        Where it is none.
    """
    if len(text) > LONGEST or not WHOLE.fullmatch(text):
        raise ValueError(f'{text[:30]!r} is no whole number')
    return int(text)
