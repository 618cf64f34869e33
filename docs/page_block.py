# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Blocks of a page that a script writes, between two comments."""

from __future__ import annotations

from pathlib import Path


def replace_block(page: Path, begin: str, end: str, text: str) -> None:
    """Replace what is between two comments of a page."""
    before, _, rest = page.read_text(encoding='utf-8').partition(begin)
    page.write_text(f'{before}{begin}\n\n{text}\n\n{end}{rest.partition(end)[2]}',
                    encoding='utf-8')
