# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Copy errors of benchmarks/results/emps.md to docs/real_drive.md: python docs/real_drive.py."""

from __future__ import annotations

from pathlib import Path

from page_block import replace_block

PAGE = Path(__file__).parent / 'real_drive.md'
RESULTS = Path(__file__).parents[1] / 'benchmarks' / 'results' / 'emps.md'
BEGIN, END = '<!-- errors: written by docs/real_drive.py -->', '<!-- end of errors -->'
# Rows of the page, and how the row of the results begins; the last one that does is taken.
ROWS = {
    'published model': 'published',
    'adopted effects, judged on blocks of the identification run': 'gated by blocks',
    'adopted effects, judged on the pulses run': 'gated by pulses run'}


def table() -> str:
    """Return the errors that `pprs compare` prints before and after adoption, in Markdown."""
    along = RESULTS.read_text(encoding='utf-8').partition('## Error along the loop')[2]
    lines = ['| | identification run | pulses run |', '|---|---|---|']
    for name, begins in ROWS.items():
        row = [line for line in along.splitlines() if line.startswith(f'| {begins}')][-1]
        lines.append('|'.join([f'| {name} ', *row.split('|')[-3:]]))
    return '\n'.join(lines)


if __name__ == '__main__':
    replace_block(PAGE, BEGIN, END, table())
