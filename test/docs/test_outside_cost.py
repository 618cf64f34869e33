# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The page on the diagnosis lists everything that changes an answer other than the cost."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from pprs_dynamics.inference.search.decisions import OUTSIDE_COST

import_module('pprs_dynamics.inference.adoption.adopt')  # lists all rules
PAGE = Path(__file__).parents[2] / 'docs' / 'diagnosis.md'


def test_the_page_lists_at_most_twelve_rules_outside_the_cost() -> None:
    text = PAGE.read_text(encoding='utf-8')
    assert 0 < len(OUTSIDE_COST) <= 12
    for name, rule in OUTSIDE_COST.items():
        assert f'| {rule} | `{name}` |' in text
