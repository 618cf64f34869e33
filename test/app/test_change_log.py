# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a browser is sent of a state that changes while it is looked at."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from pprs_dynamics.app.workbench.server.change_log import ChangeLog

EFFECTS: list[dict[str, Any]] = [{'name': 'payload_mass'}]


@given(st.lists(st.tuples(st.sampled_from(['change', 'tell', 'look', 'late']),
                          st.integers(0, 2)), max_size=30))
def test_no_browser_misses_a_change(deeds: list[tuple[str, int]]) -> None:
    """Three browsers ask when they were told of a later version than theirs; one changes often."""
    log, value = ChangeLog(), 0
    have = [{'version': -1, 'value': -1} for _ in range(3)]

    def look(browser: int, late: bool = False) -> None:
        seen, state = log.version, {'value': value, 'effects': EFFECTS}
        if late:
            log.count()
        version = log.update(state, seen)
        have[browser] |= {'value': have[browser]['value'],
                          **{key: part for key, part in
                             log.since(have[browser]['version']).items() if key == 'value'},
                          'version': version}

    for deed, browser in deeds:
        if deed == 'change':
            value += 1
        elif deed == 'tell':
            log.count()
        else:
            look(browser, deed == 'late')
    log.count()  # every change is told at last
    for browser, state in enumerate(have):
        if log.version > state['version']:
            look(browser)
    assert [state['value'] for state in have] == [value] * 3
