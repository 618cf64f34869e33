# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What axe-core finds wrong with a page, for those who do not see or do not use a mouse."""

from __future__ import annotations

from typing import Any

GRAVE = ('serious', 'critical')  # its own words for the two upper of four levels


def broken_rules(tab: Any) -> list[str]:
    """Return the rules that a page breaks gravely, each with the first element that does."""
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(tab).response['violations']
    return [f'{v["id"]}: {v["nodes"][0]["target"]} {v["nodes"][0]["failureSummary"]}'
            for v in found if v['impact'] in GRAVE]
