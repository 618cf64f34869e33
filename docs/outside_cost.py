# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Write the rules outside the cost in docs/diagnosis.md: python docs/outside_cost.py."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from page_block import replace_block

from pprs_dynamics.inference.search.decisions import OUTSIDE_COST

import_module('pprs_dynamics.inference.adoption.adopt')  # lists all rules
PAGE = Path(__file__).parent / 'diagnosis.md'
BEGIN, END = '<!-- rules: written by docs/outside_cost.py -->', '<!-- end of rules -->'


def table() -> str:
    """Return the rules as a table in Markdown."""
    rows = [f'| {rule} | `{name}` |' for name, rule in sorted(OUTSIDE_COST.items())]
    return '\n'.join(['| rule | code |', '|---|---|', *rows])


if __name__ == '__main__':
    replace_block(PAGE, BEGIN, END, table())
